# SPDX-License-Identifier: GPL-3.0-or-later
"""The exporter's HTTP server."""

from __future__ import annotations

import gzip
import threading
import urllib.error
import urllib.request
from collections.abc import Iterator
from typing import Any

import pytest
from ansible_collections.rosops.fleet.plugins.module_utils._exporter.families import COUNTER, GAUGE, Family, text
from ansible_collections.rosops.fleet.plugins.module_utils._exporter.server import Server

FAMILIES = [
    Family("ros_master_up", GAUGE, "Whether it answers", [({}, 1.0)]),
    Family("ros_topic_messages_total", COUNTER, "Messages", [({"topic": '/a"\\\n', "node": "/n"}, 5.0)]),
    Family("ros_node_up", GAUGE, "None of them", []),
]


class Served:
    def __init__(self) -> None:
        self.scrapes, self.health = 0, True
        self.server = Server(("127.0.0.1", 0), lambda: FAMILIES, self.scraped, lambda: self.health)
        threading.Thread(target=self.server.serve_forever, kwargs={"poll_interval": 0.01}, daemon=True).start()

    def scraped(self) -> None:
        self.scrapes += 1

    def get(self, path: str, **headers: str) -> Any:
        url = f"http://127.0.0.1:{self.server.server_address[1]}{path}"
        return urllib.request.urlopen(urllib.request.Request(url, headers=headers), timeout=5)  # noqa: S310

    def code(self, path: str) -> int:
        try:
            with self.get(path) as reply:
                return int(reply.status)
        except urllib.error.HTTPError as error:
            return error.code


@pytest.fixture
def served() -> Iterator[Served]:
    made = Served()
    yield made
    made.server.shutdown()
    made.server.server_close()


def test_a_scrape(served: Served) -> None:
    with served.get("/metrics") as reply:
        kind, plain = reply.headers["Content-Type"], reply.read()
    assert kind == "application/openmetrics-text; version=1.0.0; charset=utf-8"
    assert (plain, served.scrapes) == (text(FAMILIES), 1)
    with served.get("/metrics", **{"Accept-Encoding": "gzip"}) as reply:
        assert reply.headers["Content-Encoding"] == "gzip"
        assert gzip.decompress(reply.read()) == plain


def test_probes(served: Served) -> None:
    assert [served.code(path) for path in ("/ready", "/healthy", "/nothing")] == [200, 200, 404]
    served.health = False
    assert [served.code(path) for path in ("/ready", "/healthy")] == [200, 503]
    assert served.scrapes == 0
