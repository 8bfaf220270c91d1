# SPDX-License-Identifier: GPL-3.0-or-later
"""As much of AWX's REST API as the modules of awx.awx ask for: objects by kind, and what they are associated with.

Nothing that is there is changed (PATCH): a run that tries it fails.
What AWX 24.6.1 refuses is refused here in its words: `refusal`.
"""

from __future__ import annotations

import json
import re
import threading
from collections.abc import Sequence
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any
from urllib.parse import parse_qsl, urlparse

from ansible_collections.rosops.fleet.plugins.plugin_utils._repository.contents import PLAYBOOKS

Object = dict[str, Any]
TEMPLATES = ("job_templates", "projects", "inventory_sources", "workflow_job_templates")  # approvals are not listed
OWN = {"page_size", "order_by", "type"}
ROLES = {
    "job_templates": ("admin", "execute", "read"),
    "workflow_job_templates": ("admin", "execute", "read", "approval"),
    "inventories": ("admin", "update", "adhoc", "use", "read"),
    "projects": ("admin", "use", "update", "read"),
}
APPROVAL = ("name", "description", "timeout")  # all that AWX keeps of an approval


class Awx(ThreadingHTTPServer):
    """`objects` has them by kind, `associated` the ids by `<kind>/<id>/<what>`."""

    def __init__(self) -> None:
        super().__init__(("127.0.0.1", 0), _Handler)
        self.objects: dict[str, list[Object]] = {}
        self.associated: dict[str, list[int]] = {}
        self.surveys: dict[str, Any] = {}
        self.writes: list[str] = []
        self.syncs = True  # whether a project's sync ends well
        self._numbers = 0
        for name in ("Machine", "Vault"):
            self.add("credential_types", {"name": name})
        self.add("credentials", {"name": "Ansible Galaxy"})
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
        roles = {f"{role}_role": {"id": f"{number}-{role}"} for role in ROLES.get(kind, ())}
        project = {"scm_revision": "", "summary_fields": {"object_roles": roles}}
        related = {name: f"{place}{name}/" for name in ("survey_spec", "update")}
        made = {**project, **obj, "id": number, "url": place, "type": kind.rstrip("s"), "related": related}
        self.objects.setdefault(kind, []).append(made)
        return made

    def of(self, kind: str, name: str = "") -> Object:
        """The one of that name, or the only one."""
        (found,) = [one for one in self.objects[kind] if one.get("name", name) == name or not name]
        return found

    def sync(self, project: Object) -> Object:
        """A project's job, which has ended."""
        if self.syncs:
            project["files"], project["scm_revision"] = PLAYBOOKS, "the only one"
        ended = {"failed": not self.syncs, "status": "successful" if self.syncs else "failed", "finished": "now"}
        return self.add("project_updates", {**ended, "scm_revision": project["scm_revision"]})

    def refusal(self, kind: str, one: Object) -> Object:
        """What AWX answers with 400; nothing for what it takes."""
        if kind == "job_templates":
            (project,) = [other for other in self.objects["projects"] if other["id"] == one["project"]]
            unknown = one["playbook"] not in project.get("files", ())
            return {"playbook": ["Playbook not found for project."]} if unknown else {}
        if kind == "schedules":
            wrong = _wrong_rule(one["rrule"])
            missing = self._unanswered(one["unified_job_template"], one.get("extra_data") or {})
            told = {"rrule": [wrong] if wrong else [], "variables_needed_to_start": missing}
            return {key: value for key, value in told.items() if value}
        return {}

    def _unanswered(self, template: int, answers: Object) -> list[str]:
        """A question with a default needs an answer, too."""
        survey = self.surveys.get(f"job_templates/{template}/survey_spec", {}).get("spec", [])
        required = [one["variable"] for one in survey if one["required"]]
        return [f"'{name}' value missing" for name in required if name not in answers]

    def find(self, kind: str, query: dict[str, str]) -> list[Object]:
        kinds = TEMPLATES if kind == "unified_job_templates" else (kind,)
        listed = [one for each in kinds for one in self.objects.get(each, [])]
        wanted = {tuple(key.split("__")): value for key, value in query.items() if key not in OWN}
        return [one for one in listed if all(self._is(one, key, value) for key, value in wanted.items())]

    def _is(self, one: Object, names: Sequence[str], value: str) -> bool:
        """`a__b` is the field b of what a is the number of."""
        first, *rest = names
        if not rest:
            return str(one.get(first)) == value
        others = [other for kind in self.objects.values() for other in kind if other["id"] == one[first]]
        return any(self._is(other, rest, value) for other in others)


def _wrong_rule(rule: str) -> str:
    if re.search(r"DTSTART:[0-9]+T[0-9]+ ", rule):
        return "DTSTART cannot be a naive datetime.  Specify ;TZINFO= or YYYYMMDDTHHMMSSZZ."
    without = [one for one in re.findall(r"RULE:\S*", rule) if "INTERVAL" not in one]
    return f"INTERVAL required in rrule: {without[0]}" if without else ""


def wrong_survey(survey: Object) -> str:
    """What AWX says of a survey that it does not take."""
    for name, kind, what in (("name", str, "string"), ("description", str, "string"), ("spec", list, "list of items")):
        if name not in survey:
            return f"Field '{name}' is missing from survey spec."
        if not isinstance(survey[name], kind):
            return f"Expected {what} for field '{name}', received {type(survey[name]).__name__} type."
    if not survey["spec"]:
        return "'spec' doesn't contain any items."
    for number, question in enumerate(survey["spec"]):
        missing = [name for name in ("type", "question_name", "variable", "required") if name not in question]
        if missing:
            return f"'{missing[0]}' missing from survey question {number}"
        if question["type"] == "multiplechoice" and question["default"] not in question["choices"]:
            return "Default choice must be answered from the choices listed."
    return ""


class _Handler(BaseHTTPRequestHandler):
    server: Awx

    def log_message(self, *unused: object) -> None:
        """Quiet."""

    def _asked(self) -> tuple[list[str], dict[str, str], Any]:
        url = urlparse(self.path)
        body = self.rfile.read(int(self.headers.get("Content-Length") or 0))
        place = url.path.removeprefix("/api/v2/").strip("/").split("/")
        return place, dict(parse_qsl(url.query)), json.loads(body or b"{}")

    def do_GET(self) -> None:
        place, query, _body = self._asked()
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
            wrong = self.server.refusal(place[0], body)
            return self._send(400, wrong) if wrong else self._send(201, self.server.add(place[0], body))
        if place[2] == "survey_spec":
            if wrong_survey(body):
                return self._send(400, {"error": wrong_survey(body)})
            self.server.surveys["/".join(place)] = body
            return self._send(200, {})
        if place[2] == "update":
            return self._send(202, self.server.sync(self._one(place)))
        if place[2] == "create_approval_template":
            kept = {name: body[name] for name in APPROVAL if name in body}
            made = self.server.add("workflow_approval_templates", {**kept, "unified_job_type": "workflow_approval"})
            node = self._one(place)
            node["related"]["unified_job_template"] = made["url"]
            node["summary_fields"] = {"unified_job_template": made}
            return self._send(201, made)
        there = self.server.associated.setdefault("/".join(place), [])
        there.remove(body["id"]) if body.get("disassociate") else there.append(body["id"])
        return self._send(204, None)

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
