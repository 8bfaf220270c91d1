# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""A robot's graph as a file: who is there, what flows between them, how much of it, and no message. Pure.

Left out is what the contract of an update leaves out, too: tools that somebody has open, the keeper, /rosout, the
services of loggers, and nodes that do not answer. Of parameters it has names and types; a value where it is asked for.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass, field
from typing import Any, Iterable, Iterator, Mapping

from .._common.errors import SpecError
from .contract import LOGGERS, is_tool, known, renamed
from .graph import Graph, Handshake, Rate, ServiceProbe

KIND, VERSION = "rosops.fleet/recording", 1
LOG_TOPICS = ("/rosout", "/rosout_agg")
LOG_NODE = "/rosout"
# What roscore and roslaunch set by themselves in every graph.
OF_ROS = ("/rosdistro", "/rosversion", "/run_id", "/roslaunch")


@dataclass(frozen=True)
class App:
    """An app and its nodes, by names without revisions."""

    placement: str
    nodes: tuple[str, ...]


@dataclass(frozen=True)
class Sent:
    """What a publisher sends to those who listen. `rate`: messages per second; None where it was not to be known."""

    rate: float | None = None
    latched: bool = False


@dataclass(frozen=True)
class Topic:
    """`definition` is the text of its type. `edges`: (publisher, subscriber) that are connected."""

    type: str = ""
    md5sum: str = ""
    definition: str = ""
    publishers: Mapping[str, Sent] = field(default_factory=dict)
    subscribers: tuple[str, ...] = ()
    edges: tuple[tuple[str, str], ...] = ()


@dataclass(frozen=True)
class Service:
    provider: str
    type: str = ""
    md5sum: str = ""


@dataclass(frozen=True)
class Action:
    type: str = ""
    servers: tuple[str, ...] = ()
    clients: tuple[str, ...] = ()


@dataclass(frozen=True)
class Recording:
    """`others` are nodes of no app. `parameters`: name -> type; `values` of those that were asked for."""

    robot: str = ""
    apps: Mapping[str, App] = field(default_factory=dict)
    others: tuple[str, ...] = ()
    topics: Mapping[str, Topic] = field(default_factory=dict)
    services: Mapping[str, Service] = field(default_factory=dict)
    actions: Mapping[str, Action] = field(default_factory=dict)
    parameters: Mapping[str, str] = field(default_factory=dict)
    values: Mapping[str, Any] = field(default_factory=dict)

    def as_dict(self) -> dict[str, Any]:
        """As the file has it."""
        return {"kind": KIND, "version": VERSION, **asdict(self)}

    @classmethod
    def from_dict(cls, data: Any, where: str) -> Recording:
        """What `as_dict` made of it, or SpecError: `where` says what was read."""
        if not isinstance(data, Mapping) or data.get("kind") != KIND:
            raise SpecError(f"{where} is no recording of a robot's graph: rosops.fleet.record makes one")
        if data.get("version") != VERSION:
            raise SpecError(f"{where} is of version {data.get('version')}, not {VERSION}: record the robot again")
        try:
            return cls(
                str(data["robot"]),
                {name: App(one["placement"], tuple(one["nodes"])) for name, one in data["apps"].items()},
                tuple(data["others"]),
                {name: _topic(one) for name, one in data["topics"].items()},
                {name: Service(**one) for name, one in data["services"].items()},
                {name: _action(one) for name, one in data["actions"].items()},
                dict(data["parameters"]),
                dict(data["values"]),
            )
        except (AttributeError, KeyError, TypeError, ValueError) as error:
            told = f"{type(error).__name__}: {error}"
            raise SpecError(f"{where} is damaged ({told}): record the robot again") from error


def _topic(data: Mapping[str, Any]) -> Topic:
    publishers = {node: Sent(**sent) for node, sent in data["publishers"].items()}
    edges = tuple((publisher, subscriber) for publisher, subscriber in data["edges"])
    subscribers = tuple(data["subscribers"])
    return Topic(data["type"], data["md5sum"], data["definition"], publishers, subscribers, edges)


def _action(data: Mapping[str, Any]) -> Action:
    return Action(data["type"], tuple(data["servers"]), tuple(data["clients"]))


