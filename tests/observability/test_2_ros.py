# SPDX-License-Identifier: GPL-3.0-or-later
"""The ROS exporter tells the truth about a topic at 500 Hz, and nobody in the graph knows of it."""

from __future__ import annotations

import time

import pytest
from cluster import SENSOR, STORAGE
from evidence import parse
from runs import wait_until
from watched import INTERVAL, MEMBER, ROBOTS, Watched

SECONDS = 90.0
TOPIC = "/temperature"


@pytest.mark.parametrize("robot", ROBOTS)
def test_rate_is_the_publishers_own(fleet: Watched, robot: str) -> None:
    """What the exporter counted between two of its looks, against the publisher's account of the same time."""
    begin = time.time()
    labels = f'robot="{robot}"'
    counted = f'ros_topic_messages_total{{{labels},topic="{TOPIC}",direction="out"}}'
    looked = f"ros_exporter_last_poll_timestamp_seconds{{{labels}}}"

    def scrapes() -> int:
        found = (fleet.prometheus.samples(what, begin, time.time()) for what in (counted, looked))
        return min(sum(len(one["values"]) for one in series) for series in found)

    wanted = SECONDS / INTERVAL
    wait_until(scrapes, lambda found: found >= wanted, SECONDS + 60, f"{wanted:.0f} scrapes of {robot}", pause=2)
    end = time.time()
    [messages] = fleet.prometheus.samples(counted, begin, end)
    [looks] = fleet.prometheus.samples(looked, begin, end)
    when = {time: float(value) for time, value in looks["values"]}  # both of one scrape: one time
    found = [(when[time], float(value)) for time, value in messages["values"] if time in when]
    (first, before), (last, after) = found[0], found[-1]
    exporter = (after - before) / (last - first)

    path = f"{STORAGE}/*_robot-{robot}_{SENSOR}/temperature-published.jsonl"
    account = parse(fleet.hosts.ssh(robot, f"tail -n {SECONDS * 4:.0f} {path}"))
    own = [(line["time"], line["sent"]) for line in account if first - 1 <= line["time"] <= last + 1]
    publisher = (own[-1][1] - own[0][1]) / (own[-1][0] - own[0][0])
    off = exporter / publisher - 1
    fleet.say(
        f"{robot}: {last - first:.0f} s: exporter {exporter:.2f} Hz, publisher {publisher:.2f} Hz: {off * 100:+.2f} %"
    )
    assert abs(off) < 0.02
    assert 450 < publisher < 550


@pytest.mark.parametrize("robot", ROBOTS)
def test_nobody_new_in_the_graph(fleet: Watched, robot: str) -> None:
    graph = fleet.graph(robot)
    names = {name.rsplit("_", 1)[0] for kind in graph.values() for nodes in kind.values() for name in nodes}
    assert not {name for name in names if "exporter" in name}, names
    assert [name.rsplit("_", 2)[0] for name in graph["subscribers"][TOPIC]] == ["/temperature_stats"], graph
    seen = fleet.prometheus.value(f'ros_topic_subscribers{{robot="{robot}",topic="{TOPIC}"}}')
    connections = f'ros_topic_connections{{robot="{robot}",topic="{TOPIC}",direction="out"}}'
    assert seen == 1
    assert fleet.prometheus.value(connections) == 1, "a connection that is no subscriber's"


def test_claims_are_measured(fleet: Watched) -> None:
    used = fleet.prometheus.instant(f'rosops_claim_used_bytes{{robot="{MEMBER}"}}')
    assert {one["metric"]["claim"] for one in used} >= {SENSOR}, used
