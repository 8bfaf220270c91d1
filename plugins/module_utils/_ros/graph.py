# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""The ROS graph as data: what the master registered, and what the nodes say of themselves.

Pure, and the same for every kind of ROS: nothing here opens a connection or knows a protocol.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass, field
from functools import cached_property
from typing import Any, Iterable, Mapping
from urllib.parse import urlsplit

ANY_TYPE = "*"  # what a node says that takes any message type
# s for a peer that does not answer (a laptop asleep, a process that hangs). One that is only slow, or has only just
# come, answers within a fraction of that.
PATIENCE = 5.0

# actionlib_msgs/GoalStatus. The first four are a goal that the server still owes an answer.
GOAL_STATES = {
    0: "PENDING", 1: "ACTIVE", 6: "PREEMPTING", 7: "RECALLING",
    2: "PREEMPTED", 3: "SUCCEEDED", 4: "ABORTED", 5: "REJECTED", 8: "RECALLED", 9: "LOST",
}  # fmt: skip
BUSY_STATES = frozenset({0, 1, 6, 7})

Registrations = Mapping[str, "tuple[str, ...]"]


# ---- what is asked, and what comes back


@dataclass(frozen=True)
class MasterState:
    """Who registered what: topic or service -> names of nodes. It says nothing about who is alive."""

    publishers: Registrations = field(default_factory=dict)
    subscribers: Registrations = field(default_factory=dict)
    services: Registrations = field(default_factory=dict)
    types: Mapping[str, str] = field(default_factory=dict)

    def nodes(self) -> list[str]:
        return list(self.graph.nodes)

    def of(self, node: str, part: Registrations) -> tuple[str, ...]:
        """What a node has of one of the three parts of this state."""
        return next(names.get(node, ()) for whole, names in self._by_node if whole is part)

    @cached_property
    def _by_node(self) -> list[tuple[Registrations, Mapping[str, tuple[str, ...]]]]:
        """Each part the other way round: made once for all nodes, of which a large graph has many."""
        return [(part, _turned(part)) for part in (self.publishers, self.subscribers, self.services)]

    @cached_property
    def graph(self) -> Graph:
        """The graph as it is registered: nobody asked, nobody known to be connected."""
        published, subscribed, served = (names for _part, names in self._by_node)
        nodes = {
            name: Node(
                name,
                publications=published.get(name, ()),
                subscriptions=subscribed.get(name, ()),
                services=served.get(name, ()),
            )
            for name in sorted({*published, *subscribed, *served})
        }
        topics = {
            name: Topic(name, self.types.get(name, ""), self.publishers.get(name, ()), self.subscribers.get(name, ()))
            for name in sorted({*self.publishers, *self.subscribers})
        }
        services = {name: Service(name, providers) for name, providers in self.services.items()}
        return Graph(nodes, topics, services, {name: action_of(self, name) for name in action_names(self)})


def _turned(part: Registrations) -> dict[str, tuple[str, ...]]:
    """Name -> nodes as node -> names."""
    found: dict[str, list[str]] = {}
    for name in sorted(part):
        for node in dict.fromkeys(part[name]):
            found.setdefault(node, []).append(name)
    return {node: tuple(names) for node, names in found.items()}


@dataclass(frozen=True)
class Questions:
    """What one look has to find out. `nodes`: node -> what to ask beside its process id ("bus", "types")."""

    nodes: Mapping[str, frozenset[str]] = field(default_factory=dict)
    services: tuple[str, ...] = ()
    actions: tuple[str, ...] = ()


@dataclass(frozen=True)
class ServiceProbe:
    """A service connection's handshake. `provider` is who answered, by its own word."""

    uri: str = ""
    provider: str = ""
    type: str = ""
    error: str = ""
    md5sum: str = ""


@dataclass(frozen=True)
class StatusReading:
    """The goals' states in messages read one after the other from one action server."""

    readings: tuple[tuple[int, ...], ...] = ()
    error: str = ""
    refused: bool = False  # nothing listens at its address


@dataclass(frozen=True)
class Rate:
    """Messages per second, summed over a topic's publishers; `by` has the same of each publisher that was counted.

    `known` is what may be expected of a publisher, and of its next version: None where its messages were too few or too
    irregular to tell. `latched`: the first of its messages had been sent before anybody listened, and is not counted.
    `few`: with so few messages, `hz` is no more than how many there were.
    """

    hz: float = 0.0
    messages: int = 0
    seconds: float = 0.0
    error: str = ""
    by: Mapping[str, Rate] = field(default_factory=dict, compare=False)
    known: float | None = None
    latched: bool = False
    few: bool = False


@dataclass(frozen=True)
class Handshake:
    """What a publisher says of a topic, whoever listens: its type's md5sum, and whether it latches."""

    publisher: str
    md5sum: str = ""
    latching: bool = False
    definition: str = field(default="", compare=False)  # the text of its type and of those within it


