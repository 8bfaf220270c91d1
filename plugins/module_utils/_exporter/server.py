# SPDX-License-Identifier: GPL-3.0-or-later
"""The exporter's HTTP server, which only hands out what is there."""

from __future__ import annotations

import gzip
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any, Callable, Iterable

from .families import CONTENT_TYPE, Family, text

PORT = 11511
PATH, READY, HEALTHY = "/metrics", "/ready", "/healthy"


class Handler(BaseHTTPRequestHandler):
    """One connection; scrapers keep theirs."""

    protocol_version = "HTTP/1.1"
    timeout = 60
    wbufsize = -1  # head and body in one packet
    server: Server

    def do_GET(self) -> None:
        path = self.path.split("?", 1)[0]
        if path == PATH:
            body = text(self.server.families())
            zipped = "gzip" in self.headers.get("Accept-Encoding", "")
            # over a robot's radio link a tenth of the bytes is worth a millisecond
            self._answer(200, gzip.compress(body, 3) if zipped else body, CONTENT_TYPE, zipped)
            self.server.scraped()
        elif path == READY or (path == HEALTHY and self.server.healthy()):
            self._answer(200, b"ok\n")
        else:
            self._answer(503 if path == HEALTHY else 404, b"not so\n")

    def _answer(self, code: int, body: bytes, kind: str = "text/plain", zipped: bool = False) -> None:
        self.send_response(code)
        self.send_header("Content-Type", kind)
        self.send_header("Content-Length", str(len(body)))
        if zipped:
            self.send_header("Content-Encoding", "gzip")
        self.end_headers()
        self.wfile.write(body)

    def log_message(self, format: str, *args: Any) -> None:
        """Scrapes and probes are not worth a line."""


class Server(ThreadingHTTPServer):
    """Serves `families`; `scraped` is told of each scrape after its answer."""

    daemon_threads = True
    request_queue_size = 32

    def __init__(
        self,
        address: tuple[str, int],
        families: Callable[[], Iterable[Family]],
        scraped: Callable[[], None],
        healthy: Callable[[], bool],
    ) -> None:
        self.families, self.scraped, self.healthy = families, scraped, healthy
        super().__init__(address, Handler)

    def handle_error(self, request: Any, client_address: Any) -> None:
        """A client that hung up is not our error."""
