# SPDX-License-Identifier: GPL-3.0-or-later
"""What gate, probes and reports ask of a ROS system: the interface that each kind of ROS has a client for. Pure.

`client.Ros1Client` is the one for ROS 1. Whoever asks knows the answers (`graph`) and nothing of how they came.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, Iterable, Mapping, Protocol

from .graph import PARTS, Graph, Handshake, Keys, Node, NodeKey, Rate, Service, Topic, names_of

Registrations = Mapping[str, "tuple[str, ...]"]


@dataclass(frozen=True)
class MasterState:
    """Who registered what: topic or service -> names of nodes. It says nothing about who is alive."""

    publishers: Registrations = field(default_factory=dict)
    subscribers: Registrations = field(default_factory=dict)
    services: Registrations = field(default_factory=dict)
    types: Mapping[str, str] = field(default_factory=dict)

    def nodes(self) -> list[str]:
        return names_of(self.graph.nodes)

    def servers(self, action: str) -> tuple[str, ...]:
        """The nodes with everything that a server of that action has."""
        return tuple(names_of(self.graph.action(action).servers))

    @cached_property
    def graph(self) -> Graph:
        """The graph as it is registered: nobody asked, nobody known to be connected.

        Made once for all who ask what a node has registered: a large graph has many.
        """
        parts: Any = dict(zip(PARTS, map(_turned, (self.publishers, self.subscribers, self.services))))
        names = sorted(set().union(*parts.values()))
        nodes = {NodeKey(one): Node(one, **{part: of.get(one, ()) for part, of in parts.items()}) for one in names}

        def ends(part: Registrations, name: str) -> Keys:
            return tuple(map(NodeKey, part.get(name, ())))

        topics = {
            name: Topic(name, self.types.get(name, ""), ends(self.publishers, name), ends(self.subscribers, name))
            for name in sorted({*self.publishers, *self.subscribers})
        }
        found = Graph(nodes, topics, {name: Service(name, ends(self.services, name)) for name in self.services})
        actions = (found.action(name[: -len("/status")]) for name in topics if name.endswith("/status"))
        return replace(found, actions={action.name: action for action in actions if action.servers})


def _turned(part: Registrations) -> dict[str, tuple[str, ...]]:
    """Name -> nodes as node -> names."""
    found: dict[str, list[str]] = {}
    for name in sorted(part):
        for node in dict.fromkeys(part[name]):
            found.setdefault(node, []).append(name)
    return {node: tuple(names) for node, names in found.items()}


@dataclass(frozen=True)
class Questions:
    """What one look has to find out. `nodes`: node -> what to ask beside its process id ("bus", "types", "stats")."""

    nodes: Mapping[str, frozenset[str]] = field(default_factory=dict)
    services: tuple[str, ...] = ()
    actions: tuple[str, ...] = ()


def everything(state: MasterState) -> Questions:
    """The questions for a picture of the whole graph."""
    nodes = dict.fromkeys(state.nodes(), frozenset({"bus"}))
    return Questions(nodes, tuple(sorted(state.services)), tuple(state.graph.actions))


def around(state: MasterState, nodes: Iterable[str]) -> Questions:
    """The questions for these nodes' part of the graph: themselves, their services, those they exchange messages with.

    And every action: one that was not asked must not look idle.
    """
    own = [node for name in dict.fromkeys(nodes) for node in state.graph.named(name)]
    heard = [name for node in own for topic in node.subscriptions for name in state.publishers.get(topic, ())]
    hear = [name for node in own for topic in node.publications for name in state.subscribers.get(topic, ())]
    asked: dict[str, frozenset[str]] = dict.fromkeys(hear, frozenset())
    asked.update(dict.fromkeys([*(node.name for node in own), *heard], frozenset({"bus"})))
    services = sorted({service for node in own for service in node.services})
    return Questions(asked, tuple(services), tuple(state.graph.actions))


class Backend(Protocol):
    """One ROS graph. It is read only; RosError where the graph as a whole cannot be asked."""

    uri: str  # where it is asked, for messages

    def state(self, types: bool = False) -> MasterState:
        """Who has registered what; topics' types only where they are wanted."""

    def ask(self, state: MasterState, wanted: Questions) -> Graph:
        """The graph with what the peers themselves say; one that does not answer stands in it with the reason."""

    def handshakes(self, graph: Graph, topics: Iterable[str]) -> dict[str, Handshake]:
        """Topic -> what a publisher of it says; none, no entry."""

    def rates(self, graph: Graph, seconds: Mapping[str, float], patient: bool = False) -> dict[str, Rate]:
        """Count the messages of topics, all at the same time, each for its number of seconds.

        Those of the publishers that the topics have in this graph (`Graph.published_by`). If `patient`, slow topics are
        counted for longer, some seconds at most, for as long as that may still make their rate known.
        """
