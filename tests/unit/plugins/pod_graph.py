# SPDX-License-Identifier: GPL-3.0-or-later
"""A small ROS graph for the tests of what runs in pods: a node of ours that publishes, subscribes and serves."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

from ansible_collections.rosops.fleet.plugins.module_utils._ros.backend import MasterState, Questions
from ansible_collections.rosops.fleet.plugins.module_utils._ros.contract import Contract
from ansible_collections.rosops.fleet.plugins.module_utils._ros.graph import (
    Graph,
    Handshake,
    NodeKey,
    Rate,
    ServiceProbe,
    names_of,
)
from ansible_collections.rosops.fleet.plugins.module_utils._ros.replies import NodeAnswer, build

OWN, SUBSCRIBER, PUBLISHER = "/talker_0a1b2c3d", "/listener", "/source"
URI = "http://127.0.0.1:40001/"


def bus(*edges: tuple[str, str]) -> list[list[Any]]:
    """getBusInfo's rows of connections to subscribers: (topic, subscriber)."""
    return [[number, peer, "o", "TCPROS", topic, 1] for number, (topic, peer) in enumerate(edges)]


class Clock:
    """Time passes while somebody sleeps, and things happen at their times."""

    def __init__(self) -> None:
        self.at = 0.0
        self.when: list[tuple[float, Callable[[], Any]]] = []

    def now(self) -> float:
        return self.at

    def sleep(self, seconds: float) -> None:
        self.at += seconds
        for at, change in [one for one in self.when if one[0] <= self.at]:
            self.when.remove((at, change))
            change()


class World:
    """What the master and the nodes say; a test changes a part of it, and `ros` is asked as the real one is."""

    uri = "http://ros-master:11311"
    me, version = OWN, "_0a1b2c3d"  # of the pod

    def __init__(self) -> None:
        self.publishers = {"/out": [OWN], "/in": [PUBLISHER], "/rosout": [OWN, PUBLISHER]}
        self.subscribers = {"/out": [SUBSCRIBER], "/in": [OWN], "/rosout": ["/rosout"]}
        self.services = {"/add": [OWN]}
        self.types = {"/out": "std_msgs/String", "/in": "std_msgs/Int32", "/rosout": "rosgraph_msgs/Log"}
        self.answers = {
            OWN: NodeAnswer(
                URI, 71, bus=bus(("/out", SUBSCRIBER)), publications=[["/out", "std_msgs/String"]],
                subscriptions=[["/in", "std_msgs/Int32"]],
            ),
            PUBLISHER: NodeAnswer("http://127.0.0.1:40002/", 72, bus=bus(("/in", OWN))),
            SUBSCRIBER: NodeAnswer("http://127.0.0.1:40003/", 73, bus=[]),
        }  # fmt: skip
        self.probes = {"/add": ServiceProbe("rosrpc://127.0.0.1:40004", OWN, "rospy_tutorials/AddTwoInts", md5sum="aa")}
        self.sums = {"/out": "bb"}
        self.hz = {"/out": 100.0}
        self.asked: list[Any] = []

    def replies(self, node: str, **changes: Any) -> None:
        """Another answer of a node; `error` makes it one that does not answer."""
        told = {"error": "", "refused": False, **({"pid": None} if "error" in changes else {}), **changes}
        self.answers[node] = replace(self.answers[node], **told)

    def own(self, topic: str) -> list[str]:
        """The pod's own nodes that publish it."""
        return [node for node in self.publishers[topic] if node.endswith(self.version)]

    # ---- the ROS backend

    def state(self, types: bool = False) -> MasterState:
        self.asked.append("state")
        registered = [
            {name: tuple(nodes) for name, nodes in part.items() if nodes}
            for part in (self.publishers, self.subscribers, self.services)
        ]
        return MasterState(*registered, self.types if types else {})

    def ask(self, state: MasterState, wanted: Questions) -> Graph:
        self.asked.append(dict(wanted.nodes))
        answers = {
            name: self.answers[name] if "bus" in calls else replace(self.answers[name], bus=None)
            for name, calls in wanted.nodes.items()
        }
        return build(state, answers, {name: self.probes[name] for name in wanted.services if name in self.probes})

    def handshakes(self, graph: Graph, topics: Any) -> dict[str, Handshake]:
        assert all(
            names_of(graph.topics[name].publishers) == self.own(name) for name in topics
        )  # its own word, nobody else's
        self.asked.append("handshakes")
        own = {name: graph.topics[name].publishers[0] for name in topics}
        said = {name: Handshake(key, self.sums.get(name, "")) for name, key in own.items()}
        return {name: one for name, one in said.items() if name in self.sums}

    def rates(self, graph: Graph, seconds: Any, patient: bool = False) -> dict[str, Rate]:
        assert not patient and min(seconds.values()) >= 1.0
        assert all(names_of(graph.topics[name].publishers) == self.own(name) for name in seconds)
        self.asked.append("rates")
        rates = {name: Rate(self.hz.get(name, 0.0), 50, seconds[name]) for name in seconds}
        return {name: Rate(rate.hz, 50, rate.seconds, by={NodeKey(self.me, URI): rate}) for name, rate in rates.items()}


def contract(**changes: Any) -> Contract:
    """What the version before gave."""
    owed: dict[str, Any] = {
        "revision": "0a1b2c3d",
        "tolerance": 0.1,
        "node": OWN,
        "nodes": [OWN],
        "topics": {"/out": {"type": "std_msgs/String", "md5sum": "bb", "publishers": {OWN: {"rate": 100.0}}}},
        "subscriptions": {"/in": {"type": "std_msgs/Int32"}},
        "services": {"/add": {"type": "rospy_tutorials/AddTwoInts", "md5sum": "aa"}},
        "actions": [],
        "edges": [[OWN, "/out", SUBSCRIBER], [PUBLISHER, "/in", OWN]],
        **changes,
    }
    return Contract.from_dict(owed)
