# SPDX-License-Identifier: GPL-3.0-or-later
"""What nodes had registered with the master, what it has now -> the calls that mend the difference. Pure.

A ROS 1 node registers once: a master that was restarted knows nobody, and a node that was killed stays registered for
ever (wiki: ROS/Master_API). Whoever mends that must never touch a registration that is right: an address that a newer
process of the same name registered is that one's, and a node that is only slow is not dead.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass, field, replace
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

    def as_dict(self) -> dict[str, str]:
        return {"node": self.node, "kind": self.kind, "name": self.name}


@dataclass(frozen=True)
class Plan:
    """Calls in the order that they must be made in, and the nodes that were left alone, each with its reason."""

    calls: tuple[Call, ...] = ()
    skipped: Mapping[str, str] = field(default_factory=dict)


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
    found = {node: _lacking(entry, present.get(node), addresses, take_services) for node, entry in wanted.items()}
    return {node: need for node, need in found.items() if not need.empty}


def _lacking(entry: Entry, there: Entry | None, addresses: Mapping[str, str], take_services: bool) -> Entry:
    def lacks(kind: str, name: str) -> bool:
        if kind == SERVICE:
            return addresses.get(name) != entry.services[name] if take_services else name not in addresses
        return there is None or there.uri != entry.uri or name not in there.part(kind)

    return entry.only(lacks)


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


def restore(need: Snapshot, present: Snapshot, answers: Mapping[str, Liveness]) -> Plan:
    """Calls that register what is missing of nodes that live, and have it by their own word."""
    skipped: dict[str, str] = {}
    living: dict[str, Entry] = {}
    for node, entry in need.items():
        there = present.get(node)
        if there is not None and there.uri != entry.uri:
            # registering the old address would make the master shut the newer process down
            skipped[node] = f"its name is registered from {there.uri} now"
            continue
        answer = answers.get(node, Liveness(UNKNOWN, "it was not asked"))
        why = alive(entry, answer)
        if why:
            skipped[node] = why
            continue
        living[node], left = _own_word(entry, answer)
        if left:
            skipped[node] = f"it does not have them itself: {', '.join(left)}"
    return Plan(_ordered(living), skipped)


def _own_word(entry: Entry, answer: Liveness) -> tuple[Entry, list[str]]:
    """The part of an entry that the node confirms, and the names of the rest."""

    def has(kind: str, name: str) -> bool:
        own = getattr(answer, KINDS[kind])
        return own is None or name in own

    return entry.only(has), sorted({name for kind in KINDS for name in entry.part(kind) if not has(kind, name)})


def remove(present: Snapshot, answers: Sequence[Mapping[str, Liveness]]) -> Plan:
    """Calls that take back what nodes left behind that are gone in every one of the `answers`."""
    skipped: dict[str, str] = {}
    stale: dict[str, Entry] = {}
    for node, entry in present.items():
        asked = [answer[node] for answer in answers if node in answer]
        if len(asked) == len(answers) and all(gone(entry, answer) for answer in asked):
            stale[node] = entry
        else:
            last = asked[-1] if asked else Liveness(UNKNOWN, "it was not asked")
            skipped[node] = alive(entry, last) or "it answers"
    return Plan(_ordered(stale, remove=True), skipped)


def _ordered(entries: Snapshot, remove: bool = False) -> tuple[Call, ...]:
    return tuple(
        Call(kind, node, name, detail, entry.uri, remove)
        for kind in (reversed(KINDS) if remove else KINDS)
        for node, entry in sorted(entries.items())
        for name, detail in sorted(entry.part(kind).items())
    )


# ---- what becomes of it


def difference(present: Snapshot, calls: Iterable[Call]) -> Data:
    """The module's diff: the registrations that change, before and after."""
    before, after = ({node: _shown(entry) for node, entry in present.items()} for _copy in range(2))
    for call in calls:
        part = KINDS[call.kind]
        if call.remove:
            after[call.node][part].pop(call.name, None)
            continue
        if call.kind == SERVICE:  # one provider: the last one
            for entry in after.values():
                entry[part].pop(call.name, None)
        after.setdefault(call.node, _shown(Entry(call.uri)))[part][call.name] = call.detail
    after = {node: entry for node, entry in after.items() if any(entry[part] for part in KINDS.values())}
    changed = sorted(node for node in {*before, *after} if before.get(node) != after.get(node))
    return {
        "before": {node: before[node] for node in changed if node in before},
        "after": {node: after[node] for node in changed if node in after},
    }


def _shown(entry: Entry) -> Data:
    shown = entry.as_dict()
    del shown["pid"]  # the master does not know it
    return shown
