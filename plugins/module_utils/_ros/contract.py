# SPDX-License-Identifier: GPL-3.0-or-later
"""The contract of an update: what an app is to the ROS graph before it, in the names that hold after it. Pure.

`record` takes it down from a graph; `conditions` says it again as options of ros_ready. `Contract.as_dict` is what lies
in the cluster, where pods and keepers of other versions of the collection read it, too.

Left out, because their absence afterwards is no loss:

* `/rosout`: every node publishes it, whoever logs does so at no rate, and rosout itself connects again by itself;
* the logger services of the client libraries: they are there whenever the node is;
* nodes that did not answer, and tools that somebody has open (rostopic, rqt, rviz and others with an anonymous name):
  they come and go by themselves;
* edges over a renamed private topic to a node that is not renamed along: it goes on asking for the old name.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Callable, Iterable, Mapping, Sequence, Tuple, TypeVar

from .._common.documents import Data, Document
from .arrivals import DENSE, LEAST_SHARE
from .graph import ANY_TYPE, Graph, NodeKey, Topic, names_of
from .names import by_revision, is_tool, matches, renamed

Edge = Tuple[str, str, str]  # publisher, topic, subscriber
_Any = TypeVar("_Any")

TOLERANCE = 0.1
STREAMED = ("min_rate", "latched")  # of a topic's conditions, those for which streams are opened

LOGGERS = ("/get_loggers", "/set_logger_level")
ACTION_TOPICS = ("goal", "cancel", "status", "feedback", "result")


@dataclass(frozen=True)
class Intended:
    """What an update is meant to change; every name in full, and patterns (`/debug/*`) where nothing is renamed.

    `ignore`: topics, services and actions that may go, come or be of another type. `renamed`: old name -> new name of
    a topic, a service, an action or of all below it. `rates`: the name that a topic has afterwards -> messages per
    second that it has to carry then, whatever it carried; 0: any. `on_demand`: nodes, as they are called now, that have
    on the graph what their clients ask for (rosbridge): it comes back with the clients. `keeps`: what the nodes latched
    outlives them.
    """

    ignore: tuple[str, ...] = ()
    renamed: Mapping[str, str] = field(default_factory=dict)
    rates: Mapping[str, float] = field(default_factory=dict)
    on_demand: tuple[str, ...] = ()
    keeps: bool = False

    def rate(self, topic: str) -> float | None:
        """What is said of the topic; None: nothing."""
        return next((hz for pattern, hz in self.rates.items() if matches(topic, [pattern])), None)


# ---- what is owed


@dataclass(frozen=True)
class Sent:
    """What a publisher gave: messages per second, None where nobody could tell; and whether it latched.

    `least`: messages per second that it has to give by the inventory's word, whatever it gave.
    """

    rate: float | None = None
    least: float | None = None
    latched: bool = False

    def least_rate(self, tolerance: float) -> float:
        """Messages per second that its next version has to give: as was said, else less the tolerance; 0: any."""
        if self.least is not None:
            return float(self.least)
        return max(round((self.rate or 0.0) * (1 - tolerance), 3), 0.0)

    def as_dict(self) -> Data:
        least = {} if self.least is None else {"least": self.least}
        return {"rate": self.rate, **least, **({"latched": True} if self.latched else {})}

    @classmethod
    def from_dict(cls, data: Document) -> Sent:
        return cls(data.get("rate"), data.get("least"), bool(data.get("latched")))


@dataclass(frozen=True)
class Definition:
    """What a topic or a service carries; empty: anything."""

    type: str = ""
    md5sum: str = ""

    def as_dict(self) -> Data:
        return {"type": self.type, "md5sum": self.md5sum or None}

    @classmethod
    def from_dict(cls, data: Document) -> Definition:
        return cls(data.get("type") or "", data.get("md5sum") or "")


@dataclass(frozen=True)
class Published:
    """A topic, and what each of the app's nodes sent on it."""

    definition: Definition = field(default_factory=Definition)
    publishers: Mapping[str, Sent] = field(default_factory=dict)

    def as_dict(self) -> Data:
        publishers = {node: sent.as_dict() for node, sent in self.publishers.items()}
        return {**self.definition.as_dict(), "publishers": publishers}

    @classmethod
    def from_dict(cls, data: Document) -> Published:
        publishers = {node: Sent.from_dict(one) for node, one in (data.get("publishers") or {}).items()}
        return cls(Definition.from_dict(data), publishers)


