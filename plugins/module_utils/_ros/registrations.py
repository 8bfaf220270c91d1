# SPDX-License-Identifier: GPL-3.0-or-later
"""What nodes had registered with the master, what it has now -> the calls that mend the difference. Pure.

A ROS 1 node registers once: a master that was restarted knows nobody, and a node that was killed stays registered for
ever (wiki: ROS/Master_API). Whoever mends that must never touch a registration that is right: an address that a newer
process of the same name registered is that one's, and a node that is only slow is not dead.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass, field, replace
from functools import partial
from typing import Callable, Iterable, Mapping, Sequence

from .._common.documents import Data, Document
from .backend import MasterState
from .graph import ANY_TYPE, Graph, Node

ALIVE = "alive"
DEAD = "dead"  # its address refuses connections or cannot be reached
UNKNOWN = "unknown"  # it is late, or its name does not resolve: no reason to think that it is gone

PUBLISHER, SERVICE, SUBSCRIBER = "publisher", "service", "subscriber"
# What a node has of each kind. Restored in this order: a subscriber is told of all publishers at once, because roscpp
# drops a connection to one that the list does not have.
KINDS = {PUBLISHER: "publications", SERVICE: "services", SUBSCRIBER: "subscriptions"}


@dataclass(frozen=True)
class Entry:
    """What one node has registered: topic -> type, service -> its rosrpc URI. `pid` None: not known."""

    uri: str
    pid: int | None = None
    publications: Mapping[str, str] = field(default_factory=dict)
    subscriptions: Mapping[str, str] = field(default_factory=dict)
    services: Mapping[str, str] = field(default_factory=dict)

    def as_dict(self) -> Data:
        return {**asdict(self), **{part: dict(sorted(getattr(self, part).items())) for part in KINDS.values()}}

    @property
    def empty(self) -> bool:
        return not any(map(self.part, KINDS))

    def part(self, kind: str) -> Mapping[str, str]:
        found: Mapping[str, str] = getattr(self, KINDS[kind])
        return found

    def only(self, stays: Callable[[str, str], bool]) -> Entry:
        """With what stays of it alone, by kind and name."""
        parts: Data = {
            part: {name: detail for name, detail in self.part(kind).items() if stays(kind, name)}
            for kind, part in KINDS.items()
        }
        return replace(self, **parts)


Snapshot = Mapping[str, Entry]  # node -> what it has registered


@dataclass(frozen=True)
class Liveness:
    """What a node said when it was asked. None in a field: it does not say, or was not asked."""

    verdict: str
    reason: str = ""
    pid: int | None = None
    publications: frozenset[str] | None = None
    subscriptions: frozenset[str] | None = None
    services: frozenset[str] = frozenset()  # those that answered their probe in its name


@dataclass(frozen=True)
class Call:
    """One registration to make or to take back."""

    kind: str
    node: str
    name: str
    detail: str  # the topic's type, the service's rosrpc URI
    uri: str  # the node's
    remove: bool = False

    @property
    def request(self) -> tuple[str, ...]:
        """Method and arguments; the caller id is the node's own name, as if it called itself."""
        method = f"{'unregister' if self.remove else 'register'}{self.kind.capitalize()}"
        if self.kind == SERVICE:
            return (method, self.node, self.name, self.detail) + (() if self.remove else (self.uri,))
        return (method, self.node, self.name) + ((self.uri,) if self.remove else (self.detail, self.uri))


# ---- data -> snapshot


def from_graph(graph: Graph) -> dict[str, Entry]:
    """The registrations in a graph; a node without an address has nothing that could be compared."""
    uris = {name: service.said.uri for name, service in graph.services.items()}
    return {node.name: _entry(graph, node, uris) for node in graph.nodes.values() if node.uri}


def from_master(state: MasterState, uris: Mapping[str, str], service_uris: Mapping[str, str]) -> dict[str, Entry]:
    """What the master has of the nodes with an address."""
    graph = state.graph
    return {name: _entry(graph, replace(graph.node(name), uri=uri), service_uris) for name, uri in uris.items()}


def _entry(graph: Graph, node: Node, uris: Mapping[str, str]) -> Entry:
    def types(names: Iterable[str]) -> dict[str, str]:
        return {name: graph.topic(name).type or ANY_TYPE for name in names}

    services = {name: uris[name] for name in node.services if uris.get(name)}
    return Entry(node.uri, node.pid, types(node.publications), types(node.subscriptions), services)


