# SPDX-License-Identifier: GPL-3.0-or-later
"""A small API server in this process: lists, writes, watches in chunks, and every misbehaviour that a test asks for.

Tests drive it by its methods and wait on what it and the client tell each other, never on the clock.
"""

from __future__ import annotations

import json
import queue
import re
import threading
import time
from base64 import urlsafe_b64encode
from collections.abc import Callable
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any
from urllib.parse import parse_qs, urlparse

from ansible_collections.rosops.fleet.plugins.plugin_utils._kube.cache import PLACES

PLURALS = {plural for _base, plural in PLACES.values()}
END, CUT = "end", "cut"  # how a watch stream ends, instead of an event
SERVICE_ADDRESS = "127.0.0.200"  # nothing listens there, which is known at once; which a Service gets that names none


class Clock:
    """Time passes only while somebody sleeps."""

    def __init__(self) -> None:
        self.time = 0.0

    def now(self) -> float:
        return self.time

    def sleep(self, seconds: float) -> None:
        self.time += seconds


class Server(ThreadingHTTPServer):
    """One path, one list; `events` feeds whichever watch of that path is open."""

    daemon_threads = True

    def __init__(self, port: int = 0) -> None:
        super().__init__(("127.0.0.1", port), _Handler)
        self.lists: dict[str, list[Any]] = {}
        self.writes: list[str] = []  # method and path of every request that was no GET
        self.deletions: list[Any] = []  # the options of each
        self.owned: dict[tuple[str, str], Any] = {}  # by path and manager, what was last applied
        self.version = 100
        self.refusals: list[tuple[int, str]] = []  # answers for the next requests, first come first served
        self.write_refusals: list[tuple[int, str]] = []  # the same for what is no GET
        self.refuse: Callable[[str], int] = lambda _path: 0
        self.requests: queue.Queue[tuple[str, dict[str, str], dict[str, str]]] = queue.Queue()
        self._events: dict[str, queue.Queue[Any]] = {}
        self._lock = threading.Lock()
        self.writing = threading.Lock()
        threading.Thread(target=self.serve_forever, kwargs={"poll_interval": 0.01}, daemon=True).start()

    @property
    def url(self) -> str:
        return f"http://127.0.0.1:{self.server_address[1]}"

    def events(self, path: str) -> queue.Queue[Any]:
        with self._lock:
            return self._events.setdefault(path, queue.Queue())

    def send(self, path: str, what: str, obj: Any) -> None:
        """An event on the watch of that path."""
        self.version += 1
        made = {**obj, "metadata": {**obj["metadata"], "resourceVersion": str(self.version)}}
        self.events(path).put({"type": what, "object": made})

    def seen(self) -> tuple[str, dict[str, str], dict[str, str]]:
        """The next request: path, query, headers."""
        return self.requests.get(timeout=60)

    def next_watch(self) -> tuple[str, dict[str, str]]:
        while True:
            path, query, _headers = self.seen()
            if "watch" in query:
                return path, query

    def find(self, path: str) -> Any:
        """The object at that path, None if it is not there."""
        listed, _slash, name = path.rpartition("/")
        return next((item for item in self.lists.get(listed, []) if item["metadata"]["name"] == name), None)

    def put(self, path: str, obj: Any) -> Any:
        """Keep an object; what is the same as before keeps its version."""
        listed, _slash, name = path.rpartition("/")
        before = self.find(path)
        if before is not None and _bare(before) == _bare(obj):
            return before
        self.version += 1
        made = {**obj, "metadata": {**obj.get("metadata", {}), "name": name, "resourceVersion": str(self.version)}}
        self.drop(path)
        self.lists.setdefault(listed, []).append(made)
        return made

    def drop(self, path: str) -> None:
        listed, _slash, name = path.rpartition("/")
        self.lists[listed] = [item for item in self.lists.get(listed, []) if item["metadata"]["name"] != name]

    def write(self, method: str, path: str, query: dict[str, str], body: Any, content: str) -> tuple[int, Any]:  # noqa: PLR0911 - one return per answer
        """Status and body of a write, the way the API server answers."""
        space = re.search(r"/namespaces/([^/]+)/", path)
        if space and not self.find(f"/api/v1/namespaces/{space[1]}"):
            return 404, f'namespaces "{space[1]}" not found'
        full = f"{path}/{body['metadata']['name']}" if method == "POST" else path
        before = self.find(full)
        if method == "POST" and before:
            return 409, "already exists"
        if method != "POST" and before is None and "apply-patch" not in content:
            return 404, "not found"
        if method == "DELETE":
            self.deletions.append(body)
            if before["metadata"].get("uid") != body.get("preconditions", before["metadata"]).get("uid"):
                return 409, "the UID in the precondition does not match"
            if "dryRun" not in (body or query):  # where there are options in a body, the query has none
                self.drop(full)
            return 200, {"kind": "Status"}
        version = (body.get("metadata") or {}).get("resourceVersion")
        if before and version and version != before["metadata"]["resourceVersion"]:
            return 409, "the object has been modified"
        made = body
        if "apply-patch" in content:
            old = self.owned.get((full, query["fieldManager"]), {})
            made = _merged(_without(before or {}, old, body), body)
        elif method == "PATCH":
            made = _merged(before or {}, body)
        if "/services/" in full:
            made = {**made, "spec": {"clusterIP": SERVICE_ADDRESS, **made.get("spec", {})}}
        if "dryRun" in query:
            return 200, made
        if "apply-patch" in content:
            self.owned[(full, query["fieldManager"])] = body
        return 200, self.put(full, made)

    def token(self, path: str, seconds: int) -> str:
        """Of the account at that path; what it says of itself, unsigned."""
        uid = self.find(path.rpartition("/")[0])["metadata"].get("uid")
        begun = int(time.time())
        said = {"iat": begun, "exp": begun + seconds, "kubernetes.io": {"serviceaccount": {"uid": uid}}}
        return f"e30.{urlsafe_b64encode(json.dumps(said).encode()).decode().rstrip('=')}.sig{self.version}"

    def stop(self) -> None:
        for events in self._events.values():
            events.put(END)
        self.shutdown()
        self.server_close()

    def handle_error(self, *unused: object) -> None:
        """A client that hangs up is what the tests are about."""