@dataclass(frozen=True)
class Contract:
    """What the nodes of an app are to the graph, under the names that they will have.

    `node` is the first of them, whether it was there or not, `nodes` those that were, `members` all that the step gives
    new names. `subscriptions`: topic -> type. `others`: what those nodes owe on which the pod's own probe has no word.
    `tolerance`: the share by which rates may fall. `install`: of an installation, before which there was nothing.
    """

    node: str = ""
    nodes: tuple[str, ...] = ()
    members: tuple[str, ...] = ()
    topics: Mapping[str, Published] = field(default_factory=dict)
    subscriptions: Mapping[str, str] = field(default_factory=dict)
    services: Mapping[str, Definition] = field(default_factory=dict)
    actions: tuple[str, ...] = ()
    edges: tuple[Edge, ...] = ()
    others: Contract | None = None
    revision: str = ""
    tolerance: float = TOLERANCE
    install: bool = False

    @property
    def parts(self) -> tuple[Contract, ...]:
        """Itself, and that of the other nodes."""
        return (self, *((self.others,) if self.others else ()))

    @property
    def all_nodes(self) -> list[str]:
        return [node for part in self.parts for node in part.nodes]

    def renamed(self, renames: Mapping[str, str]) -> Contract:
        """Every graph name in it after the nodes' renaming."""
        return self.called(lambda name: renamed(name, renames))

    def called(self, new: Callable[[str], str]) -> Contract:
        """With another name for each in it."""

        def keyed(found: Mapping[str, _Any]) -> dict[str, _Any]:
            return {new(name): one for name, one in found.items()}

        topics = {name: replace(one, publishers=keyed(one.publishers)) for name, one in self.topics.items()}
        return replace(
            self,
            node=new(self.node),
            nodes=tuple(map(new, self.nodes)),
            members=tuple(map(new, self.members)),
            topics=keyed(topics),
            subscriptions=keyed(self.subscriptions),
            services=keyed(self.services),
            actions=tuple(map(new, self.actions)),
            edges=tuple((new(one), new(topic), new(other)) for one, topic, other in self.edges),
            others=self.others.called(new) if self.others else None,
        )

    def owed(self, intended: Intended) -> Contract:
        """What an earlier contract still asks for, in its own names: all but what an update is meant to change.

        Of a node that is down now the graph shows nothing. What was proven of it is what it owes.
        """
        on_demand = set(self.nodes) & set(intended.on_demand)
        there = replace(self, topics={}, subscriptions={}, services={}, actions=(), edges=()) if on_demand else self
        others = self.others.owed(intended) if self.others else None
        return replace(there.meant(intended, intended.renamed, self.actions), others=others)

    def meant(self, intended: Intended, renames: Mapping[str, str], actions: Iterable[str]) -> Contract:
        """All of it but what an update is meant to change, under its old or its new name: who changes both writes one
        of them down. `actions`: those whose topics go with them.
        """
        action_of = {f"{action}/{part}": action for action in actions for part in ACTION_TOPICS}

        def stays(name: str) -> bool:
            names = {name, action_of.get(name, name)}
            return not any(matches(one, intended.ignore) for one in names | {renamed(one, renames) for one in names})

        def asked(name: str, one: Published) -> Published:
            hz = intended.rate(renamed(name, renames))
            publishers = {node: replace(sent, least=hz) for node, sent in one.publishers.items()}
            return one if hz is None else replace(one, publishers=publishers)

        return replace(
            self,
            topics={name: asked(name, one) for name, one in self.topics.items() if stays(name)},
            subscriptions={name: one for name, one in self.subscriptions.items() if stays(name)},
            services={name: one for name, one in self.services.items() if stays(name)},
            actions=tuple(filter(stays, self.actions)),
            edges=tuple(edge for edge in self.edges if stays(edge[1])),
        )

    def as_dict(self) -> Data:
        """As JSON has it; keepers and pods of the version before read it, too."""
        return {
            "revision": self.revision,
            "tolerance": self.tolerance,
            "node": self.node,
            "nodes": list(self.nodes),
            "members": list(self.members),
            "topics": {name: one.as_dict() for name, one in self.topics.items()},
            "subscriptions": {name: {"type": type_} for name, type_ in self.subscriptions.items()},
            "services": {name: one.as_dict() for name, one in self.services.items()},
            "actions": list(self.actions),
            "edges": [list(edge) for edge in self.edges],
            **({"others": self.others.as_dict()} if self.others else {}),
            **({"install": True} if self.install else {}),
        }

    @classmethod
    def from_dict(cls, data: Document) -> Contract:
        """What is missing is not owed. AttributeError, TypeError or ValueError where it is no contract.

        Whatever pod's names it was written with, they are those of revisions: others of the same may have come since.
        """
        return cls._from_dict(data).called(by_revision)

    @classmethod
    def _from_dict(cls, data: Document) -> Contract:
        return cls(
            data.get("node") or "",
            tuple(data.get("nodes") or ()),
            tuple(data.get("members") or ()),
            {name: Published.from_dict(one) for name, one in (data.get("topics") or {}).items()},
            {name: one.get("type") or "" for name, one in (data.get("subscriptions") or {}).items()},
            {name: Definition.from_dict(one) for name, one in (data.get("services") or {}).items()},
            tuple(data.get("actions") or ()),
            tuple((one, topic, other) for one, topic, other in data.get("edges") or ()),
            cls._from_dict(data["others"]) if data.get("others") else None,
            str(data.get("revision") or ""),
            data.get("tolerance", TOLERANCE),
            bool(data.get("install")),
        )


