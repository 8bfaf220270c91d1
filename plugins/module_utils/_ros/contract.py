# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""The contract of an update: what an app is to the ROS graph before it, in the names that hold after it.

`record` takes it down from a graph as ros_graph_info returns it; `conditions` says it again as options of ros_ready.

Left out, because their absence afterwards is no loss:

* `/rosout`: every node publishes it, whoever logs does so at no rate, and rosout itself connects again by itself;
* the logger services of the client libraries: they are there whenever the node is;
* nodes that did not answer, and tools that somebody has open (rostopic, rqt, rviz and others with an anonymous name):
  they come and go by themselves;
* edges over a renamed private topic to a node that is not renamed along: it goes on asking for the old name.

Pure.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from fnmatch import fnmatchcase
from typing import Any, Dict, Iterable, Mapping, Sequence, Tuple

from .graph import ANY_TYPE
from .names import ANONYMOUS, KEEPER

Contract = Dict[str, Any]
Edge = Tuple[str, str, str]  # publisher, topic, subscriber

TOLERANCE = 0.1
STREAMED = ("min_rate", "latched")  # of a topic's conditions, those for which streams are opened

LOGGERS = ("/get_loggers", "/set_logger_level")
ACTION_TOPICS = ("goal", "cancel", "status", "feedback", "result")
_TOOL = re.compile(ANONYMOUS + r"\Z")
_TOOL_NAMES = ("rqt", "rosops_fleet", KEEPER)


def is_tool(node: str) -> bool:
    """A node that somebody has open to look at the graph, or that belongs to this collection."""
    return bool(_TOOL.search(node)) or node.rpartition("/")[2].startswith(_TOOL_NAMES)


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


def matches(name: str, patterns: Iterable[str]) -> bool:
    """Whether a graph name is one of these, or of a pattern of them: `*` stands for anything, slashes among it."""
    return any(fnmatchcase(name, pattern) for pattern in patterns)


def renamed(name: str, renames: Mapping[str, str]) -> str:
    """A graph name after the nodes' renaming: a node's own name, and what stands in its private namespace."""
    if name in renames:
        return renames[name]
    for old, new in renames.items():
        if name.startswith(f"{old}/"):
            return new + name[len(old) :]
    return name


def record(  # noqa: PLR0913 - the last four have defaults and go into the result as they are
    graph: Mapping[str, Any],
    nodes: Sequence[str],
    renames: Mapping[str, str] | None = None,
    revision: str = "",
    tolerance: float = TOLERANCE,
    intended: Intended = Intended(),  # noqa: B008 - it is frozen
) -> Contract:
    """What `nodes` (their names now) are to the graph, in the names that hold after the update.

    `renames` maps the nodes of everything that is updated together, so that edges between them keep both ends. A node
    that does not answer now leaves nothing to restore. A topic that none but nodes of the step use may change its
    definition with them: its type is not asked for, as they connect only if they agree. `members` are the step's nodes.
    """
    taken = _Recorder(graph, nodes, renames or {}, intended)
    own = [taken.new(name) for name in nodes]
    return {
        "revision": revision,
        "tolerance": tolerance,
        "node": own[0] if own else "",
        "nodes": [taken.new(name) for name in taken.alive],
        "members": sorted(new for old, new in taken.renames.items() if old not in taken.words),
        "topics": taken.topics(own[0] if own else ""),
        "subscriptions": taken.subscriptions(),
        "services": taken.services(),
        "actions": taken.actions(),
        "edges": sorted([taken.new(part) for part in edge] for edge in taken.edges()),
    }


