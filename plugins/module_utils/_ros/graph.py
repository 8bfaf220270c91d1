# SPDX-License-Identifier: GPL-3.0-or-later
"""The ROS graph as data: what the master registered, and what the nodes say of themselves.

Pure, and the same for every kind of ROS: nothing here opens a connection or knows a protocol.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, Callable, Collection, Iterable, Mapping, NamedTuple, Tuple, TypeVar
from urllib.parse import urlsplit

from .names import by_revision, is_meant

ANY_TYPE = "*"  # what a node says that takes any message type
PARTS = ("publications", "subscriptions", "services")  # of a node, by name
# s for a peer that does not answer (a laptop asleep, a process that hangs). One that is only slow, or has only just
# come, answers within a fraction of that.
PATIENCE = 5.0

# actionlib_msgs/GoalStatus. The first four are a goal that the server still owes an answer.
GOAL_STATES = {
    0: "PENDING", 1: "ACTIVE", 6: "PREEMPTING", 7: "RECALLING",
    2: "PREEMPTED", 3: "SUCCEEDED", 4: "ABORTED", 5: "REJECTED", 8: "RECALLED", 9: "LOST",
}  # fmt: skip
BUSY_STATES = frozenset({0, 1, 6, 7})


class NodeKey(NamedTuple):
    """Which node is meant. Several participants may each have a node of one name at the same time.

    `participant` is where it is, in ROS 1 its URI; empty for a node that nobody was asked for, or that has no address.
    """

    name: str
    participant: str = ""

    def __str__(self) -> str:
        return self.name


Keys = Tuple[NodeKey, ...]
Flow = Tuple[str, str]  # topic, direction
Link = Tuple[str, str, int]  # topic, direction, connection
Told = TypeVar("Told")


def names_of(keys: Iterable[NodeKey]) -> list[str]:
    """Their names, each once."""
    return list(dict.fromkeys(key.name for key in keys))


# ---- what comes back where somebody is asked


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
    by: Mapping[NodeKey, Rate] = field(default_factory=dict, compare=False)
    known: float | None = None
    latched: bool = False
    few: bool = False

    @classmethod
    def of_all(cls, by: Mapping[NodeKey, Rate], errors: Mapping[NodeKey, str]) -> Rate:
        """That of a topic: of each publisher what was counted, or why nothing was."""
        parts, every = list(by.values()), {**by, **{key: Rate(error=why) for key, why in errors.items()}}
        if not parts:
            return Rate(error="; ".join(errors.values()) or "no publisher", by=every)
        hz, messages = sum(one.hz for one in parts), sum(one.messages for one in parts)
        return Rate(hz, messages, max(one.seconds for one in parts), by=every, few=all(one.few for one in parts))

    @property
    def unknown(self) -> str:
        """Why it is not known, though it was to be measured; empty where it is."""
        if self.error or not self.few:
            return self.error
        number = {0: "no message", 1: "1 message"}.get(self.messages, f"{self.messages} messages")
        return f"{number} in {self.seconds:.1f} s"


@dataclass(frozen=True)
class Handshake:
    """What a publisher says of a topic, whoever listens: its type's md5sum, and whether it latches."""

    publisher: NodeKey
    md5sum: str = ""
    latching: bool = False
    definition: str = field(default="", compare=False)  # the text of its type and of those within it


@dataclass(frozen=True)
class Count:
    messages: int = 0
    bytes: int = 0


@dataclass(frozen=True)
class Stats:
    """What a node has counted: of every connection, and the topics that it has, with or without connections."""

    links: Mapping[Link, Count]
    flows: frozenset[Flow]
    wraps: bool  # the counts, past 32 bits


# ---- the graph


@dataclass(frozen=True)
class Connection:
    """A transport as one of its two ends reports it: to (`o`) or from (`i`) the peer.

    The peer of an outgoing one is the subscriber's node name; of an incoming one the publisher's URI. Only the outgoing
    ones say that messages flow: both client libraries report an incoming one as connected before any handshake.
    `number` is the node's.
    """

    topic: str
    peer: str
    direction: str
    transport: str
    connected: bool
    number: int = field(default=-1, compare=False)


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
    stats: Stats | None = None  # None: not asked, or not told

    @property
    def key(self) -> NodeKey:
        return NodeKey(self.name, self.uri)

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
    """`rate` (Hz of all publishers together) to `definition` are known where they were asked for: `Graph.measured`.

    `rates` has the publishers whose rate may be expected of them from now on, `unsteady` what the others sent per
    second, `latched` those that latch; `rate_error` says why a rate that was to be measured is not known.
    """

    name: str
    type: str = ""
    publishers: Keys = ()
    subscribers: Keys = ()
    connections: tuple[tuple[NodeKey, NodeKey], ...] = ()  # (publisher, subscriber), by the publishers' word
    rate: float | None = None
    rates: Mapping[NodeKey, float] = field(default_factory=dict)
    unsteady: Mapping[NodeKey, float] = field(default_factory=dict)
    latched: Keys = ()
    rate_error: str = ""
    md5sum: str = ""
    definition: str | None = None

    def connects(self, publisher: str, subscriber: str) -> bool:
        return any((one.name, other.name) == (publisher, subscriber) for one, other in self.connections)