NOTHING = Contract()


# ---- recording


def record(
    graph: Graph,
    nodes: Sequence[str],
    renames: Mapping[str, str] | None = None,
    intended: Intended = Intended(),  # noqa: B008 - it is frozen
) -> Contract:
    """What `nodes` (their names now) are to the graph, in the names that hold after the update.

    `renames` maps the nodes of everything that is updated together, so that edges between them keep both ends. A node
    that does not answer now leaves nothing to restore. A topic that none but nodes of the step use may change its
    definition with them: its type is not asked for, as they connect only if they agree.
    """
    taken = _Recorder(graph, nodes, renames or {}, intended)
    found = taken.contract().renamed(taken.names)
    parts: Data = {part: tuple(sorted({*getattr(found, part)})) for part in ("members", "actions", "edges")}
    return replace(found, **parts)


def _streams(graph: Graph, nodes: Sequence[str], intended: Intended) -> dict[str, Published]:
    """What the nodes publish of which `record` takes down a rate: topics of actions have none of their own."""
    taken = _Recorder(graph, nodes, {}, intended)
    return {name: topic for name, topic in taken.contract().topics.items() if name not in taken.of_actions}


def rated(graph: Graph, nodes: Sequence[str], intended: Intended) -> set[str]:
    """Those of the nodes that publish something at a rate that `record` would take down."""
    return {node for topic in _streams(graph, nodes, intended).values() for node in topic.publishers}


def untold(graph: Graph, nodes: Sequence[str], intended: Intended) -> dict[str, str]:
    """Those of the nodes that send very many messages at no rate that anybody could tell -> what they send, in words.

    So many have a rate. A machine that stood still while they were counted hides it, and a next version that sends
    hardly any would be held to nothing.
    """
    found: dict[str, str] = {}
    for name, topic in _streams(graph, nodes, intended).items():
        for node, sent in topic.publishers.items():
            hz = graph.topic(name).unsteady.get(graph.node(node).key, 0.0)
            if hz >= DENSE and sent.rate is None and sent.least is None:
                found[node] = f"{node} sends {hz:.0f} messages a second on {name}, too unevenly to tell its rate"
    return found


def as_before(graph: Graph, nodes: Sequence[str], earlier: Contract) -> Graph:
    """The graph with the rates of an earlier contract, where nodes send about as much, but too unevenly to tell it."""
    topics = {}
    for name, topic in graph.topics.items():
        known = next((part.topics[name] for part in earlier.parts if name in part.topics), Published())
        sent = {key: hz for key, hz in topic.unsteady.items() if key.name in nodes}
        first = next(iter(known.publishers.values()), Sent())  # for a node that was called otherwise
        owed = {key: known.publishers.get(key.name, first).rate or 0.0 for key in sent}
        rates = {key: min(owed[key], hz) for key, hz in sent.items() if owed[key] and hz >= LEAST_SHARE * owed[key]}
        topics[name] = replace(topic, rates={**topic.rates, **rates}) if rates else topic
    return replace(graph, topics=topics)


