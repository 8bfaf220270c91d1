# SPDX-License-Identifier: GPL-3.0-or-later
"""The scenario's app `counter`: numbered lines on standard output, and their count for Prometheus at port 9400."""

from __future__ import annotations

import http.server
import signal
import sys
import threading
import time
from pathlib import Path

PER_SECOND = 10
count = 0


class Metrics(http.server.BaseHTTPRequestHandler):
    """Answers every request with the count."""

    def do_GET(self) -> None:
        text = f"# TYPE counter_lines_total counter\ncounter_lines_total {count}\n".encode()
        self.send_response(200)
        self.send_header("Content-Type", "text/plain; version=0.0.4")
        self.send_header("Content-Length", str(len(text)))
        self.end_headers()
        self.wfile.write(text)

    def log_message(self, *_arguments: object) -> None:
        """Its own lines are the only ones."""


if __name__ == "__main__":
    signal.signal(signal.SIGTERM, lambda *_signal: sys.exit(0))
    began = time.time()
    server = http.server.ThreadingHTTPServer(("", 9400), Metrics)
    threading.Thread(target=server.serve_forever, daemon=True).start()
    Path("/tmp/ready").touch()  # noqa: S108 - the container's own
    while True:
        count += 1
        print(f"run={began:.6f} number={count}", flush=True)
        time.sleep(max(0.0, began + count / PER_SECOND - time.time()))
