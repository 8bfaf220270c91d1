# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""The ROS graph as data: what the master registered, and what the nodes say of themselves.

Pure, and the same for every kind of ROS: nothing here opens a connection or knows a protocol.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass, field, replace
from functools import cached_property
from typing import Collection, Iterable, Mapping, NamedTuple, Tuple
from urllib.parse import urlsplit

from .._common.documents import Data, Document

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


class NodeKey(NamedTuple):
    """Which node is meant. Several participants may each have a node of one name at the same time.

    `participant` is where it is, in ROS 1 its URI; empty for a node that nobody was asked for, or that has no address.
    """

    name: str
    participant: str = ""

    def __str__(self) -> str:
        return self.name


Keys = Tuple[NodeKey, ...]


def names_of(keys: Iterable[NodeKey]) -> list[str]:
    """Their names, each once."""
    return list(dict.fromkeys(key.name for key in keys))


# ---- what is asked, and what comes back


@dataclass(frozen=True)
class MasterState:
    """Who registered what: topic or service -> names of nodes. It says nothing about who is alive."""

    publishers: Registrations = field(default_factory=dict)
    subscribers: Registrations = field(default_factory=dict)
    services: Registrations = field(default_factory=dict)
    types: Mapping[str, str] = field(default_factory=dict)

    def nodes(self) -> list[str]:
        return names_of(self.graph.nodes)

    def of(self, node: str, part: Registrations) -> tuple[str, ...]:
        """What a node has of one of the three parts of this state."""
        return next(names.get(node, ()) for whole, names in self._by_node if whole is part)

    def servers(self, action: str) -> tuple[str, ...]:
        """The nodes with everything that a server of that action has."""
        return tuple(names_of(self.graph.action(action).servers))

    @cached_property
    def _by_node(self) -> list[tuple[Registrations, Mapping[str, tuple[str, ...]]]]:
        """Each part the other way round: made once for all nodes, of which a large graph has many."""
        return [(part, _turned(part)) for part in (self.publishers, self.subscribers, self.services)]

    @cached_property
    def graph(self) -> Graph:
        """The graph as it is registered: nobody asked, nobody known to be connected."""
        published, subscribed, served = (names for _part, names in self._by_node)
        keys = {name: NodeKey(name) for name in sorted({*published, *subscribed, *served})}
        nodes = {
            key: Node(
                name,
                publications=published.get(name, ()),
                subscriptions=subscribed.get(name, ()),
                services=served.get(name, ()),
            )
            for name, key in keys.items()
        }

        def ends(part: Registrations, name: str) -> Keys:
            return tuple(keys[node] for node in part.get(name, ()))

        topics = {
            name: Topic(name, self.types.get(name, ""), ends(self.publishers, name), ends(self.subscribers, name))
            for name in sorted({*self.publishers, *self.subscribers})
        }
        services = {name: Service(name, ends(self.services, name)) for name in self.services}
        found = Graph(nodes, topics, services)
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

    `rates` has the publishers whose rate may be expected of them from now on, `latched` those that latch; `rate_error`
    says why a rate that was to be measured is not known.
    """

    name: str
    type: str = ""
    publishers: Keys = ()
    subscribers: Keys = ()
    connections: tuple[tuple[NodeKey, NodeKey], ...] = ()  # (publisher, subscriber), by the publishers' word
    rate: float | None = None
    rates: Mapping[NodeKey, float] = field(default_factory=dict)
    latched: Keys = ()
    rate_error: str = ""
    md5sum: str = ""
    definition: str | None = None

    def connects(self, publisher: str, subscriber: str) -> bool:
        return any((one.name, other.name) == (publisher, subscriber) for one, other in self.connections)


@dataclass(frozen=True)
class Service:
    """`connections`: how many its clients keep open; None where nobody asked for it, or it cannot be told."""

    name: str
    providers: Keys = ()
    probe: ServiceProbe | None = None
    connections: int | None = None

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
    """What every reader of a ROS graph is handed. JSON is made of it, and read, by `as_dict` and `from_dict` alone.

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
        own = {
            name: [key for key, _peer in topic.connections if key.name in nodes] for name, topic in self.topics.items()
        }
        topics = self.published_by(own).topics.items()
        return replace(self, topics={name: topic for name, topic in topics if topic.publishers})

    def published_by(self, publishers: Mapping[str, Iterable[NodeKey]]) -> Graph:
        """The graph in which some of its topics have these publishers alone, so that no others are listened to."""
        own = {name: tuple(dict.fromkeys(keys)) for name, keys in publishers.items() if name in self.topics}
        topics = {name: replace(self.topics[name], publishers=keys) for name, keys in own.items()}
        return replace(self, topics={**self.topics, **topics})

    # ---- what is found out later

    def answered(self, nodes: Iterable[Node]) -> Graph:
        """The graph with what these nodes say, each in the place of the one of its name that nobody had asked."""
        said = {node.key: node for node in nodes}
        moved = {NodeKey(key.name): key for key in said}

        def new(keys: Iterable[NodeKey]) -> Keys:
            return tuple(moved.get(key, key) for key in keys)

        def told(topic: Topic) -> Topic:
            if not any(key in moved for key in (*topic.publishers, *topic.subscribers)):
                return topic  # most of them, where few nodes of a large graph were asked
            edges = zip(new(key for key, _peer in topic.connections), new(peer for _key, peer in topic.connections))
            ends = new(topic.publishers), new(topic.subscribers)
            return replace(topic, publishers=ends[0], subscribers=ends[1], connections=tuple(edges))

        services = {name: replace(one, providers=new(one.providers)) for name, one in self.services.items()}
        actions = {
            name: replace(
                one,
                servers=new(one.servers),
                clients=new(one.clients),
                statuses=dict(zip(new(one.statuses), one.statuses.values())),
            )
            for name, one in self.actions.items()
        }
        topics = {name: told(topic) for name, topic in self.topics.items()}
        return Graph({**dict(zip(new(self.nodes), self.nodes.values())), **said}, topics, services, actions)

    def measured(
        self,
        rates: Mapping[str, Rate],
        handshakes: Mapping[str, Handshake] | None = None,
        connections: Mapping[str, int] | None = None,
    ) -> Graph:
        """The graph with rates and handshakes of topics, and the number of connections of services."""
        said, open_ = handshakes or {}, connections or {}
        topics = {name: _measured(topic, rates.get(name), said.get(name)) for name, topic in self.topics.items()}
        services = {name: replace(one, connections=open_.get(name)) for name, one in self.services.items()}
        return replace(self, topics=topics, services=services)

    # ---- JSON

    def as_dict(self, definitions: bool = False) -> Data:
        """The graph as JSON-able data, the shape that ros_graph_info returns. Nodes are called by their names alone."""
        return {
            "nodes": {name: _node_dict(self.node(name)) for name in self.names},
            "topics": {name: _topic_dict(topic, definitions) for name, topic in sorted(self.topics.items())},
            "services": {name: _service_dict(service) for name, service in sorted(self.services.items())},
            "actions": {name: _action_dict(action) for name, action in sorted(self.actions.items())},
        }

    @classmethod
    def from_dict(cls, data: Document) -> Graph:
        """What `as_dict` made, or somebody wrote by hand: what is missing is not known.

        AttributeError, KeyError, TypeError or ValueError where it is no graph.
        """
        nodes = {name: _node_of(name, one) for name, one in data.get("nodes", {}).items()}

        def key(name: str) -> NodeKey:
            return nodes[name].key if name in nodes else NodeKey(name)

        def keys(names: Iterable[str] | None) -> Keys:
            return tuple(key(name) for name in names or ())

        topics = {
            name: Topic(
                name,
                one.get("type") or "",
                keys(one.get("publishers")),
                keys(one.get("subscribers")),
                tuple((key(edge["publisher"]), key(edge["subscriber"])) for edge in one.get("connections") or ()),
                one.get("rate"),
                {key(node): hz for node, hz in (one.get("rates") or {}).items()},
                keys(one.get("latched")),
                one.get("rate_error") or "",
                one.get("md5sum") or "",
                one.get("definition"),
            )
            for name, one in data.get("topics", {}).items()
        }
        services = {
            name: Service(name, keys(one.get("providers")), _probe_of(one), one.get("connections"))
            for name, one in data.get("services", {}).items()
        }
        actions = {
            name: Action(
                name,
                one.get("type") or "",
                servers := keys(one.get("servers")),
                keys(one.get("clients")),
                _statuses_of(one, servers),
            )
            for name, one in data.get("actions", {}).items()
        }
        return cls({node.key: node for node in nodes.values()}, topics, services, actions)


