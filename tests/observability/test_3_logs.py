# SPDX-License-Identifier: GPL-3.0-or-later
"""Log lines come with exactly the labels that were promised, whichever robot they are from."""

from __future__ import annotations

import time

import gaps
import pytest
from runs import wait_until
from watched import ALONE, MEMBER, ROBOTS, STREAM, Watched


@pytest.mark.parametrize("robot", ROBOTS)
def test_streams_have_these_labels_and_no_others(fleet: Watched, robot: str) -> None:
    def look() -> set[str]:
        now = time.time()
        return {one["app"] for one in fleet.loki.streams(f'{{namespace="robot-{robot}"}}', now - 3600, now)}

    apps = wait_until(look, lambda found: "counter" in found, 60, f"lines of {robot}'s apps", pause=2)
    now = time.time()
    streams = fleet.loki.streams(f'{{namespace="robot-{robot}"}}', now - 3600, now)
    names = {pod.metadata.name: pod for pod in fleet.pods(robot, f"robot-{robot}")}
    for labels in streams:
        assert set(labels) == STREAM, labels
        assert labels["robot"] == robot, labels
        pod = names.get(labels["pod"])
        if pod is not None:
            assert labels["app"] == pod.metadata.labels["rosops.fleet/app"], labels
            assert labels["placement"] == ("local" if pod.spec.node_name == robot else "remote"), labels
    fleet.say(f"{robot}: {len(streams)} streams of {', '.join(sorted(apps))}")


def test_pods_of_others_have_them_too(fleet: Watched) -> None:
    now = time.time()
    streams = fleet.loki.streams('{namespace!=""}', now - 3600, now)
    for labels in streams:
        assert set(labels) <= STREAM, labels
        assert set(labels) >= {"namespace", "app", "pod", "placement"}, labels
    of_robot = [one for one in streams if one.get("robot") == ALONE and one["namespace"] != f"robot-{ALONE}"]
    assert all(one["placement"] == "local" for one in of_robot), of_robot
    stack = {one["app"] for one in streams if one["namespace"] == "observability"}
    assert "log-shipper" not in stack, "its own complaints would be new lines to complain about"


@pytest.mark.parametrize("robot", ROBOTS)
def test_what_a_line_carries_beside(fleet: Watched, robot: str) -> None:
    now = time.time()
    [stream, *_more] = fleet.loki.over(f'{{robot="{robot}",app="counter"}}', now - 300, now)
    beside = set(stream["stream"]) - STREAM
    assert {"container", "stream"} <= beside, stream["stream"]
    assert beside <= {"container", "stream", "detected_level"}, stream["stream"]


@pytest.mark.parametrize("robot", ROBOTS)
def test_no_line_is_missing_and_none_comes_twice(fleet: Watched, robot: str) -> None:
    """Of the last minutes, without any fault."""
    now = time.time()
    found = gaps.numbers(fleet.loki.lines(f'{{robot="{robot}",app="counter"}}', now - 300, now - 10))
    assert found, f"no numbered lines of {robot}"
    for run, one in found.items():
        assert (one.missing, one.twice) == (0, 0), f"{robot}, run {run}: {one}"
    total = sum(one.last - one.first + 1 for one in found.values())
    fleet.say(f"{robot}: {total} numbered lines, each there once")
    assert robot != MEMBER or total > 100
