# SPDX-License-Identifier: GPL-3.0-or-later
"""The exporter's pages."""

from __future__ import annotations

import gzip
import time
from typing import Any

import pytest
from ansible_collections.rosops.fleet.plugins.module_utils._exporter import families
from ansible_collections.rosops.fleet.plugins.module_utils._exporter.exporter import OPTIONS, PATH, Exporter
from ansible_collections.rosops.fleet.plugins.module_utils._exporter.snapshot import History, Snapshot
from ansible_collections.rosops.fleet.plugins.module_utils._ros.raw_node import Asked


@pytest.fixture
def made() -> Exporter:
    """One of which no thread runs."""
    found = Exporter("http://127.0.0.1:9/", {**OPTIONS, "--updates": "/nonexistent"}, print)
    found.poller.snapshot = Snapshot({"ros_master_up": {(): 1}, "ros_node_up": {"/n": 1}}, History(polls=3), 0.1, 5.0)
    found.poller.ended = time.monotonic()
    return found


def test_a_scrape(made: Exporter) -> None:
    plain = made.metrics(Asked("GET", PATH))
    assert (plain.status, plain.kind) == (200, "application/openmetrics-text; version=1.0.0; charset=utf-8")
    assert plain.body == families.text(made.families())
    assert b'ros_node_up{node="/n"} 1.0\n' in plain.body
    zipped = made.metrics(Asked("GET", PATH, headers={"Accept-Encoding": "deflate, gzip"}))
    assert (gzip.decompress(zipped.body), zipped.headers) == (plain.body, {"Content-Encoding": "gzip"})


def test_claims_are_shown_where_they_are_looked_at(tmp_path: Any) -> None:
    chosen = {**OPTIONS, "--claims": str(tmp_path), "--namespace": "robot-a", "--capacities": '{"logs-pvc": 1024}'}
    (tmp_path / "pvc-1_robot-a_logs-pvc").mkdir()
    made = Exporter("http://127.0.0.1:9/", chosen, print)
    assert made.claims is not None
    made.claims.once()
    body = made.metrics(Asked("GET", PATH)).body
    assert b'rosops_claim_capacity_bytes{claim="logs-pvc"} 1024.0\n' in body
    assert b'rosops_claim_used_bytes{claim="logs-pvc"}' in body