@dataclass(frozen=True)
class Extras:
    """What can be found out beside the graph itself, where it was asked for."""

    rates: Mapping[str, Rate] = field(default_factory=dict)  # by topic
    handshakes: Mapping[str, Handshake] = field(default_factory=dict)  # by topic
    connections: Mapping[str, int] = field(default_factory=dict)  # by service


# ---- the graph


@dataclass(frozen=True)
class Connection:
    """A transport as one of its two ends reports it: to (`o`) or from (`i`) the peer.

    The peer of an outgoing one is the subscriber's node name; of an incoming one the publisher's URI. Only the outgoing
    ones say that messages flow: both client libraries report an incoming one as connected before any handshake.
    `info` is what the client library says of it in words, its sockets' addresses among them.
    """

    topic: str
    peer: str
    direction: str
    transport: str
    connected: bool
    info: str = field(default="", compare=False)


@dataclass(frozen=True)
class Node:
    name: str
    uri: str = ""
    pid: int | None = None
    asked: bool = False
    error: str = ""
    publications: tuple[str, ...] = ()
    subscriptions: tuple[str, ...] = ()
    services: tuple[str, ...] = ()
    own_types: Mapping[str, str] = field(default_factory=dict)
    connections: tuple[Connection, ...] | None = None  # None: not asked, or no answer
    refused: bool = False  # nothing listens at its address
    silent: float = 0.0  # seconds for which it has answered in no look (silence.Silence)

    @property
    def reachable(self) -> bool:
        """It answered under its registered address. A registration alone outlives its process."""
        return self.pid is not None

    @property
    def gone(self) -> bool:
        """Nothing listens where it was, or it has been silent for long. One answer that is late says nothing."""
        return self.asked and not self.reachable and (self.refused or self.silent >= PATIENCE)


@dataclass(frozen=True)
class Topic:
    name: str
    type: str = ""
    publishers: tuple[str, ...] = ()
    subscribers: tuple[str, ...] = ()
    connections: tuple[tuple[str, str], ...] = ()  # (publisher, subscriber), by the publishers' word


@dataclass(frozen=True)
class Service:
    name: str
    providers: tuple[str, ...] = ()
    probe: ServiceProbe | None = None


@dataclass(frozen=True)
class Action:
    """The five topics of an actionlib action, by the nodes that stand on its server's side."""

    name: str
    type: str = ""
    status_publishers: tuple[str, ...] = ()
    goal_subscribers: tuple[str, ...] = ()
    cancel_subscribers: tuple[str, ...] = ()
    clients: tuple[str, ...] = ()
    statuses: Mapping[str, StatusReading] = field(default_factory=dict)

    @property
    def servers(self) -> tuple[str, ...]:
        """Nodes with everything that an action server has."""
        whole = set(self.status_publishers) & set(self.goal_subscribers) & set(self.cancel_subscribers)
        return tuple(sorted(whole))


@dataclass(frozen=True)
class Graph:
    nodes: Mapping[str, Node] = field(default_factory=dict)
    topics: Mapping[str, Topic] = field(default_factory=dict)
    services: Mapping[str, Service] = field(default_factory=dict)
    actions: Mapping[str, Action] = field(default_factory=dict)

    def unreached(self, topic: str, publisher: str, subscribers: Iterable[str] | None = None) -> list[str] | None:
        """The subscribers (all registered ones, or these) that a publisher is not connected to; None: it does not tell.

        What "connected" means everywhere: the publisher itself reports the subscriber as a destination. The
        subscriber's word is worth nothing: it reports a connection before the handshake.
        """
        if self.nodes.get(publisher, Node(publisher)).connections is None:
            return None
        found = self.topics.get(topic, Topic(topic))
        reached = {peer for name, peer in found.connections if name == publisher}
        return [name for name in (found.subscribers if subscribers is None else subscribers) if name not in reached]

    def heard(self, nodes: Iterable[str] = ()) -> dict[str, tuple[str, ...]]:
        """Topic -> its publishers. With `nodes`: these alone, and of each only the topics that somebody listens to.

        Whoever subscribes to a topic that nobody listens to may make its publisher begin to work: image_transport
        encodes, depth pipelines compute, only while they have a subscriber.
        """
        wanted = set(nodes)
        if not wanted:
            return {name: topic.publishers for name, topic in self.topics.items()}
        found = {
            name: tuple(dict.fromkeys(publisher for publisher, _peer in topic.connections if publisher in wanted))
            for name, topic in self.topics.items()
        }
        return {name: publishers for name, publishers in found.items() if publishers}

    def as_dict(self, extras: Extras | None = None) -> dict[str, Any]:
        """The graph as JSON-able data, the shape that ros_graph_info returns."""
        more = extras or Extras()
        return {
            "nodes": {name: _node_dict(node) for name, node in sorted(self.nodes.items())},
            "topics": {
                name: _topic_dict(topic, more.rates.get(name), more.handshakes.get(name))
                for name, topic in sorted(self.topics.items())
            },
            "services": {
                name: _service_dict(service, more.connections.get(name))
                for name, service in sorted(self.services.items())
            },
            "actions": {name: _action_dict(action) for name, action in sorted(self.actions.items())},
        }


