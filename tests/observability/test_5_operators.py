# SPDX-License-Identifier: GPL-3.0-or-later
"""What operators do: a second site.yml changes nothing, an update shows under one id everywhere, the page is made."""

from __future__ import annotations

import json
import time
from pathlib import Path
from typing import Any

import pytest
from runs import wait_until
from watched import MEMBER, ROBOTS, Watched

APP = "add-two-ints"
SOON = 90.0  # the kubelet takes up to a minute for a changed ConfigMap


def test_second_run_changes_nothing(fleet: Watched) -> None:
    before = {host: sorted(pod.metadata.uid for pod in fleet.pods(host)) for host in ROBOTS}
    run = fleet.run("site")
    assert run.status == 0, run
    assert run.changed == 0, run
    assert {host: sorted(pod.metadata.uid for pod in fleet.pods(host)) for host in ROBOTS} == before
    fleet.say(f"second site.yml: changed=0 in {run.ended - run.began:.0f} s")


def test_update_shows_under_one_id(fleet: Watched) -> None:
    version = f"v{int(time.time())}"
    changed: dict[str, Any] = {"scenario_env": {MEMBER: {APP: {"ROSOPS_APPS_VERSION": version}}}}
    run = fleet.run("update", "--limit", f"{MEMBER},edge1", **changed)
    assert (run.status, run.outcomes) == (0, {MEMBER: "updated"}), run
    [event] = [one for one in json.loads(fleet.record(MEMBER))["updates"] if one["app"] == APP]
    assert event["outcome"] == "updated"
    info = f'robot_update_info{{robot="{MEMBER}",app="{APP}",id="{event["id"]}"}}'
    line = f'{{robot="{MEMBER}",app="ros-keeper"}} |= `{event["id"]}` | json'

    def metric() -> list[Any]:
        return [one for one in fleet.prometheus.instant(info) if one["metric"]["outcome"] == "updated"]

    def logged() -> list[Any]:
        found = fleet.loki.over(line, run.began, time.time())
        return [one for one in found if one["stream"].get("outcome") == "updated"]

    for what, look in (("metric", metric), ("log line", logged)):
        left = SOON + run.ended - time.time()
        found = wait_until(look, lambda seen: len(seen) == 1, left, f"{what} of update {event['id']}", pause=1)
        fleet.say(f"{what} of update {event['id']}: {time.time() - run.ended:.0f} s after the playbook's end")
        assert len(found) == 1


def test_status_page(fleet: Watched, tmp_path: Path) -> None:
    page = tmp_path / "fleet.html"
    first = fleet.run("status", status_html=str(page))
    assert first.status == 0, first
    assert set(first.outcomes.values()) == {"unchanged"}, first
    text = page.read_text(encoding="utf-8")
    for word in ("edge1", *ROBOTS, "/temperature", "counter"):
        assert word in text, f"{word} is not on the page"
    second = fleet.run("status", status_html=str(page))
    assert second.status == 0, second
    assert set(second.outcomes.values()) == {"unchanged"}, second
    assert [host["counts"].get("changed", 0) for host in second.report["hosts"] if host["host"] in ROBOTS] == [0, 0]
    fleet.say(f"status.yml: a page of {len(text) / 1000:.0f} kB in {first.ended - first.began:.0f} s")


@pytest.fixture(autouse=True, scope="module")
def as_the_inventory_says(standing_fleet: Watched) -> Any:
    """The update is taken back: later cases begin with the inventory's own versions."""
    yield
    run = standing_fleet.run("update", "--limit", f"{MEMBER},edge1")
    assert run.status == 0, run
