# SPDX-License-Identifier: GPL-3.0-or-later
"""What a scrape shows, and the look that follows it."""

from __future__ import annotations

import gzip
import time
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from ansible_collections.rosops.fleet.plugins.module_utils._exporter import exporter, families
from ansible_collections.rosops.fleet.plugins.module_utils._exporter.claims import PERIOD
from ansible_collections.rosops.fleet.plugins.module_utils._exporter.exporter import OPTIONS, PATH, Exporter
from ansible_collections.rosops.fleet.plugins.module_utils._exporter.snapshot import History, Numbers, Snapshot
from ansible_collections.rosops.fleet.plugins.module_utils._ros.raw_node import Asked
from ansible_collections.rosops.fleet.tests.unit.plugins.fake_ros import until


def away(tell: Callable[[str], None] = print, **options: str) -> Exporter:
    """One whose master is away, and of which no thread runs."""
    usual = {**OPTIONS, "--timeout": "0.5", "--updates": "/nonexistent"}
    return Exporter("http://127.0.0.1:9/", {**usual, **{f"--{name}": said for name, said in options.items()}}, tell)


def test_a_scrape() -> None:
    made = away()
    made.snapshot = Snapshot({"ros_master_up": {(): 1}, "ros_node_up": {"/n": 1}}, History(polls=3), 0.1, 5.0)
    made.ended = time.monotonic()
    plain = made.metrics(Asked("GET", PATH))
    assert (plain.status, plain.kind) == (200, "application/openmetrics-text; version=1.0.0; charset=utf-8")
    assert plain.body == families.text(made.families())
    assert b'ros_node_up{node="/n"} 1.0\n' in plain.body
    zipped = made.metrics(Asked("GET", PATH, headers={"Accept-Encoding": "deflate, gzip"}))
    assert (gzip.decompress(zipped.body), zipped.headers) == (plain.body, {"Content-Encoding": "gzip"})


def test_claims_are_shown_with_the_size_that_is_known_and_looked_at_once_a_minute(tmp_path: Path) -> None:
    for name in ("logs", "maps"):
        (tmp_path / f"pvc-1_robot-a_{name}-pvc").mkdir()
    made = away(claims=str(tmp_path), namespace="robot-a", capacities='{"logs-pvc": 1024, "gone-pvc": 7}')
    assert made.claims is not None
    assert made.claims.once() >= PERIOD
    body = made.metrics(Asked("GET", PATH)).body.decode()
    assert [line.partition(" ")[0] for line in body.splitlines() if line.startswith("rosops_claim")] == [
        f'rosops_claim_{what}_bytes{{claim="{claim}-pvc"}}'
        for what, claim in (("capacity", "logs"), ("used", "logs"), ("used", "maps"))
    ]
    assert 'rosops_claim_capacity_bytes{claim="logs-pvc"} 1024.0\n' in body


# --- again and again -------------------------------------------------------------------------------------------------


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> list[float]:
    """The exporter's, which stands still."""
    at = [1000.0]
    monkeypatch.setattr(exporter, "time", SimpleNamespace(monotonic=lambda: at[0], time=time.time))
    return at


AWAY: Numbers = {"ros_master_up": {(): 0}}


def looked(made: Exporter) -> Numbers:
    """What a scrape shows; the look that follows it has ended."""
    shown = made.scraped()
    until(lambda: not made.due.is_set())
    return shown.ros


def test_a_look_follows_each_scrape_and_is_shown_by_the_next_one(clock: list[float]) -> None:
    made = away()
    made.start()
    assert (made.snapshot.history.polls, looked(made)) == (0, {})
    for number in range(1, 4):
        clock[0] += made.interval
        assert (looked(made), made.snapshot.history.polls) == (AWAY, number + 1)
    clock[0] += made.interval / 2 - 0.1  # another one who scrapes
    assert (looked(made), made.snapshot.history.polls) == (AWAY, 4)
    clock[0] += 0.1
    assert (looked(made), made.snapshot.history.polls) == (AWAY, 5)
    clock[0] += exporter.FRESH  # what was seen then may not be so any more
    assert looked(made) == {}
    clock[0] += made.interval
    assert looked(made) == AWAY


def test_a_mistake_of_ours_is_told_once_and_the_next_look_goes_on(
    clock: list[float], monkeypatch: pytest.MonkeyPatch
) -> None:
    said: list[str] = []
    made = away(said.append)
    made.start()
    with monkeypatch.context() as broken:
        broken.setattr(made, "_look", lambda: dict[str, Any]()["missing"])
        for _scrape in range(3):
            clock[0] += made.interval
            looked(made)
    clock[0] += made.interval
    looked(made)
    assert (made.snapshot.history.polls, said) == (1, ["no metrics of the graph: KeyError: 'missing'"])