class _Recorder:
    """What nodes are to the graph, in the names that hold now."""

    def __init__(self, graph: Graph, nodes: Sequence[str], renames: Mapping[str, str], intended: Intended) -> None:
        self.graph, self.nodes, self.renames, self.intended = graph, nodes, renames, intended
        self.names = {**intended.renamed, **renames}
        self.alive = [name for name in nodes if graph.node(name).reachable]
        self.of_actions = {f"{action}/{part}" for action in graph.actions for part in ACTION_TOPICS}
        self.counted = {name: topic for name, topic in graph.topics.items() if name != "/rosout"}

    def contract(self) -> Contract:
        """Without what the update is meant to change."""
        names = {*self.graph.topics, *self.graph.services}
        found = Contract(
            self.nodes[0] if self.nodes else "",
            tuple(self.alive),
            tuple(old for old in self.renames if old not in names),
            self.topics(),
            self.subscriptions(),
            self.services(),
            tuple(name for name, one in self.graph.actions.items() if one.up and self.own(one.servers)),
            tuple(self.edges()),
        )
        return found.meant(self.intended, self.names, self.graph.actions)

    def inside(self, topic: Topic) -> bool:
        """Whether the topic is the step's own business: several of its nodes use it, and nobody else does."""
        peers = self.peers((*topic.publishers, *topic.subscribers))
        ends = {key.name for key in peers if not is_tool(key.name)}
        return len(ends) > 1 and ends <= set(self.renames)

    def peers(self, keys: Iterable[NodeKey]) -> list[NodeKey]:
        """Nodes on the other side of a topic that an update must not lose."""
        ours = [key for key in keys if self.graph.at(key).reachable]
        ours = [key for key in ours if key.name in self.alive or not is_tool(key.name)]
        return [key for key in ours if key.name not in self.intended.on_demand]

    def own(self, keys: Iterable[NodeKey]) -> list[NodeKey]:
        return [key for key in keys if key.name in self.alive and key.name not in self.intended.on_demand]

    def edges(self) -> list[Edge]:
        return [
            (ends[0].name, name, ends[1].name)
            for name, topic in self.counted.items()
            for ends in topic.connections
            if len(self.peers(ends)) == 2 and self.own(ends) and all(self.follows(name, end.name) for end in ends)
        ]

    def follows(self, topic: str, node: str) -> bool:
        """Whether a node goes on using the topic under the name that it will have."""
        return renamed(topic, self.names) == topic or node in self.renames

    def topics(self) -> dict[str, Published]:
        found = {}
        for name, topic in self.counted.items():
            # of two pods of a revision the one counts of which a rate is known
            own = sorted(self.own(topic.publishers), key=lambda key: key in topic.rates)
            publishers = {key.name: self.sent(topic, key) for key in own}
            if publishers:
                carried = Definition() if self.inside(topic) else Definition(known(topic.type), known(topic.md5sum))
                found[name] = Published(carried, publishers)
        return found

    def sent(self, topic: Topic, key: NodeKey) -> Sent:
        """An action's topics carry what its goals make them carry; its server is judged by its status."""
        rate = None if topic.name in self.of_actions else topic.rates.get(key)
        return Sent(rate, latched=key.name in names_of(topic.latched))

    def subscriptions(self) -> dict[str, str]:
        """Those over which something came: who subscribes to whatever there is does so again when it is there."""
        return {
            name: "" if self.inside(topic) else known(topic.type)
            for name, topic in self.counted.items()
            if self.own(peer for key, peer in topic.connections if self.graph.at(key).reachable)
        }

    def services(self) -> dict[str, Definition]:
        found = {}
        for name, service in self.graph.services.items():
            said = service.said
            providers = [self.graph.node(said.provider).key] if said.provider else service.providers
            if service.up and self.own(providers) and not name.endswith(LOGGERS):
                found[name] = Definition(known(said.type), known(said.md5sum))
        return found


def known(word: str) -> str:
    """A type or md5sum, or nothing where the graph does not know it or a node takes any."""
    return "" if word == ANY_TYPE else word


# ---- what is asked for afterwards


def conditions(contract: Contract, tolerance: float | None = None) -> Data:
    """The contract as options of ros_ready.

    An edge's end that is not ours may leave by itself, which is not the update's fault.
    """
    share = contract.tolerance if tolerance is None else tolerance
    ours = {contract.node, *contract.nodes}
    topics: list[Data] = []
    for name, topic in contract.topics.items():
        for publisher, sent in topic.publishers.items():
            least = sent.least_rate(share)
            given = {"type": topic.definition.type, "min_rate": least, "latched": sent.latched}
            topics.append({"name": name, "publisher": publisher, **{key: one for key, one in given.items() if one}})
    edges = [dict(zip(("publisher", "topic", "subscriber"), edge)) for edge in contract.edges]
    for edge in edges:
        edge.update(("peer", end) for end in ("subscriber", "publisher") if edge[end] not in ours)
    return {
        "nodes": list(contract.nodes),
        "topics": topics,
        "services": [{"name": name} for name in contract.services],
        "actions": [{"name": name, "state": "up"} for name in contract.actions],
        "edges": edges,
    }


def unstreamed(conditions: Data) -> Data:
    """These conditions without those of topics for which streams are opened."""
    topics = [{key: topic[key] for key in topic if key not in STREAMED} for topic in conditions["topics"]]
    return {**conditions, "topics": topics}