@dataclass(frozen=True)
class Service:
    name: str
    providers: Keys = ()
    probe: ServiceProbe | None = None

    @property
    def up(self) -> bool:
        return bool(self.probe and not self.probe.error)

    @property
    def said(self) -> ServiceProbe:
        """What its provider says; nothing where nobody was asked."""
        return self.probe or ServiceProbe()


@dataclass(frozen=True)
class Action:
    """An action of actionlib. `servers` are the nodes with everything that a server has."""

    name: str
    type: str = ""
    servers: Keys = ()
    clients: Keys = ()
    statuses: Mapping[NodeKey, StatusReading] = field(default_factory=dict)

    @property
    def goals(self) -> dict[NodeKey, tuple[int, ...]]:
        """The states of the goals in the last status of each server that tells its own."""
        return {key: status.readings[-1] for key, status in self.statuses.items() if status.readings}

    @property
    def up(self) -> bool:
        return any(server in self.goals for server in self.servers)

    @property
    def busy(self) -> bool:
        return any(state in BUSY_STATES for listed in self.goals.values() for state in listed)


@dataclass(frozen=True)
class Graph:
    """What every reader of a ROS graph is handed. JSON is made of it, and read, by `graph_json` alone.

    Whatever names a node, as a topic its publishers, has its key. Who knows a name only asks `named`, or `node`.
    """

    nodes: Mapping[NodeKey, Node] = field(default_factory=dict)
    topics: Mapping[str, Topic] = field(default_factory=dict)
    services: Mapping[str, Service] = field(default_factory=dict)
    actions: Mapping[str, Action] = field(default_factory=dict)

    @cached_property
    def _by_name(self) -> Mapping[str, tuple[Node, ...]]:
        found: dict[str, list[Node]] = {}
        for key in sorted(self.nodes, key=lambda key: (key.name, not self.nodes[key].reachable)):
            found.setdefault(key.name, []).append(self.nodes[key])
        return {name: tuple(nodes) for name, nodes in found.items()}

    @property
    def names(self) -> list[str]:
        """All nodes' names, sorted, each once."""
        return list(self._by_name)

    def named(self, name: str) -> tuple[Node, ...]:
        """All nodes of that name; those that answer come first."""
        return self._by_name.get(name, ())

    def node(self, name: str) -> Node:
        """The node of that name, of several the one that answers; one that is not in the graph was not asked."""
        return next(iter(self.named(name)), Node(name))

    def at(self, key: NodeKey) -> Node:
        """That very node; one that is not in the graph was not asked."""
        return self.nodes.get(key, Node(*key))

    def topic(self, name: str) -> Topic:
        """One that is not in the graph has nobody."""
        return self.topics.get(name, Topic(name))

    def action(self, name: str) -> Action:
        """One that is not in the graph is what its topics show."""
        if name in self.actions:
            return self.actions[name]
        goal = self.topic(f"{name}/goal")
        whole = {*self.topic(f"{name}/status").publishers} & {*goal.subscribers}
        servers = tuple(sorted(whole & {*self.topic(f"{name}/cancel").subscribers}))
        type_ = goal.type[: -len("Goal")] if goal.type.endswith("ActionGoal") else ""
        return Action(name, type_, servers, goal.publishers)

    def unreached(self, topic: str, publisher: NodeKey, subscribers: Iterable[NodeKey]) -> list[NodeKey] | None:
        """Those of the subscribers that a publisher is not connected to; None: it does not tell.

        What "connected" means everywhere: the publisher itself reports the subscriber as a destination. The
        subscriber's word is worth nothing: it reports a connection before the handshake.
        """
        if self.at(publisher).connections is None:
            return None
        reached = {peer for key, peer in self.topic(topic).connections if key == publisher}
        return [key for key in subscribers if key not in reached]

    def heard(self, nodes: Collection[str] = ()) -> Graph:
        """The graph of what can be listened to. With `nodes`: of what these publish, where somebody listens to it.

        Whoever subscribes to a topic that nobody listens to may make its publisher begin to work: image_transport
        encodes, depth pipelines compute, only while they have a subscriber.
        """
        if not nodes:
            return self
        ends = {name: {key.name for key, _peer in topic.connections} for name, topic in self.topics.items()}
        own = {name: [node for node in ends[name] if is_meant(node, nodes)] for name in ends}
        topics = self.published_by(own).topics.items()
        return replace(self, topics={name: topic for name, topic in topics if topic.publishers})

    def published_by(self, nodes: Mapping[str, Collection[str]]) -> Graph:
        """The graph in which some of its topics have these nodes alone as publishers: no others are listened to."""
        topics = dict(self.topics)
        for name in nodes.keys() & topics.keys():
            own = tuple(key for key in topics[name].publishers if key.name in nodes[name])
            topics[name] = replace(topics[name], publishers=own)
        return replace(self, topics=topics)

    # ---- what is found out later

    def answered(self, nodes: Iterable[Node]) -> Graph:
        """The graph with what these nodes say, each in the place of the one of its name that nobody had asked."""
        said = {node.key: node for node in nodes}
        moved = {NodeKey(key.name): key for key in said}
        graph = self._called(lambda key: moved.get(key, key))
        return replace(graph, nodes={**graph.nodes, **said})

    def by_revision(self) -> Graph:
        """The graph with the names of revisions. Two pods of one are two nodes of one name then.

        What a node says of its single connections is called as it says.
        """
        graph = self._called(lambda key: key._replace(name=by_revision(key.name)), by_revision)
        return replace(graph, nodes={key: _by_revision(node) for key, node in graph.nodes.items()})

    def _called(self, key_of: Callable[[NodeKey], NodeKey], name_of: Callable[[str], str] = str) -> Graph:
        """The graph with other keys, and other names of topics, services and actions."""

        def keys(found: Iterable[NodeKey]) -> Keys:
            return tuple(map(key_of, found))

        def by_key(told: Mapping[NodeKey, Told]) -> dict[NodeKey, Told]:
            return {key_of(key): one for key, one in told.items()}

        def topic(one: Topic) -> Topic:
            name, publishers, subscribers = name_of(one.name), keys(one.publishers), keys(one.subscribers)
            edges = tuple((key_of(key), key_of(peer)) for key, peer in one.connections)
            if (name, publishers, subscribers, edges) == (one.name, one.publishers, one.subscribers, one.connections):
                return one  # most of them, where few nodes of a large graph are called otherwise
            kept = replace(one, name=name, publishers=publishers, subscribers=subscribers, connections=edges)
            return replace(kept, rates=by_key(one.rates), unsteady=by_key(one.unsteady), latched=keys(one.latched))

        def service(one: Service) -> Service:
            probe = one.probe and replace(one.probe, provider=name_of(one.probe.provider))
            return replace(one, name=name_of(one.name), providers=keys(one.providers), probe=probe)

        def action(one: Action) -> Action:
            ends = keys(one.servers), keys(one.clients)
            return Action(name_of(one.name), one.type, *ends, by_key(one.statuses))

        return Graph(
            by_key(self.nodes),
            {one.name: one for one in map(topic, self.topics.values())},
            {one.name: one for one in map(service, self.services.values())},
            {one.name: one for one in map(action, self.actions.values())},
        )

    def measured(self, rates: Mapping[str, Rate], said: Mapping[str, Handshake]) -> Graph:
        """The graph with rates and handshakes of topics."""
        topics = {name: _measured(topic, rates.get(name), said.get(name)) for name, topic in self.topics.items()}
        return replace(self, topics=topics)


def _by_revision(node: Node) -> Node:
    has: Any = {part: tuple(map(by_revision, getattr(node, part))) for part in PARTS}
    return replace(node, name=by_revision(node.name), **has)


def _measured(topic: Topic, rate: Rate | None, said: Handshake | None) -> Topic:
    by = sorted(rate.by.items()) if rate else []
    latched = {key for key, part in by if part.latched} | ({said.publisher} if said and said.latching else set())
    return replace(
        topic,
        rate=None if rate is None or rate.unknown else round(rate.hz, 3),
        rates={key: round(part.known, 3) for key, part in by if part.known is not None},
        unsteady={key: round(part.hz, 3) for key, part in by if part.known is None and part.hz and not part.unknown},
        latched=tuple(sorted(latched)),
        rate_error=rate.unknown if rate else "",
        md5sum=said.md5sum if said else "",
        definition=said.definition if said else None,
    )


def host_of(uri: str) -> str:
    """The host of a URI; nothing where it has none."""
    try:
        return urlsplit(uri).hostname or ""
    except ValueError:
        return ""