def from_dict(data: Document) -> Entry:
    """The reverse of Entry.as_dict()."""
    return Entry(data["uri"], data["pid"], data["publications"], data["subscriptions"], data["services"])


# ---- what is missing


def missing(wanted: Snapshot, present: Snapshot, take_services: bool = False) -> dict[str, Entry]:
    """The part of `wanted` that the master does not have; nodes with nothing missing are left out.

    A service has one provider. With `take_services` it is missing wherever it points elsewhere than wanted, else only
    where it points nowhere.
    """
    addresses = {service: uri for entry in present.values() for service, uri in entry.services.items()}

    def lacking(entry: Entry, there: Entry) -> Entry:
        def lacks(kind: str, name: str) -> bool:
            if kind == SERVICE:
                return addresses.get(name) != entry.services[name] if take_services else name not in addresses
            return there.uri != entry.uri or name not in there.part(kind)

        return entry.only(lacks)

    found = {node: lacking(entry, present.get(node, Entry(""))) for node, entry in wanted.items()}
    return {node: need for node, need in found.items() if not need.empty}


# ---- decisions


def alive(entry: Entry, answer: Liveness) -> str:
    """Nothing if it is this very process that answered; else why not."""
    if answer.verdict != ALIVE:
        return answer.reason or "it does not answer"
    if entry.pid is not None and answer.pid is not None and entry.pid != answer.pid:
        return f"another process answers at {entry.uri}: {answer.pid}, not {entry.pid}"
    return ""


def gone(entry: Entry, answer: Liveness) -> str:
    """Why this very process is gone for certain; nothing if it is there or may be."""
    return alive(entry, answer) if answer.verdict in (DEAD, ALIVE) else ""


def restore(need: Snapshot, present: Snapshot, answers: Mapping[str, Liveness], late: bool = False) -> tuple[Call, ...]:
    """Calls that register what is missing of nodes that live, and have it by their own word.

    Registering the old address of a name that a newer process has would make the master shut that one down.
    `late`: and all that is missing of nodes that may only be late, see `denied`; but no service that somebody else has:
    the master would take it from that one.
    """
    asked = {node: entry for node, entry in need.items() if present.get(node, entry).uri == entry.uri}
    living = {node: entry for node, entry in asked.items() if node in answers and not alive(entry, answers[node])}
    found = {node: entry.only(partial(_has, answers[node])) for node, entry in living.items()}
    if not late:
        return _ordered(found)
    served = {service for entry in (*found.values(), *present.values()) for service in entry.services}
    silent = {
        node: entry.only(lambda kind, name: kind != SERVICE or name not in served)
        for node, entry in asked.items()
        if node in answers and answers[node].verdict == UNKNOWN
    }
    return _ordered({**found, **silent})


def denied(present: Snapshot, answers: Mapping[str, Liveness]) -> tuple[Call, ...]:
    """Calls that take back topics that nodes that live do not have by their own word; a service may only be late."""

    def lies(answer: Liveness, kind: str, name: str) -> bool:
        return kind != SERVICE and not _has(answer, kind, name)

    living = {node: entry for node, entry in present.items() if not alive(entry, answers[node])}
    return _ordered({node: entry.only(partial(lies, answers[node])) for node, entry in living.items()}, remove=True)


def _has(answer: Liveness, kind: str, name: str) -> bool:
    """By a node's own word, or it does not say."""
    own = getattr(answer, KINDS[kind])
    return own is None or name in own


def remove(present: Snapshot, answers: Sequence[Mapping[str, Liveness]]) -> tuple[Call, ...]:
    """Calls that take back what nodes left behind that are gone in every one of the `answers`."""

    def is_gone(node: str) -> bool:
        return all(node in answer and gone(present[node], answer[node]) for answer in answers)

    return _ordered({node: entry for node, entry in present.items() if is_gone(node)}, remove=True)


def _ordered(entries: Snapshot, remove: bool = False) -> tuple[Call, ...]:
    return tuple(
        Call(kind, node, name, detail, entry.uri, remove)
        for kind in (reversed(KINDS) if remove else KINDS)
        for node, entry in sorted(entries.items())
        for name, detail in sorted(entry.part(kind).items())
    )