class _Handler(BaseHTTPRequestHandler):
    protocol_version = "HTTP/1.1"
    disable_nagle_algorithm = True  # head and body are two packets: the second one would wait 40 ms for an answer
    server: Server

    def log_message(self, *unused: object) -> None:
        """Quiet."""

    def _asked(self) -> tuple[str, dict[str, str]]:
        url = urlparse(self.path)
        return url.path, {key: values[0] for key, values in parse_qs(url.query).items()}

    def do_GET(self) -> None:
        path, query = self._asked()
        self.server.requests.put((path, query, {key.lower(): value for key, value in self.headers.items()}))
        if self.server.refusals:
            self._answer(*self.server.refusals.pop(0))
        elif status := self.server.refuse(path):
            self._answer(status, f"no {path} for you")
        elif "watch" in query:
            self._watch(path)
        elif path in self.server.lists or path.rpartition("/")[2] in PLURALS:
            items = self.server.lists.get(path, [])
            self._send(200, {"metadata": {"resourceVersion": str(self.server.version)}, "items": items})
        elif found := self.server.find(path):
            self._send(200, found)
        else:
            self._answer(404, "not found")

    def _write(self) -> None:
        path, query = self._asked()
        body = json.loads(self.rfile.read(int(self.headers.get("Content-Length") or 0)) or b"{}")
        self.server.writes.append(f"{self.command} {path}")
        if self.server.write_refusals:
            self._answer(*self.server.write_refusals.pop(0))
        elif path.endswith("/token"):
            self._send(201, {"status": {"token": self.server.token(path, body["spec"]["expirationSeconds"])}})
        else:
            content = self.headers.get("Content-Type") or ""
            with self.server.writing:
                status, answer = self.server.write(self.command, path, query, body, content)
            (self._send if status == 200 else self._answer)(status, answer)

    do_PATCH = do_POST = do_PUT = do_DELETE = _write  # noqa: N815 - the library's names

    def _answer(self, status: int, message: str) -> None:
        self._send(status, {"kind": "Status", "status": "Failure", "message": message, "code": status})

    def _send(self, status: int, body: Any) -> None:
        data = json.dumps(body).encode()
        self.send_response(status)
        self.send_header("Content-Type", "application/json")
        self.send_header("Content-Length", str(len(data)))
        self.end_headers()
        self.wfile.write(data)

    def _watch(self, path: str) -> None:
        self.send_response(200)
        self.send_header("Transfer-Encoding", "chunked")
        self.end_headers()
        while True:
            event = self.server.events(path).get()
            if event == CUT:  # in the middle of a line, and of a chunk
                self.wfile.write(b'40\r\n{"type": "MODI')
                self.wfile.flush()
                self.close_connection = True
                return
            if event == END:
                self.wfile.write(b"0\r\n\r\n")
                return
            line = json.dumps(event).encode() + b"\n"
            for part in (line[:7], line[7:]):  # a line may come in pieces
                self.wfile.write(f"{len(part):x}\r\n".encode() + part + b"\r\n")
            self.wfile.flush()
            if event.get("type", "ERROR") == "ERROR":
                return


def _bare(obj: Any) -> Any:
    return {**obj, "metadata": {key: value for key, value in obj["metadata"].items() if key != "resourceVersion"}}


def _merged(old: Any, new: Any) -> Any:
    """A merge patch."""
    if not isinstance(old, dict) or not isinstance(new, dict):
        return new
    found = {**old, **{key: _merged(old.get(key, {}), value) for key, value in new.items()}}
    return {key: value for key, value in found.items() if value is not None}


def _without(obj: Any, old: Any, new: Any) -> Any:
    """The object without what was applied before and is not any more."""
    if not isinstance(obj, dict) or not isinstance(old, dict):
        return obj
    rest = new if isinstance(new, dict) else {}
    return {
        key: _without(value, old.get(key), rest.get(key)) for key, value in obj.items() if key not in old or key in rest
    }
