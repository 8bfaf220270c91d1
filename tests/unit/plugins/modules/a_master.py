# SPDX-License-Identifier: GPL-3.0-or-later
"""A master that plays the recorded graph."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace

from ansible_collections.rosops.fleet.plugins.module_utils._common.errors import RosError
from ansible_collections.rosops.fleet.plugins.module_utils._ros.backend import MasterState, Questions
from ansible_collections.rosops.fleet.plugins.module_utils._ros.graph import Graph, Handshake, Rate
from ansible_collections.rosops.fleet.plugins.module_utils._ros.replies import NodeAnswer, build
from ansible_collections.rosops.fleet.tests.unit.plugins.fake_ros import recorded_answers, recorded_state


class Master:
    """Each look meets the next nodes' answers; the last ones stay. An error in their place is a master that is away."""

    def __init__(self) -> None:
        self.looks: list[Mapping[str, NodeAnswer] | str] = [recorded_answers()]
        self.asked: list[tuple[str, float]] = []

    def __call__(self, uri: str, timeout: float) -> Master:
        """As the client is made."""
        self.asked.append((uri, timeout))
        self.uri = uri
        return self

    def state(self, types: bool = False) -> MasterState:
        self.now = self.looks.pop(0) if len(self.looks) > 1 else self.looks[0]
        if isinstance(self.now, str):
            raise RosError(self.now)
        return recorded_state() if types else replace(recorded_state(), types={})

    def ask(self, state: MasterState, wanted: Questions) -> Graph:
        assert not isinstance(self.now, str)
        return build(state, {name: self.now[name] for name in wanted.nodes})

    def rates(self, graph: Graph, seconds: Mapping[str, float], patient: bool = False) -> dict[str, Rate]:
        del patient
        assert set(seconds) <= set(graph.topics)
        return {
            name: Rate(5.0, 10, taken, by={key: Rate(2.4, known=2.5) for key in graph.topics[name].publishers})
            for name, taken in seconds.items()
        }

    def handshakes(self, graph: Graph, topics: Iterable[str]) -> dict[str, Handshake]:
        a = graph.node("/talker_a").key
        return {name: Handshake(a, "99", name == "/chatter", "string data") for name in topics if name in graph.topics}
