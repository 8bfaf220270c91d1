# SPDX-License-Identifier: GPL-3.0-or-later
"""A robot without its link, whose shipper and store are killed meanwhile: what is there afterwards.

Stated: every line; every sample but those that only vmagent's memory had when it was killed. These are the block that
was on its way when the link went, so of each series at most the one sample of that moment; and what was due in the last
seconds before the kill (FLUSH) or while it was restarted (RESTART). ROSOPS_OUTAGE_MINUTES: how long the link is away.
"""

from __future__ import annotations

import os
import time

import gaps
import pytest
from runs import wait_until
from watched import ALONE, INTERVAL, NAMESPACE, Watched

FLUSH = 10.0
RESTART = 20.0  # the kubelet's first pause, and the program's start
CAUGHT_UP = 240.0
SERIES = ("up", "counter_lines_total", "ros_exporter_polls_total", "node_boot_time_seconds", "ros_master_up")


def minutes(request: pytest.FixtureRequest) -> float:
    return float(
        os.environ.get("ROSOPS_OUTAGE_MINUTES", "10" if request.config.getoption("--cases") == "faults" else "1")
    )


def kill_in(fleet: Watched, seconds: float) -> None:
    """Have the host itself kill the two, by their processes: nobody reaches it then."""
    pods = [fleet.pods(ALONE, NAMESPACE, app)[0] for app in ("vmagent", "log-shipper")]
    processes = [number for pod in pods for number in fleet.hosts.processes(ALONE, pod.metadata.uid)]
    assert len(processes) == 2, processes
    fleet.hosts.ssh(ALONE, f"systemd-run --on-active={seconds:.0f} /bin/kill -9 {' '.join(map(str, processes))}")


def restarts(fleet: Watched, app: str) -> int:
    [pod] = fleet.pods(ALONE, NAMESPACE, app)
    return int(pod.status.container_statuses[0].restart_count)


def lines_behind(fleet: Watched, since: float, until: float) -> float:
    """Seconds; by the number of the last line and the app's own count of now."""
    found = fleet.counted(ALONE, since)
    if not found:
        return 1e9
    run = max(found)
    return max(0.0, until - (float(run) + found[run].last / 10))


def on_its_way(hole: gaps.Hole, cut: float) -> bool:
    """One sample that was taken just as the link went."""
    return gaps.missed([hole], INTERVAL) == 1 and hole.begin < cut + 5 and hole.end > cut


def at_the_kill(hole: gaps.Hole, killed: float, budget: float) -> bool:
    """Around the death of vmagent; `killed` is right by some seconds."""
    return killed - FLUSH - 2 * INTERVAL <= hole.begin and hole.end <= killed + budget


def test_outage_with_a_kill_in_the_middle(fleet: Watched, request: pytest.FixtureRequest) -> None:
    away = minutes(request) * 60
    before = {app: restarts(fleet, app) for app in ("vmagent", "log-shipper")}
    since = time.time() - 60
    kill_in(fleet, away / 2)
    cut = time.time()
    fleet.hosts.power(ALONE, "cut")
    try:
        time.sleep(away / 2)
        killed = time.time()
        time.sleep(away / 2)
        seen = fleet.prometheus.samples(f'counter_lines_total{{robot="{ALONE}"}}', cut - 30, time.time())
        newest = max((gaps.times(one)[-1] for one in seen), default=0.0)
        assert newest < cut + INTERVAL, "the link was not cut: samples came"
    finally:
        fleet.hosts.power(ALONE, "join")
    joined = time.time()
    end = joined + 30

    def behind() -> dict[str, float]:
        now = time.time()
        samples = fleet.prometheus.samples(f'counter_lines_total{{robot="{ALONE}"}}', since, now)
        last = max((gaps.times(one)[-1] for one in samples), default=0.0)
        return {"samples": max(0.0, end - last), "lines": lines_behind(fleet, since, end)}

    wait_until(behind, lambda late: not any(late.values()), CAUGHT_UP, f"{ALONE} caught up (seconds behind)", pause=3)
    caught = time.time() - joined
    assert {app: restarts(fleet, app) - count for app, count in before.items()} == {"vmagent": 1, "log-shipper": 1}

    lines = gaps.numbers(fleet.loki.lines(f'{{robot="{ALONE}",app="counter"}}', since, end))
    total = sum(one.last - one.first + 1 for one in lines.values())
    missing, twice = (sum(getattr(one, what) for one in lines.values()) for what in ("missing", "twice"))
    fleet.say(
        f"cut off for {joined - cut:.0f} s, both killed after {killed - cut:.0f} s; caught up {caught:.0f} s later",
        f"log lines: {total} numbered, {missing} missing, {twice} twice",
    )

    lost, count = [], 0
    for name in SERIES:
        for series in fleet.prometheus.samples(f'{name}{{robot="{ALONE}"}}', since, end):
            count += len(series["values"])
            marks = gaps.times(series)
            lost += [(name, series["metric"]["job"], hole) for hole in gaps.holes(marks, INTERVAL, marks[0], marks[-1])]
    worst = max((hole.seconds for *_series, hole in lost), default=0.0)
    budget = FLUSH + RESTART + 1.5 * INTERVAL
    outside = [one for one in lost if not (on_its_way(one[2], cut) or at_the_kill(one[2], killed, budget))]
    fleet.say(
        f"samples: {count} of {len(SERIES)} metrics, {gaps.missed((hole for *_x, hole in lost), INTERVAL)} missing; "
        f"longest hole {worst:.0f} s (budget: {budget:.0f} s around the kill), {len(outside)} outside of it"
    )
    # of a robot that is away nothing is known: nothing may be said about its graph
    graph = f'max_over_time(ALERTS{{alertstate="firing",robot="{ALONE}",alertname=~"Ros.*"}}[{away:.0f}s])'
    said = {one["metric"]["alertname"] for one in fleet.prometheus.instant(graph, joined)}
    assert said == set(), "false alarms"
    assert (missing, len(lines)) == (0, 1), lines
    assert outside == []
    assert worst <= budget, lost