def owed(contract: Mapping[str, Any], intended: Intended) -> Contract:
    """What an earlier contract still asks for, in its own names: all but what an update is meant to change.

    Of a node that is down now the graph shows nothing. What was proven of it is what it owes.
    """

    def stays(name: str) -> bool:
        return not (matches(name, intended.ignore) or matches(renamed(name, intended.renamed), intended.ignore))

    def least(topic: str, entry: Mapping[str, Any]) -> dict[str, Any]:
        hz = intended.rate(renamed(topic, intended.renamed))
        return {**entry, "least": hz} if hz is not None else dict(entry)

    def topic_of(name: str, entry: Mapping[str, Any]) -> dict[str, Any]:
        publishers = {node: least(name, seen) for node, seen in (entry.get("publishers") or {}).items()}
        return {**least(name, entry), **({"publishers": publishers} if publishers else {})}

    nodes = contract.get("nodes") or ()
    there = contract if not set(nodes) & set(intended.on_demand) else {"nodes": nodes}
    others = contract.get("others")
    return {
        **contract,
        "topics": {name: topic_of(name, one) for name, one in (there.get("topics") or {}).items() if stays(name)},
        **{
            key: {name: one for name, one in (there.get(key) or {}).items() if stays(name)}
            for key in ("subscriptions", "services")
        },
        "actions": [name for name in there.get("actions") or () if stays(name)],
        "edges": [edge for edge in there.get("edges") or () if stays(edge[1])],
        **({"others": owed(others, intended)} if others else {}),
    }


def rated(graph: Mapping[str, Any], nodes: Sequence[str], intended: Intended) -> set[str]:
    """Those of the nodes that publish something at a rate that `record` would take down."""
    taken = _Recorder(graph, nodes, {}, intended)
    topics = [entry for topic, entry in graph["topics"].items() if taken.counts(topic) and taken.has_rate(topic)]
    return {name for entry in topics for name in taken.own(entry["publishers"])}


class _Recorder:
    def __init__(
        self,
        graph: Mapping[str, Any],
        nodes: Sequence[str],
        renames: Mapping[str, str],
        intended: Intended,
    ) -> None:
        self.graph, self.renames, self.intended = graph, renames, intended
        self.names = {**intended.renamed, **renames}
        self.words = {*graph["topics"], *graph["services"]}
        self.alive = [name for name in nodes if self.answers(name)]
        self.action_topics = {f"{action}/{part}" for action in graph["actions"] for part in ACTION_TOPICS}

    def new(self, name: str) -> str:
        return renamed(name, self.names)

    def answers(self, node: str) -> bool:
        return bool(self.graph["nodes"].get(node, {}).get("reachable"))

    def counts(self, topic: str) -> bool:
        action = topic.rpartition("/")[0] if topic in self.action_topics else ""
        return topic != "/rosout" and not self.ignored(topic) and not self.ignored(action)

    def ignored(self, name: str) -> bool:
        """Under its old or its new name: who changes both writes one of them down."""
        return matches(name, self.intended.ignore) or matches(self.new(name), self.intended.ignore)

    def inside(self, topic: str) -> bool:
        """Whether the topic is the step's own business: several of its nodes use it, and nobody else does."""
        entry = self.graph["topics"][topic]
        ends = {name for name in self.peers([*entry["publishers"], *entry["subscribers"]]) if not is_tool(name)}
        return len(ends) > 1 and ends <= set(self.renames)

    def peers(self, names: Iterable[str]) -> list[str]:
        """Nodes on the other side of a topic that an update must not lose."""
        ours = [name for name in names if self.answers(name) and (name in self.alive or not is_tool(name))]
        return [name for name in ours if name not in self.intended.on_demand]

    def own(self, names: Iterable[str]) -> list[str]:
        return [name for name in names if name in self.alive and name not in self.intended.on_demand]

    def edges(self) -> list[Edge]:
        found = []
        for topic, entry in self.graph["topics"].items():
            for connection in entry["connections"] if self.counts(topic) else ():
                ends = (connection["publisher"], connection["subscriber"])
                there = len(self.peers(ends)) == 2 and self.own(ends)
                if there and all(self.follows(topic, end) for end in ends):
                    found.append((ends[0], topic, ends[1]))
        return found

    def topics(self, first: str) -> dict[str, Any]:
        found = {}
        for topic, entry in self.graph["topics"].items():
            publishers = {self.new(name): self.publisher(topic, entry, name) for name in self.own(entry["publishers"])}
            if publishers and self.counts(topic):
                of_first = publishers.get(first) or next(iter(publishers.values()))
                found[self.new(topic)] = {
                    **({"type": "", "md5sum": None} if self.inside(topic) else definition(entry)),
                    **of_first,
                    "publishers": publishers,
                }
        return found

    def reached(self, entry: Mapping[str, Any]) -> list[str]:
        """The subscribers that a living publisher is connected to."""
        edges = entry["connections"]
        return [edge["subscriber"] for edge in edges if self.answers(edge["publisher"])]

    def publisher(self, topic: str, entry: Mapping[str, Any], name: str) -> dict[str, Any]:
        rate, least = (entry.get("rates") or {}).get(name), self.intended.rate(self.new(topic))
        latched = {"latched": True} if name in entry.get("latched", ()) else {}
        return {
            "rate": rate if self.has_rate(topic) else None,
            **({} if least is None else {"least": least}),
            **latched,
        }

    def has_rate(self, topic: str) -> bool:
        """An action's topics carry what its goals make them carry; its server is judged by its status."""
        return topic not in self.action_topics

    def follows(self, topic: str, node: str) -> bool:
        """Whether a node goes on using the topic under the name that it will have."""
        return self.new(topic) == topic or node in self.renames

    def subscriptions(self) -> dict[str, Any]:
        """Those over which something came: who subscribes to whatever there is does so again when it is there."""
        return {
            self.new(topic): {"type": "" if self.inside(topic) else known(entry["type"])}
            for topic, entry in self.graph["topics"].items()
            if self.counts(topic) and self.own(self.reached(entry))
        }

    def services(self) -> dict[str, Any]:
        return {
            self.new(name): definition(entry)
            for name, entry in self.graph["services"].items()
            if entry["up"]
            and self.own([entry["provider"]] if entry["provider"] else entry["providers"])
            and not self.ignored(name)
            and not name.endswith(LOGGERS)
        }

    def actions(self) -> list[str]:
        return sorted(
            self.new(name)
            for name, entry in self.graph["actions"].items()
            if entry["up"] and self.own(entry["servers"]) and not self.ignored(name)
        )


