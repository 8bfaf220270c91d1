# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""The exporter's HTTP side: a collector for prometheus_client, and a server that only hands out what is there.

The text is OpenMetrics, which Prometheus, vmagent and the OpenTelemetry collector read. prometheus_client's module for
the older text format needs OpenSSL, a fifth of the exporter's memory.
Runs on Python 3.8 with the standard library and prometheus_client, in pods.
"""

from __future__ import annotations

import gzip
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any, Callable, Iterable, Iterator

from .families import COUNTER, Family

PORT = 11511
PATH, READY, HEALTHY = "/metrics", "/ready", "/healthy"
TOTAL = "_total"


class Collector:
    """Families as prometheus_client's metrics, taken anew at each collection."""

    def __init__(self, families: Callable[[], Iterable[Family]]) -> None:
        self.families = families

    def collect(self) -> Iterator[Any]:
        from prometheus_client.metrics_core import Metric  # noqa: PLC0415 - found in the pod only, through run.py

        for family in self.families():
            name = family.name[: -len(TOTAL)] if family.kind == COUNTER else family.name
            metric = Metric(name, family.help, family.kind)
            for labels, value in family.samples:
                metric.add_sample(family.name, dict(labels), value)
            if metric.samples:  # a family without samples is nothing but lines
                yield metric


def renderer(families: Callable[[], Iterable[Family]]) -> tuple[Callable[[], bytes], str]:
    """What makes the text, and its content type."""
    from prometheus_client.openmetrics.exposition import CONTENT_TYPE_LATEST, generate_latest  # noqa: PLC0415
    from prometheus_client.registry import CollectorRegistry  # noqa: PLC0415

    text_of: Callable[[Any], bytes] = generate_latest
    registry = CollectorRegistry()
    collector: Any = Collector(families)
    registry.register(collector)

    def render() -> bytes:
        made: bytes = text_of(registry)
        return made

    return render, CONTENT_TYPE_LATEST


class Handler(BaseHTTPRequestHandler):
    """One connection; scrapers keep theirs."""

    protocol_version = "HTTP/1.1"
    timeout = 60
    wbufsize = -1  # head and body in one packet
    server: Server

    def do_GET(self) -> None:
        path = self.path.split("?", 1)[0]
        if path == PATH:
            body = self.server.render()
            zipped = "gzip" in self.headers.get("Accept-Encoding", "")
            # over a robot's radio link a tenth of the bytes is worth a millisecond
            self._answer(200, gzip.compress(body, 3) if zipped else body, self.server.content_type, zipped)
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
        self.render, self.content_type = renderer(families)
        self.scraped, self.healthy = scraped, healthy
        super().__init__(address, Handler)

    def handle_error(self, request: Any, client_address: Any) -> None:
        """A client that hung up is not our error."""
