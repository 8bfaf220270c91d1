# SPDX-License-Identifier: GPL-3.0-or-later
"""Judge the own nodes' part of the graph: is it wholly connected, and does it give what its predecessor gave?

An app has one node, or all that its launch file starts: together they owe what the version before gave.

Pure. `wait` is the verdict for everything that time may mend; `fail` is kept for what this revision itself
contradicts.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Iterable, Mapping

from .._common.poll import FAIL, PASS, WAIT
from .._ros.backend import MasterState, Questions
from .._ros.checks import Check, check_node, check_rate, check_service, count, left, listed
from .._ros.conditions import TopicCondition
from .._ros.contract import Contract, Edge
from .._ros.graph import ANY_TYPE, PATIENCE, Graph, Handshake, Node, Rate, ServiceProbe, names_of
from .._ros.names import is_tool

# Every node logs there, at no rate, and rosout connects by itself whenever it comes: not worth keeping anybody waiting.
UNCOUNTED = frozenset({"/rosout"})


@dataclass(frozen=True)
class Wanted:
    """What the own nodes have to show. `contract`: None where no update is under way."""

    nodes: tuple[str, ...]
    contract: Contract | None = None
    min_rates: Mapping[str, float] = field(default_factory=dict)


def first_questions(state: MasterState, own: Iterable[str]) -> Questions:
    """The own nodes in full, their services, and what the publishers of their subscriptions are connected to.

    Not tools, which do not count: one that hangs would make every look as long as its time-out.
    """
    registered = [state.graph.node(node) for node in own]
    heard = (topic for has in registered for topic in has.subscriptions if topic not in UNCOUNTED)
    senders = (name for topic in heard for name in state.publishers.get(topic, ()) if not is_tool(name))
    whole = {has.name: frozenset({"bus", "types"}) for has in registered}
    services = tuple(name for has in registered for name in has.services)
    return Questions({**dict.fromkeys(senders, frozenset({"bus"})), **whole}, services)


@dataclass(frozen=True)
class Gap:
    """A connection that both ends are registered for and that is not there."""

    topic: str
    node: str  # the own one
    peer: str
    role: str  # what the peer is to the topic: "subscriber" or "publisher"

    @property
    def edge(self) -> Edge:
        """As a contract has it."""
        publisher, subscriber = (self.peer, self.node) if self.role == "publisher" else (self.node, self.peer)
        return publisher, self.topic, subscriber


def gaps(graph: Graph, own: Iterable[str]) -> list[Gap]:
    """What the own nodes are not connected to yet. Tools that somebody has open do not count.

    A subscription counts when its publisher says so: the subscriber itself says it before any handshake.
    """
    found = []
    for node in map(graph.node, own):
        for topic in node.publications:
            counted = [key for key in graph.topic(topic).subscribers if not is_tool(key.name)]
            told = graph.unreached(topic, node.key, counted)
            missing = counted if told is None else told
            found += [Gap(topic, node.name, key.name, "subscriber") for key in missing]
        for topic in node.subscriptions:
            for key in graph.topic(topic).publishers if topic not in UNCOUNTED else ():
                if not is_tool(key.name) and graph.unreached(topic, key, [node.key]) != []:
                    found.append(Gap(topic, node.name, key.name, "publisher"))
    return [gap for gap in found if gap.topic not in UNCOUNTED]


def forgiven(gap: Gap, graph: Graph, wanted: Wanted, seconds: float) -> str:
    """Why a connection that has been missing for so long need not be waited for; nothing where it has to be.

    `graph` has the peer as it was asked. A peer that lives and had the version before must have this one, too, however
    long ago the connection began to be missing: it is the peer itself that has to be gone.
    """
    away = left(graph, gap.topic, gap.peer, gap.role)
    if away:
        return away
    if wanted.contract and gap.edge not in wanted.contract.edges and seconds >= PATIENCE:
        return f"{gap.peer} was not connected to the version before, and is not to this one"
    return ""


def judge(graph: Graph, wanted: Wanted, forgiving: Mapping[Gap, str]) -> list[Check]:
    """All but rates and handshakes, which are read once all of this passes. `forgiving`: gaps that do not count."""
    nodes = [graph.node(name) for name in wanted.nodes]
    checks = [check_node(graph, node.name) for node in nodes]
    alive = [node for node in nodes if node.reachable]
    if not alive:
        return checks
    if wanted.contract:
        checks += _promised(graph, alive, wanted.contract)
    for own in alive:
        if own.connections is None:
            checks.append(Check("node", own.name, WAIT, "it does not tell its connections"))
        lacking: dict[tuple[str, str], list[Gap]] = {}
        for gap in gaps(graph, [own.name]):
            lacking.setdefault((gap.topic, gap.role), []).append(gap)
        checks += [_connected(graph, *one, forgiving) for one in lacking.items()]
        checks += [_served(graph, own, name) for name in own.services]
    return checks


def _promised(graph: Graph, own: list[Node], contract: Contract) -> list[Check]:
    typed = {**{topic: one.definition.type for topic, one in contract.topics.items()}, **contract.subscriptions}
    checks = [_type(node, topic, wanted or ANY_TYPE) for node in own for topic, wanted in typed.items()]
    return [*checks, _offered(graph, own, contract), *_together(graph, own, contract)]


def _type(own: Node, topic: str, wanted: str) -> Check:
    found = own.own_types.get(topic) or ANY_TYPE
    if ANY_TYPE in (wanted, found) or wanted == found:
        return Check("topic", topic, PASS, f"type {found}")
    return Check("topic", topic, FAIL, f"this version has the type {found}, the one before had {wanted}")


def _offered(graph: Graph, own: list[Node], contract: Contract) -> Check:
    """Everything that the version before had registered; what a node of it published, by that very node."""
    names = {node.name for node in own}
    published = {(name, node.name) for node in own for name in node.publications}
    subscribed = {name for node in own for name in node.subscriptions}
    served = {name for node in own for name in node.services}
    lacking = [f"does not start {name}" for name in contract.nodes if name not in names and len(contract.nodes) > 1]
    lacking += [
        f"does not publish {name}"
        for name, one in contract.topics.items()
        if not all((name, node) in published for node in one.publishers or names)
    ]
    # without a publisher nobody has a reason to subscribe who takes whatever there is
    wanted = [name for name in contract.subscriptions if graph.topic(name).publishers]
    lacking += [f"does not subscribe to {name}" for name in wanted if name not in subscribed]
    lacking += [f"does not offer the service {name}" for name in contract.services if name not in served]
    lacking += [
        f"does not serve the action {name}"
        for name in contract.actions
        if not names & {*names_of(graph.action(name).servers)}
    ]
    reason = "as the version before: " + "; ".join(lacking) if lacking else "offers what the version before did"
    return Check("node", own[0].name, WAIT if lacking else PASS, reason)


def _together(graph: Graph, own: list[Node], contract: Contract) -> Iterable[Check]:
    """What comes in the same step has to be there before the old version goes that it had: it may start later."""
    members, names = set(contract.members), {node.name for node in own}
    for publisher, topic, subscriber in contract.edges:
        ends = {publisher, subscriber}
        if ends & names and ends <= members and not graph.topic(topic).connects(publisher, subscriber):
            here, other = (publisher, subscriber) if publisher in names else (subscriber, publisher)
            yield Check("topic", topic, WAIT, f"{here} not connected to {other}, which is updated together with it")


def _connected(graph: Graph, end: tuple[str, str], lacking: list[Gap], forgiving: Mapping[Gap, str]) -> Check:
    """Of a topic, and of what the own node is not connected to there: its subscribers, or its publishers."""
    topic, role = end
    waiting = [gap for gap in lacking if not forgiving.get(gap)]
    if not waiting:
        return Check("topic", topic, PASS, f"passes, though {listed(forgiving[gap] for gap in lacking)}")
    missing, registered = listed(_told(graph, gap.peer) for gap in waiting), len(graph.topic(topic).subscribers)
    if role == "publisher":
        return Check("topic", topic, WAIT, f"not connected to its publishers: missing {missing}")
    reason = f"{registered - len(lacking)} of {count(registered, 'subscriber')} connected: missing {missing}"
    return Check("topic", topic, WAIT, reason)


def _told(graph: Graph, name: str) -> str:
    node = graph.node(name)
    return f"{name} ({node.error})" if node.asked and not node.reachable else name


def _served(graph: Graph, own: Node, name: str) -> Check:
    check = check_service(graph, name)
    said = graph.services[name].said if name in graph.services else ServiceProbe()
    if check.verdict == PASS and said.provider not in ("", own.name):
        return Check("service", name, WAIT, f"{said.provider} answers at {said.uri}, not {own.name}")
    return check


def check_sums(graph: Graph, contract: Contract | None, found: Mapping[str, Handshake]) -> list[Check]:
    """Types of one name may differ in their definition; clients and subscribers of the old one are then refused.

    A topic's that was recorded and cannot be read now has to be asked again. (A service answers all of it or nothing.)
    What was latched has to be so again: who subscribes later would wait for it in vain.
    """
    if not contract:
        return []
    sums = {name: said.md5sum for name, said in found.items()}
    sums.update({name: graph.services[name].said.md5sum for name in contract.services if name in graph.services})
    topics = {name: one.definition for name, one in contract.topics.items()}
    checks = []
    for kind, definitions in (("topic", topics), ("service", contract.services)):
        for name, definition in definitions.items():
            old, new = definition.md5sum or ANY_TYPE, sums.get(name, "")
            if kind == "topic" and old != ANY_TYPE and not new:
                checks.append(Check(kind, name, WAIT, "it does not tell the definition of its type"))
            elif ANY_TYPE not in (old, new or ANY_TYPE) and old != new:
                what = f"definition of {definition.type or 'its type'}"
                reason = f"this version's {what} has the md5sum {new}, the one before had {old}"
                checks.append(Check(kind, name, FAIL, reason))
    reason = "this version does not latch its messages, the one before did"
    for name, said in found.items():
        before = contract.topics[name]
        if before.publishers.get(said.publisher.name, before.first).latched and not said.latching:
            checks.append(Check("topic", name, FAIL, reason))
    return checks


def least_rates(own: Iterable[Node], wanted: Wanted) -> dict[tuple[str, str], float]:
    """Own topic and node -> messages per second that it has to carry; the higher of what is promised and recorded.

    What is promised of a topic that several of them publish is owed by all together: the node is empty then.
    """
    found: dict[tuple[str, str], float] = {}
    publishing: dict[str, list[str]] = {}
    for node in own:
        for topic in node.publications:
            publishing.setdefault(topic, []).append(node.name)
    for topic, nodes in publishing.items():
        promised = wanted.min_rates.get(topic, 0.0)
        found.update({(topic, node): _recorded(wanted.contract, topic, node) for node in nodes})
        whose = nodes[0] if len(nodes) == 1 else ""
        found[topic, whose] = max(promised, found.get((topic, whose), 0.0))
    return {key: hz for key, hz in found.items() if hz}


def _recorded(contract: Contract | None, topic: str, node: str) -> float:
    if contract is None or topic not in contract.topics:
        return 0.0
    there = contract.topics[topic]
    sent = (there.publishers or {node: there.first}).get(node)
    return sent.least_rate(contract.tolerance) if sent else 0.0


def check_rates(least: Mapping[tuple[str, str], float], rates: Mapping[str, Rate]) -> list[Check]:
    return [
        check_rate(TopicCondition(topic, min_rate=hz, publisher=node or None), rates.get(topic))
        for (topic, node), hz in least.items()
    ]
