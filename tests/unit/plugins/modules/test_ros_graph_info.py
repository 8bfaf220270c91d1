# SPDX-License-Identifier: GPL-3.0-or-later
from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import pytest
import yaml
from ansible_collections.rosops.fleet.plugins.module_utils._ros import jobs
from ansible_collections.rosops.fleet.plugins.module_utils._ros.graph import Rate
from ansible_collections.rosops.fleet.plugins.module_utils._ros.roslaunch import Child
from ansible_collections.rosops.fleet.plugins.modules import ros_graph_info
from ansible_collections.rosops.fleet.tests.unit.plugins.fake_ros import DEAD
from ansible_collections.rosops.fleet.tests.unit.plugins.modules.a_master import Master

LIDAR = Child("arm/lidar-3", "127.0.0.1", True, None, True, False, 5)
Run = Callable[..., dict[str, Any]]


@pytest.fixture
def launched(monkeypatch: pytest.MonkeyPatch) -> list[Child]:
    """What launch files have started, wherever."""
    found = [LIDAR]
    monkeypatch.setattr(jobs, "children", lambda _ros, hosts: [child for child in found if child.host in hosts])
    return found


@pytest.fixture
def run(master: Master, launched: list[Child], main: Run) -> Run:
    """The module with these options."""
    del master, launched
    return partial(main, ros_graph_info)


def test_the_graph(run: Run) -> None:
    result = run(_ansible_check_mode=True)
    assert (result["changed"], result["elapsed"] >= 0) == (False, True)
    graph = result["graph"]
    assert set(graph) == {"nodes", "topics", "services", "actions", "launched"}
    assert graph["nodes"][DEAD]["reachable"] is False
    assert graph["topics"]["/chatter"]["rate"] is None
    assert graph["actions"]["/work"]["servers"] == ["/worker"]


def test_rates(run: Run) -> None:
    result = run(rates=True)
    topics = result["graph"]["topics"]
    assert {topic["rate"] for topic in topics.values()} == {5.0}
    assert topics["/chatter"]["rates"] == {"/talker_a": 2.5, "/talker_b": 2.5}
    assert {topic["md5sum"] for topic in topics.values()} == {None}
    for some in (["/chatter"], []):
        topics = run(rates=True, rate_topics=some)["graph"]["topics"]
        assert [name for name, topic in topics.items() if topic["rate"] is not None] == some


def test_a_part_of_the_graph(run: Run) -> None:
    nodes = run(nodes=["/relay", "/not_there_yet"])["graph"]["nodes"]
    asked = {name for name, node in nodes.items() if node["uri"]}
    assert asked == {"/relay", "/talker_a", "/talker_b", "/listener_relay", "/rosout"}
    assert nodes["/worker"] == {**nodes["/worker"], "reachable": False, "error": ""}


def test_what_launch_files_started(run: Run, launched: list[Child]) -> None:
    """Where the nodes are that it is about, and with what the graph says of those that left their registration."""
    [found] = run()["graph"]["launched"]
    assert (found["node"], found["crash"]) == ("/arm/lidar", "was started again 4 times")
    assert run(nodes=["/not_there_yet"])["graph"]["launched"] == []
    assert len(run(nodes=["/relay"])["graph"]["launched"]) == 1
    none_registered = {"nodes": ["/not_there_yet"], "launch_hosts": ["127.0.0.1"]}
    assert len(run(**none_registered)["graph"]["launched"]) == 1
    launched[:] = [Child(f"{DEAD[1:]}-1", "127.0.0.1", False, None, False, False, 1)]
    assert run()["graph"]["launched"][0]["crash"] == "died, as its registration is still there"


def test_rates_of_some_nodes_are_of_what_they_publish_to_somebody(run: Run) -> None:
    """Nobody else's streams are opened, nor one that nobody listens to: a lazy publisher would wake up."""
    graph = run(rates=True, rate_nodes=["/talker_a", "/nobody"], md5sums=True)["graph"]
    topics = graph["topics"]
    assert {name: topic["rates"] for name, topic in topics.items() if topic["rates"]} == {
        "/chatter": {"/talker_a": 2.5},
        "/rosout": {"/talker_a": 2.5},
    }
    assert {name for name, topic in topics.items() if topic["md5sum"]} == {"/chatter", "/rosout"}
    unheard = run(rates=True, rate_nodes=["/worker"])["graph"]["topics"]
    alone = {name for name, topic in unheard.items() if "/worker" in topic["publishers"] and not topic["connections"]}
    assert alone
    assert not any(unheard[name]["rates"] for name in alone)


def test_rates_by_counters_subscribe_to_nothing(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Master, "rates", None)
    monkeypatch.setattr(jobs, "counted", lambda _ros, _graph, topics, seconds: {
        "/chatter": Rate(100.0, int(100 * seconds), seconds),
        "/rosout": Rate(0.5, 1, seconds, few=True),
    } if "/chatter" in topics else {})  # fmt: skip
    topics = run(rates=True, rate_source="counters")["graph"]["topics"]
    assert (topics["/chatter"]["rate"], topics["/chatter"]["rates"]) == (100.0, {})
    assert (topics["/rosout"]["rate"], topics["/rosout"]["rate_error"]) == (None, "1 message in 2.0 s")


def test_md5sums_and_definitions(run: Run) -> None:
    topics = run(md5sums=True)["graph"]["topics"]
    assert {topic["md5sum"] for topic in topics.values()} == {"99"}
    assert not any("definition" in topic for topic in topics.values())
    assert {name: topic["latched"] for name, topic in topics.items() if topic["latched"]} == {"/chatter": ["/talker_a"]}
    topics = run(md5sums=True, definitions=True)["graph"]["topics"]
    assert {topic["definition"] for topic in topics.values()} == {"string data"}


@pytest.mark.parametrize("seconds", [0, -1, 1e9, float("nan")])
def test_a_time_that_cannot_be(run: Run, seconds: float) -> None:
    result = run(rates=True, rate_seconds=seconds)
    assert (result["failed"], "rate_seconds" in result["msg"]) == (True, True)


def test_what_is_returned_is_documented(run: Run) -> None:
    graph = run()["graph"]
    contains = yaml.safe_load(ros_graph_info.RETURN)["graph"]["contains"]
    assert set(graph) == set(contains)
    for part, entry in contains.items():
        sample, found = entry["sample"], graph[part]
        if entry["type"] == "dict":
            sample, found = list(sample.values()), list(found.values())
        assert set(sample[0]) == set(found[0]), part
