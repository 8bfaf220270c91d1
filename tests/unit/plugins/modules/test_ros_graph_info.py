# SPDX-License-Identifier: GPL-3.0-or-later
from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import Any

import pytest
import yaml
from ansible_collections.rosops.fleet.plugins.module_utils._common.errors import RosError
from ansible_collections.rosops.fleet.plugins.module_utils._ros.backend import MasterState, Questions
from ansible_collections.rosops.fleet.plugins.module_utils._ros.graph import Graph, Handshake, Rate
from ansible_collections.rosops.fleet.plugins.module_utils._ros.replies import build
from ansible_collections.rosops.fleet.plugins.module_utils._ros.roslaunch import Child
from ansible_collections.rosops.fleet.plugins.modules import ros_graph_info
from ansible_collections.rosops.fleet.tests.unit.plugins.fake_ros import DEAD, recorded_answers, recorded_state


class FakeMaster:
    error = ""
    launched = Child("arm/lidar-3", "127.0.0.1", True, None, True, False, 5)

    def __init__(self, uri: str, timeout: float) -> None:
        del uri, timeout

    def state(self, types: bool = False) -> MasterState:
        assert types
        if self.error:
            raise RosError(self.error)
        return recorded_state()

    def ask(self, state: MasterState, wanted: Questions) -> Graph:
        answers = recorded_answers()
        return build(state, {name: answers[name] for name in wanted.nodes})

    def rates(self, graph: Graph, seconds: Mapping[str, float], patient: bool) -> dict[str, Rate]:
        assert (patient, set(seconds) <= set(graph.topics)) == (True, True)
        return {
            name: Rate(5.0, 10, taken, by={key: Rate(2.4, known=2.5) for key in graph.topics[name].publishers})
            for name, taken in seconds.items()
        }

    def handshakes(self, graph: Graph, topics: Iterable[str]) -> dict[str, Handshake]:
        a = graph.node("/talker_a").key
        return {name: Handshake(a, "99", name == "/chatter", "string data") for name in topics if name in graph.topics}


class FakeSockets:
    def count(self, graph: Graph) -> dict[str, int]:
        return dict.fromkeys(graph.services, 1)


Run = Callable[..., dict[str, Any]]


@pytest.fixture
def run(monkeypatch: pytest.MonkeyPatch, main: Run) -> Run:
    """The module with these options, at a master that fails with `error`."""
    monkeypatch.setattr(ros_graph_info, "Ros1Client", FakeMaster)

    def children(_ros: Any, hosts: set[str]) -> list[Child]:
        return [child for child in [FakeMaster.launched] if child.host in hosts]

    monkeypatch.setattr(ros_graph_info, "children", children)

    def called(error: str = "", **params: Any) -> dict[str, Any]:
        monkeypatch.setattr(FakeMaster, "error", error)
        return main(ros_graph_info, **params)

    return called


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


def test_a_part_of_the_graph(run: Run) -> None:
    nodes = run(nodes=["/relay", "/not_there_yet"])["graph"]["nodes"]
    asked = {name for name, node in nodes.items() if node["uri"]}
    assert asked == {"/relay", "/talker_a", "/talker_b", "/listener_relay", "/rosout"}
    assert nodes["/worker"] == {**nodes["/worker"], "reachable": False, "error": ""}


def test_what_launch_files_started(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    """Where the nodes are that it is about, and with what the graph says of those that left their registration."""
    [found] = run()["graph"]["launched"]
    assert (found["node"], found["crash"]) == ("/arm/lidar", "was started again 4 times")
    assert run(nodes=["/not_there_yet"])["graph"]["launched"] == []
    assert len(run(nodes=["/relay"])["graph"]["launched"]) == 1
    none_registered = {"nodes": ["/not_there_yet"], "launch_hosts": ["127.0.0.1"]}
    assert len(run(**none_registered)["graph"]["launched"]) == 1
    dead = Child(f"{DEAD[1:]}-1", "127.0.0.1", False, None, False, False, 1)
    monkeypatch.setattr(FakeMaster, "launched", dead)
    assert run()["graph"]["launched"][0]["crash"] == "died, as its registration is still there"


def test_rates_of_some_topics(run: Run) -> None:
    topics = run(rates=True, rate_topics=["/chatter"])["graph"]["topics"]
    assert [name for name, topic in topics.items() if topic["rate"] is not None] == ["/chatter"]
    topics = run(rates=True, rate_topics=[])["graph"]["topics"]
    assert {topic["rate"] for topic in topics.values()} == {None}


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


def test_md5sums_and_definitions(run: Run) -> None:
    topics = run(md5sums=True)["graph"]["topics"]
    assert {topic["md5sum"] for topic in topics.values()} == {"99"}
    assert not any("definition" in topic for topic in topics.values())
    assert {name: topic["latched"] for name, topic in topics.items() if topic["latched"]} == {"/chatter": ["/talker_a"]}
    topics = run(md5sums=True, definitions=True)["graph"]["topics"]
    assert {topic["definition"] for topic in topics.values()} == {"string data"}


def test_service_connections(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    services = run()["graph"]["services"]
    assert {service["connections"] for service in services.values()} == {None}
    monkeypatch.setattr(ros_graph_info, "ServiceConnections", FakeSockets)
    services = run(service_connections=True)["graph"]["services"]
    assert {service["connections"] for service in services.values()} == {1}


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
