# SPDX-License-Identifier: GPL-3.0-or-later
"""The exporter's looks at a whole ROS graph: the master, then all nodes, a few at a time.

It registers nothing and subscribes to nothing. Its only data connections: the handshake that a service's client makes,
and one message of an action's status topic.
"""

from __future__ import annotations

from .._ros.backend import Questions
from .._ros.client import Ros1Client
from .._ros.graph import Graph, host_of
from .._ros.roslaunch import Child, children
from . import snapshot
from .snapshot import CALLER


class Observer(Ros1Client):
    at_once, statuses = 8, 1  # peers that are asked at the same time, and messages of an action server's status

    def __init__(self, uri: str, timeout: float) -> None:
        super().__init__(uri, timeout, CALLER)
        self.wrong: dict[tuple[str, ...], str] = {}  # question of the last look -> why there is no usable answer

    def noted(self, key: tuple[str, ...], error: BaseException) -> None:
        self.wrong[key] = snapshot.reason(error)

    def look(self) -> tuple[Graph, list[Child]]:
        """The graph, and what launch files started where its nodes are; RosError where the master does not answer."""
        self.wrong = {}
        state = self.state()
        nodes = dict.fromkeys(state.nodes(), frozenset({"bus", "stats"}))
        services = tuple(filter(snapshot.is_watched, state.services))
        graph = self.ask(state, Questions(nodes, services, tuple(state.graph.actions)))
        return graph, children(self, {host_of(node.uri) for node in graph.nodes.values()}, self.at_once)