def _node_dict(node: Node) -> dict[str, Any]:
    return {
        "uri": node.uri,
        "pid": node.pid,
        "reachable": node.reachable,
        "error": node.error,
        "refused": node.refused,
        "publications": list(node.publications),
        "subscriptions": list(node.subscriptions),
        "services": list(node.services),
    }


def _hertz(rate: Rate | None) -> float | None:
    return None if rate is None or rate.error or rate.few else round(rate.hz, 3)


def _topic_dict(topic: Topic, rate: Rate | None, said: Handshake | None) -> dict[str, Any]:
    publishers = sorted(rate.by.items()) if rate else []
    latched = {name for name, part in publishers if part.latched}
    return {
        "type": topic.type,
        "md5sum": said.md5sum or None if said else None,
        "publishers": list(topic.publishers),
        "subscribers": list(topic.subscribers),
        "connections": [{"publisher": publisher, "subscriber": peer} for publisher, peer in topic.connections],
        "rate": _hertz(rate),
        "rates": {name: round(part.known, 3) for name, part in publishers if part.known is not None},
        "latched": sorted(latched | ({said.publisher} if said and said.latching else set())),
        "rate_error": _unknown(rate),
    }


def _unknown(rate: Rate | None) -> str:
    """Why a rate that was to be measured is not known."""
    if rate is None or rate.error or not rate.few:
        return rate.error if rate else ""
    number = {0: "no message", 1: "1 message"}.get(rate.messages, f"{rate.messages} messages")
    return f"{number} in {rate.seconds:.1f} s"


def _service_dict(service: Service, connections: int | None) -> dict[str, Any]:
    probe = service.probe or ServiceProbe()
    up = bool(service.probe and not probe.error)
    return {"providers": list(service.providers), **asdict(probe), "up": up, "connections": connections}


def _action_dict(action: Action) -> dict[str, Any]:
    goals = {server: list(status.readings[-1]) for server, status in action.statuses.items() if status.readings}
    states = [GOAL_STATES.get(state, str(state)) for listed in goals.values() for state in listed]
    return {
        "type": action.type,
        "servers": list(action.servers),
        "clients": list(action.clients),
        "up": any(server in goals for server in action.servers),
        "busy": any(state in BUSY_STATES for listed in goals.values() for state in listed),
        "goals": {state: states.count(state) for state in sorted(set(states))},
    }


# ---- what a look asks for, and what registrations show


def host_of(uri: str) -> str:
    """The host of a URI; nothing where it has none."""
    try:
        return urlsplit(uri).hostname or ""
    except ValueError:
        return ""


def everything(state: MasterState) -> Questions:
    """The questions for a picture of the whole graph."""
    return Questions(
        {name: frozenset({"bus"}) for name in state.nodes()},
        tuple(sorted(state.services)),
        tuple(action_names(state)),
    )


def around(state: MasterState, nodes: Iterable[str]) -> Questions:
    """The questions for these nodes' part of the graph: themselves, their services, those they exchange messages with.

    And every action: one that was not asked must not look idle.
    """
    own = [name for name in dict.fromkeys(nodes) if name in state.graph.nodes]
    asked = {name: frozenset({"bus"}) for name in own}
    for name in own:
        for topic in state.of(name, state.subscribers):
            asked.update(dict.fromkeys(state.publishers.get(topic, ()), frozenset({"bus"})))
    for name in own:
        for topic in state.of(name, state.publishers):
            for peer in state.subscribers.get(topic, ()):
                asked.setdefault(peer, frozenset())
    services = [service for name in own for service in state.of(name, state.services)]
    return Questions(asked, tuple(sorted(dict.fromkeys(services))), tuple(action_names(state)))


def action_of(state: MasterState, name: str, statuses: Mapping[str, StatusReading] | None = None) -> Action:
    """The action of that name as the registrations show it, whole or not."""
    goal_type = state.types.get(f"{name}/goal", "")
    return Action(
        name,
        goal_type[: -len("Goal")] if goal_type.endswith("ActionGoal") else "",
        state.publishers.get(f"{name}/status", ()),
        state.subscribers.get(f"{name}/goal", ()),
        state.subscribers.get(f"{name}/cancel", ()),
        state.publishers.get(f"{name}/goal", ()),
        statuses or {},
    )


def action_names(state: MasterState) -> list[str]:
    """Every action with a whole server: one node publishes its status and takes its goals and cancels."""
    names = [topic[: -len("/status")] for topic in state.publishers if topic.endswith("/status")]
    return sorted(name for name in names if action_of(state, name).servers)
