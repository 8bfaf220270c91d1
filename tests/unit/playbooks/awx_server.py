# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""As much of AWX's REST API as the modules of awx.awx ask for: objects by kind, and what they are associated with."""

from __future__ import annotations

import json
import threading
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any
from urllib.parse import parse_qsl, urlparse

Object = dict[str, Any]
TEMPLATES = ("job_templates", "projects", "inventory_sources", "workflow_job_templates")  # approvals are not listed
OWN = {"page_size", "order_by", "type"}


class Awx(ThreadingHTTPServer):
    """`objects` has them by kind, `associated` the ids by `<kind>/<id>/<what>`."""

    def __init__(self) -> None:
        super().__init__(("127.0.0.1", 0), _Handler)
        self.objects: dict[str, list[Object]] = {}
        self.associated: dict[str, list[int]] = {}
        self.surveys: dict[str, Any] = {}
        self.writes: list[str] = []
        self._numbers = 0
        for kind, name in (
            ("credential_types", "Machine"),
            ("credential_types", "Vault"),
            ("credentials", "Ansible Galaxy"),
        ):
            self.add(kind, {"name": name})
        threading.Thread(target=self.serve_forever, daemon=True).start()

    @property
    def url(self) -> str:
        return f"http://127.0.0.1:{self.server_address[1]}"

    def stop(self) -> None:
        self.shutdown()
        self.server_close()

    def add(self, kind: str, obj: Object) -> Object:
        self._numbers += 1
        number, place = self._numbers, f"/api/v2/{kind}/{self._numbers}/"
        project = {"scm_revision": "", "summary_fields": {}}
        made = {
            **project,
            **obj,
            "id": number,
            "url": place,
            "type": kind.rstrip("s"),
            "related": {"survey_spec": f"{place}survey_spec/"},
        }
        self.objects.setdefault(kind, []).append(made)
        return made

    def of(self, kind: str, name: str = "") -> Object:
        """The one of that name, or the only one."""
        (found,) = [one for one in self.objects[kind] if one.get("name", name) == name or not name]
        return found

    def find(self, kind: str, query: dict[str, str]) -> list[Object]:
        kinds = TEMPLATES if kind == "unified_job_templates" else (kind,)
        listed = [one for each in kinds for one in self.objects.get(each, [])]
        return [one for one in listed if all(_is(one, key, value) for key, value in query.items() if key not in OWN)]


def _is(one: Object, key: str, value: str) -> bool:
    return str(one.get(key)) == value


class _Handler(BaseHTTPRequestHandler):
    server: Awx

    def log_message(self, *unused: object) -> None:
        """Quiet."""

    def _asked(self) -> tuple[list[str], dict[str, str], Any]:
        url = urlparse(self.path)
        body = self.rfile.read(int(self.headers.get("Content-Length") or 0))
        return (
            url.path.removeprefix("/api/v2/").strip("/").split("/"),
            dict(parse_qsl(url.query)),
            json.loads(body or b"{}"),
        )

    def do_GET(self) -> None:
        place, query, _body = self._asked()
        if place == ["api"]:
            return self._send(200, {"current_version": "/api/v2/"})
        if len(place) == 1:
            return self._list(self.server.find(place[0], query))
        if len(place) == 2:
            return self._send(200, self._one(place))
        if place[2] == "survey_spec":
            return self._send(200, self.server.surveys.get("/".join(place), {}))
        return self._list([{"id": one} for one in self.server.associated.get("/".join(place), [])])

    def do_POST(self) -> None:
        place, _query, body = self._asked()
        self.server.writes.append(f"POST {self.path}")
        if len(place) == 1:
            return self._send(201, self.server.add(place[0], body))
        if place[2] == "survey_spec":
            self.server.surveys["/".join(place)] = body
            return self._send(200, {})
        if place[2] == "create_approval_template":
            made = self.server.add("workflow_approval_templates", body)
            self._one(place)["related"]["unified_job_template"] = made["url"]
            return self._send(201, made)
        there = self.server.associated.setdefault("/".join(place), [])
        there.remove(body["id"]) if body.get("disassociate") else there.append(body["id"])
        return self._send(204, None)

    def do_PATCH(self) -> None:
        place, _query, body = self._asked()
        self.server.writes.append(f"PATCH {self.path}")
        one = self._one(place)
        one.update(body)
        self._send(200, one)

    def _one(self, place: list[str]) -> Object:
        return next(one for one in self.server.objects[place[0]] if str(one["id"]) == place[1])

    def _list(self, found: list[Object]) -> None:
        self._send(200, {"count": len(found), "next": None, "results": found})

    def _send(self, status: int, body: Any) -> None:
        data = b"" if body is None else json.dumps(body).encode()
        self.send_response(status)
        self.send_header("Content-Length", str(len(data)))
        self.end_headers()
        self.wfile.write(data)
