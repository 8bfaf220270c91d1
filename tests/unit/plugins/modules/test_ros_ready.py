# SPDX-License-Identifier: GPL-3.0-or-later
"""The module through its main(), with a backend that plays the recorded graph."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

import pytest
from ansible_collections.rosops.fleet.plugins.module_utils._ros.replies import NodeAnswer
from ansible_collections.rosops.fleet.plugins.modules import ros_ready
from ansible_collections.rosops.fleet.tests.unit.plugins.fake_ros import DEAD, recorded_answers
from ansible_collections.rosops.fleet.tests.unit.plugins.modules.a_master import Master

HEALTHY = recorded_answers()
TALKER_DOWN = {**HEALTHY, "/talker_a": replace(HEALTHY["/talker_a"], pid=None, error="off")}
Run = Callable[..., dict[str, Any]]


@pytest.fixture
def run(master: Master, main: Run) -> Run:
    """The module with these options, where the master's looks meet these answers."""

    def called(looks: list[Mapping[str, NodeAnswer] | str], **params: Any) -> dict[str, Any]:
        master.looks = looks
        result = main(ros_ready, **params)
        assert result.get("changed", False) is False
        return result

    return called


@pytest.mark.parametrize("check_mode", [False, True])
def test_ready(run: Run, master: Master, check_mode: bool) -> None:
    topics = [{"name": "/chatter", "type": "std_msgs/String", "min_rate": 4.5}]
    where = {"master_uri": "http://m:1", "node_timeout": 1.5, "timeout": 0, "_ansible_check_mode": check_mode}
    result = run([HEALTHY], nodes=["talker_a"], topics=topics, absent=["/gone"], **where)
    assert (result["ready"], result["verdict"], result["looks"]) == (True, "pass", 1)
    kinds = ["master http://m:1", "node /talker_a", "topic /chatter", "rate /chatter", "absent /gone"]
    assert [f"{one['kind']} {one['name']}" for one in result["checks"] if one["verdict"] == "pass"] == kinds
    assert set(result["checks"][0]) == {"kind", "name", "verdict", "reason", "observed"}
    assert master.asked == [("http://m:1", 1.5)]


def test_it_waits_until_the_graph_is_ready(run: Run) -> None:
    result = run(
        ["the ROS master does not answer", TALKER_DOWN, HEALTHY], nodes=["/talker_a"], timeout=10, interval=0.05
    )
    assert (result["ready"], result["looks"]) == (True, 3)
    assert 0.1 <= result["elapsed"] < 5


def test_a_time_out_names_every_unmet_condition(run: Run) -> None:
    nodes, topics = ["/talker_a", "/talker_b", DEAD, "/nobody"], [{"name": "/chatter", "publishers": 2}]
    result = run([TALKER_DOWN], nodes=nodes, topics=topics, timeout=0.1, interval=0.05)
    assert (result["ready"], result["verdict"], result["looks"] >= 2) == (False, "wait", True)
    assert result["msg"].startswith("The ROS graph is not ready after 0.")
    for text in (
        "node /talker_a: registered, but down: off",
        f"node {DEAD}: registered, but down",
        "topic /chatter: 1 publisher of at least 2; registered, but down: /talker_a (off)",
    ):
        assert text in result["msg"]
    assert "/talker_b:" not in result["msg"]
    assert len(result["checks"]) == 6


def test_what_waiting_cannot_mend_fails_at_once(run: Run) -> None:
    result = run([HEALTHY], topics=[{"name": "/chatter", "type": "std_msgs/Int32"}], timeout=60)
    assert (result["verdict"], result["looks"]) == ("fail", 1)
    assert "cannot become ready" in result["msg"]


def test_too_few_passes_in_a_row_say_so(run: Run) -> None:
    result = run([HEALTHY], nodes=["/talker_a"], consecutive=2, timeout=0)
    assert (result["ready"], result["verdict"]) == (False, "wait")
    assert "ready in 1 of 2 looks in a row" in result["msg"]


@pytest.mark.parametrize(
    ("params", "words"),
    [
        ({"nodes": ["a b"], "timeout": -1}, ["nodes[0]", "timeout"]),
        ({"topics": [{"type": "a/B"}]}, ["name"]),
        ({"actions": [{"name": "/a", "state": "busy"}]}, ["state", "busy"]),
        ({"interval": "soon"}, ["interval"]),
    ],
)
def test_bad_options(run: Run, master: Master, params: dict[str, Any], words: list[str]) -> None:
    result = run([HEALTHY], **params)
    assert result["failed"]
    assert all(word in result["msg"] for word in words)
    assert master.asked == []