def definition(entry: Mapping[str, Any]) -> dict[str, Any]:
    """What a topic or service carries: `{type, md5sum}`."""
    return {"type": known(entry["type"]), "md5sum": known(entry.get("md5sum")) or None}


def known(word: str | None) -> str:
    """A type or md5sum, or nothing where the graph does not know it or a node takes any."""
    return "" if word in (None, "", ANY_TYPE) else str(word)


def conditions(contract: Mapping[str, Any], tolerance: float | None = None, absent: Sequence[str] = ()) -> Contract:
    """The contract as options of ros_ready. `absent`: the nodes of the old revision.

    An edge's end that is not ours may leave by itself, which is not the update's fault.
    """
    share = contract["tolerance"] if tolerance is None else tolerance
    ours = {contract["node"], *contract["nodes"]}
    topics: list[Contract] = []
    for name, topic in contract["topics"].items():
        for publisher, seen in topic["publishers"].items():
            entry = {"name": name, "publisher": publisher}
            if topic["type"]:
                entry["type"] = topic["type"]
            least = least_rate_of(seen, share)
            if least:
                entry["min_rate"] = least
            if seen.get("latched"):
                entry["latched"] = True
            topics.append(entry)
    return {
        "nodes": list(contract["nodes"]),
        "topics": topics,
        "services": [{"name": name} for name in contract["services"]],
        "actions": [{"name": name, "state": "up"} for name in contract["actions"]],
        "edges": [_edge(edge, ours) for edge in contract["edges"]],
        "absent": list(absent),
    }


def unstreamed(topics: Iterable[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """Conditions on topics without those for which streams are opened."""
    return [{key: topic[key] for key in topic if key not in STREAMED} for topic in topics]


def least_rate_of(entry: Mapping[str, Any], tolerance: float) -> float:
    """Messages per second that a publisher has to give: as was said, else what it gave less the tolerance; 0: any."""
    if entry.get("least") is not None:
        return float(entry["least"])
    return max(round((entry["rate"] or 0.0) * (1 - tolerance), 3), 0.0)


def _edge(ends: Sequence[str], ours: set[str]) -> dict[str, str]:
    edge = dict(zip(("publisher", "topic", "subscriber"), ends))
    others = [end for end in ("publisher", "subscriber") if edge[end] not in ours]
    return {**edge, "peer": others[0]} if others else edge
