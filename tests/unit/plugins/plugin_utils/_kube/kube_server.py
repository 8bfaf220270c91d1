# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""A small API server in this process: lists, watches in chunks, and every misbehaviour that a test asks for.

Tests drive it by its methods and wait on what it and the client tell each other, never on the clock.
"""

from __future__ import annotations

import json
import queue
import threading
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any, Callable
from urllib.parse import parse_qs, urlparse

END, CUT, GONE = "end", "cut", "gone"  # how a watch stream ends, instead of an event


class Server(ThreadingHTTPServer):
    """One path, one list; `events` feeds whichever watch of that path is open."""

    daemon_threads = True

    def __init__(self) -> None:
        super().__init__(("127.0.0.1", 0), _Handler)
        self.lists: dict[str, list[Any]] = {}
        self.version = 100
        self.refusals: list[tuple[int, str]] = []  # answers for the next requests, first come first served
        self.refuse: Callable[[str], int] = lambda _path: 0
        self.requests: queue.Queue[tuple[str, dict[str, str], dict[str, str]]] = queue.Queue()
        self._events: dict[str, queue.Queue[Any]] = {}
        self._lock = threading.Lock()
        threading.Thread(target=self.serve_forever, kwargs={"poll_interval": 0.01}, daemon=True).start()

    @property
    def url(self) -> str:
        return f"http://127.0.0.1:{self.server_address[1]}"

    def events(self, path: str) -> queue.Queue[Any]:
        with self._lock:
            return self._events.setdefault(path, queue.Queue())

    def send(self, path: str, what: str, obj: Any = None) -> None:
        """An event on the watch of that path, or how that watch ends."""
        if what in (END, CUT, GONE):
            self.events(path).put(what)
            return
        self.version += 1
        made = {**obj, "metadata": {**obj["metadata"], "resourceVersion": str(self.version)}}
        self.events(path).put({"type": what, "object": made})

    def seen(self) -> tuple[str, dict[str, str], dict[str, str]]:
        """The next request: path, query, headers."""
        return self.requests.get(timeout=10)

    def next_watch(self) -> tuple[str, dict[str, str]]:
        while True:
            path, query, _headers = self.seen()
            if "watch" in query:
                return path, query

    def stop(self) -> None:
        for events in self._events.values():
            events.put(END)
        self.shutdown()
        self.server_close()

    def handle_error(self, *unused: object) -> None:
        """A client that hangs up is what the tests are about."""


class _Handler(BaseHTTPRequestHandler):
    protocol_version = "HTTP/1.1"
    server: Server

    def log_message(self, *unused: object) -> None:
        """Quiet."""

    def do_GET(self) -> None:
        url = urlparse(self.path)
        query = {key: values[0] for key, values in parse_qs(url.query).items()}
        self.server.requests.put((url.path, query, {key.lower(): value for key, value in self.headers.items()}))
        if self.server.refusals:
            self._answer(*self.server.refusals.pop(0))
        elif self.server.refuse(url.path):
            self._answer(self.server.refuse(url.path), f"no {url.path} for you")
        elif "watch" in query:
            self._watch(url.path)
        else:
            items = self.server.lists.get(url.path, [])
            self._send(200, {"metadata": {"resourceVersion": str(self.server.version)}, "items": items})

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
            if event == GONE:
                event = {"type": "ERROR", "object": {"kind": "Status", "code": 410, "message": "too old"}}
            line = json.dumps(event).encode() + b"\n"
            for part in (line[:7], line[7:]):  # a line may come in pieces
                self.wfile.write(f"{len(part):x}\r\n".encode() + part + b"\r\n")
            self.wfile.flush()
