# SPDX-License-Identifier: GPL-3.0-or-later
"""Requests, failures and response times of an application, as Prometheus reads them: text over HTTP. No ROS."""

from __future__ import annotations

import threading
from bisect import bisect_left
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

# Seconds. From a message that crosses a robot to a goal that waits for its server's update.
BUCKETS = (0.001, 0.0025, 0.005, 0.01, 0.025, 0.05, 0.1, 0.25, 0.5, 1.0, 2.5, 5.0, 10.0)
CONTENT_TYPE = "text/plain; version=0.0.4; charset=utf-8"
PATH = "/metrics"


class Metrics:
    """The counts of one topic, service or action. Callbacks and the server run in threads of their own."""

    def __init__(self, pattern: str, name: str) -> None:
        self._labels = f'pattern="{pattern}",name="{name}"'
        self._lock = threading.Lock()
        self._requests = 0
        self._failures = 0
        self._counts = [0] * (len(BUCKETS) + 1)
        self._seconds = 0.0

    def answered(self, seconds: float) -> None:
        """A request that was answered after so many seconds."""
        with self._lock:
            self._requests += 1
            self._counts[bisect_left(BUCKETS, seconds)] += 1
            self._seconds += seconds

    def failed(self) -> None:
        """A request that was not answered as it should be."""
        with self._lock:
            self._requests += 1
            self._failures += 1

    def failed_so_far(self, total: int) -> None:
        """The same by an account of the application's own. A total that has become less changes nothing."""
        with self._lock:
            more = max(0, total - self._failures)
            self._requests += more
            self._failures += more

    def text(self) -> str:
        with self._lock:
            requests, failures, counts, seconds = self._requests, self._failures, list(self._counts), self._seconds
        lines = [
            "# HELP rosops_app_requests_total Messages, service requests or goals, failed ones too.",
            "# TYPE rosops_app_requests_total counter",
            f"rosops_app_requests_total{{{self._labels}}} {requests}",
            "# HELP rosops_app_failures_total Those of them that were lost, failed or aborted.",
            "# TYPE rosops_app_failures_total counter",
            f"rosops_app_failures_total{{{self._labels}}} {failures}",
            "# HELP rosops_app_response_seconds Age of a message when it arrives, time to an answer, time to a result.",
            "# TYPE rosops_app_response_seconds histogram",
        ]
        total = 0
        for bound, count in zip([*map(str, BUCKETS), "+Inf"], counts):
            total += count
            lines.append(f'rosops_app_response_seconds_bucket{{{self._labels},le="{bound}"}} {total}')
        lines.append(f"rosops_app_response_seconds_sum{{{self._labels}}} {seconds}")
        lines.append(f"rosops_app_response_seconds_count{{{self._labels}}} {total}")
        return "\n".join([*lines, ""])

    def serve(self, port: int) -> None:
        """Answer at this port for as long as the process lives."""
        made = self

        class Handler(BaseHTTPRequestHandler):
            def do_GET(self) -> None:
                if self.path != PATH:
                    self.send_error(404)
                    return
                body = made.text().encode()
                self.send_response(200)
                self.send_header("Content-Type", CONTENT_TYPE)
                self.send_header("Content-Length", str(len(body)))
                self.end_headers()
                self.wfile.write(body)

            def log_message(self, *_arguments: object) -> None:
                """A scrape is no event of the application."""

        server = ThreadingHTTPServer(("", port), Handler)
        threading.Thread(target=server.serve_forever, daemon=True).start()