@dataclass(frozen=True)
class Findings:
    """All that was read of a graph. `owners`: node -> its app. `plain`: node -> its name without a revision."""

    graph: Graph
    handshakes: Mapping[tuple[str, str], Handshake] = field(default_factory=dict)  # by (topic, publisher)
    rates: Mapping[str, Rate] = field(default_factory=dict)
    parameters: Mapping[str, Any] = field(default_factory=dict)  # name -> value
    owners: Mapping[str, str] = field(default_factory=dict)
    plain: Mapping[str, str] = field(default_factory=dict)


def recorded(robot: str, found: Findings, placements: Mapping[str, str], values: Iterable[str]) -> Recording:
    """The recording of it, in names that hold for every version."""
    taken = _Recorder(found)
    nodes = sorted({(found.owners.get(name, ""), taken.new(name)) for name in taken.nodes})
    apps = sorted({app for app, _node in nodes if app})
    parameters = {taken.new(name): value for name, value in found.parameters.items() if not _below(name, OF_ROS)}
    return Recording(
        robot,
        {app: App(placements.get(app, "local"), tuple(node for own, node in nodes if own == app)) for app in apps},
        tuple(node for app, node in nodes if not app),
        dict(taken.topics()),
        dict(taken.services()),
        dict(taken.actions()),
        {name: type(value).__name__ for name, value in sorted(parameters.items())},
        {name: value for name, value in sorted(parameters.items()) if _below(name, values)},
    )


def flat(tree: Any, name: str = "") -> Iterator[tuple[str, Any]]:
    """The parameter server's tree as (whole name, value)."""
    if isinstance(tree, Mapping):
        for key in sorted(tree):
            yield from flat(tree[key], f"{name}/{key}")
    else:
        yield name, tree


def _below(name: str, names: Iterable[str]) -> bool:
    return any(name == one or name.startswith(f"{one.rstrip('/')}/") for one in names)


class _Recorder:
    def __init__(self, found: Findings) -> None:
        self.found = found
        every = found.graph.nodes.values()
        self.nodes = [
            node.name for node in every if node.reachable and node.name != LOG_NODE and not is_tool(node.name)
        ]
        self.there = frozenset(self.nodes)

    def new(self, name: str) -> str:
        return renamed(name, self.found.plain)

    def here(self, names: Iterable[str]) -> list[str]:
        return [name for name in names if name in self.there]

    def topics(self) -> Iterator[tuple[str, Topic]]:
        for name, topic in sorted(self.found.graph.topics.items()):
            publishers, subscribers = self.here(topic.publishers), self.here(topic.subscribers)
            if name in LOG_TOPICS or not (publishers or subscribers):
                continue
            said = [hand for node in publishers if (hand := self.found.handshakes.get((name, node)))]
            first = said[0] if said else Handshake("")
            edges = {(self.new(one), self.new(two)) for one, two in topic.connections if {one, two} <= self.there}
            yield (
                self.new(name),
                Topic(
                    known(topic.type),
                    known(first.md5sum),
                    first.definition,
                    {self.new(node): self.sent(name, node) for node in sorted(publishers)},
                    tuple(sorted({self.new(node) for node in subscribers})),
                    tuple(sorted(edges)),
                ),
            )

    def sent(self, topic: str, node: str) -> Sent:
        rate = self.found.rates.get(topic, Rate()).by.get(node)
        said = self.found.handshakes.get((topic, node), Handshake(node))
        return Sent(None if rate is None or rate.error else round(rate.hz, 3), said.latching)

    def services(self) -> Iterator[tuple[str, Service]]:
        for name, service in sorted(self.found.graph.services.items()):
            probe = service.probe or ServiceProbe(error="it was not asked")
            provider = probe.provider or next(iter(service.providers), "")
            if not probe.error and provider in self.there and not name.endswith(LOGGERS):
                yield self.new(name), Service(self.new(provider), known(probe.type), known(probe.md5sum))

    def actions(self) -> Iterator[tuple[str, Action]]:
        for name, action in sorted(self.found.graph.actions.items()):
            servers, clients = (
                tuple(sorted({self.new(node) for node in self.here(names)}))
                for names in (action.servers, action.clients)
            )
            if servers:
                yield self.new(name), Action(action.type, servers, clients)