def _measured(topic: Topic, rate: Rate | None, said: Handshake | None) -> Topic:
    by = sorted(rate.by.items()) if rate else []
    latched = {key for key, part in by if part.latched} | ({said.publisher} if said and said.latching else set())
    return replace(
        topic,
        rate=None if rate is None or rate.unknown else round(rate.hz, 3),
        rates={key: round(part.known, 3) for key, part in by if part.known is not None},
        latched=tuple(sorted(latched)),
        rate_error=rate.unknown if rate else "",
        md5sum=said.md5sum if said else "",
        definition=said.definition if said else None,
    )


def _node_dict(node: Node) -> Data:
    said = {"uri": node.uri, "pid": node.pid, "reachable": node.reachable, "error": node.error, "refused": node.refused}
    has = {"publications": node.publications, "subscriptions": node.subscriptions, "services": node.services}
    return {**said, **{part: list(names) for part, names in has.items()}}


def _node_of(name: str, data: Document) -> Node:
    uri, error, refused = data.get("uri") or "", data.get("error") or "", bool(data.get("refused"))
    pid = data.get("pid") if data.get("reachable", True) else None
    has = [tuple(data.get(part) or ()) for part in ("publications", "subscriptions", "services")]
    return Node(name, uri, pid, bool(uri or error), error, has[0], has[1], has[2], refused=refused)


def _topic_dict(topic: Topic, definitions: bool) -> Data:
    ends = {"publishers": topic.publishers, "subscribers": topic.subscribers, "latched": topic.latched}
    text = {"definition": topic.definition} if definitions and topic.definition is not None else {}
    return {
        "type": topic.type,
        "md5sum": topic.md5sum or None,
        **{role: names_of(keys) for role, keys in ends.items()},
        "connections": [{"publisher": key.name, "subscriber": peer.name} for key, peer in topic.connections],
        "rate": topic.rate,
        "rates": {key.name: hz for key, hz in topic.rates.items()},
        "rate_error": topic.rate_error,
        **text,
    }


def _service_dict(service: Service) -> Data:
    said = asdict(service.said)
    return {"providers": names_of(service.providers), **said, "up": service.up, "connections": service.connections}


def _probe_of(data: Document) -> ServiceProbe | None:
    parts = {part: data.get(part) or "" for part in ("uri", "provider", "type", "error", "md5sum")}
    return ServiceProbe(**parts) if data.get("up", bool(parts["uri"])) or parts["error"] else None


def _action_dict(action: Action) -> Data:
    states = [GOAL_STATES.get(state, str(state)) for listed in action.goals.values() for state in listed]
    return {
        "type": action.type,
        "servers": names_of(action.servers),
        "clients": names_of(action.clients),
        "up": action.up,
        "busy": action.busy,
        "goals": {state: states.count(state) for state in sorted(set(states))},
    }


def _statuses_of(data: Document, servers: Keys) -> dict[NodeKey, StatusReading]:
    """JSON does not say whose an action's goals are: they are the first server's."""
    numbers = {word: number for number, word in GOAL_STATES.items()}
    told = (data.get("goals") or {}).items()
    goals = tuple(numbers[word] if word in numbers else int(word) for word, count in told for _one in range(count))
    return {servers[0]: StatusReading((goals,))} if data.get("up") and servers else {}


# ---- what a look asks for


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
        tuple(state.graph.actions),
    )


def around(state: MasterState, nodes: Iterable[str]) -> Questions:
    """The questions for these nodes' part of the graph: themselves, their services, those they exchange messages with.

    And every action: one that was not asked must not look idle.
    """
    own = [name for name in dict.fromkeys(nodes) if state.graph.named(name)]
    asked = {name: frozenset({"bus"}) for name in own}
    for name in own:
        for topic in state.of(name, state.subscribers):
            asked.update(dict.fromkeys(state.publishers.get(topic, ()), frozenset({"bus"})))
    for name in own:
        for topic in state.of(name, state.publishers):
            for peer in state.subscribers.get(topic, ()):
                asked.setdefault(peer, frozenset())
    services = [service for name in own for service in state.of(name, state.services)]
    return Questions(asked, tuple(sorted(dict.fromkeys(services))), tuple(state.graph.actions))
