# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Judge the own node's part of the graph: is it wholly connected, and does it give what its predecessor gave?

Pure. `wait` is the verdict for everything that time may mend; `fail` is kept for what this revision itself
contradicts.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, Iterable, Mapping

from .._common.poll import FAIL, PASS, WAIT
from .._ros.checks import Check, check_node, check_rate, check_service, count, listed
from .._ros.conditions import TopicCondition
from .._ros.contract import is_tool
from .._ros.graph import ANY_TYPE, Graph, MasterState, Node, Questions, Rate, action_of

# Every node logs there, at no rate, and rosout connects by itself whenever it comes: not worth keeping anybody waiting.
UNCOUNTED = frozenset({"/rosout"})


@dataclass(frozen=True)
class Wanted:
    """What the own node has to show. `contract`: None where no update is under way."""

    node: str
    contract: Mapping[str, Any] | None = None
    min_rates: Mapping[str, float] = field(default_factory=dict)


def first_questions(state: MasterState, node: str) -> Questions:
    """The own node in full, its services, and what the publishers of its subscriptions are connected to."""
    nodes = {node: frozenset({"bus", "types"})}
    for topic in state.of(node, state.subscribers):
        for publisher in state.publishers.get(topic, ()) if topic not in UNCOUNTED else ():
            nodes.setdefault(publisher, frozenset({"bus"}))
    return Questions(nodes, state.of(node, state.services))


def missing_subscribers(state: MasterState, graph: Graph, node: str) -> dict[str, list[str]]:
    """Own topic -> registered subscribers that are no end of it yet. Tools that somebody has open do not count."""
    found = {}
    for topic in state.of(node, state.publishers):
        counted = [name for name in state.subscribers.get(topic, ()) if not is_tool(name)]
        missing = graph.unreached(topic, node, counted)
        lacking = counted if missing is None else missing
        if lacking and topic not in UNCOUNTED:
            found[topic] = lacking
    return found


def judge(graph: Graph, state: MasterState, wanted: Wanted, peers: Mapping[str, Node]) -> list[Check]:
    """All but rates and md5sums, which are read once all of this passes. `peers`: the missing subscribers, as asked."""
    own = graph.nodes[wanted.node]
    if not own.reachable:
        return [check_node(graph, wanted.node)]
    checks = [_type(own, topic, entry) for topic, entry in _typed(wanted.contract)]
    checks += [_offered(own, wanted.contract, state)] if wanted.contract else []
    if own.connections is None:
        checks.append(Check("node", own.name, WAIT, "it does not tell its connections"))
    for topic, lacking in missing_subscribers(state, graph, own.name).items():
        checks.append(_reached(topic, lacking, peers, len(state.subscribers[topic])))
    for topic in own.subscriptions:
        if topic not in UNCOUNTED:
            checks.append(_heard(graph, own, topic, state.publishers.get(topic, ())))
    checks += [_served(graph, own, name) for name in own.services]
    return [check_node(graph, own.name), *checks]


def _typed(contract: Mapping[str, Any] | None) -> Iterable[tuple[str, Mapping[str, Any]]]:
    return {**contract["topics"], **contract["subscriptions"]}.items() if contract else ()


def _type(own: Node, topic: str, entry: Mapping[str, Any]) -> Check:
    wanted, found = entry.get("type") or ANY_TYPE, own.own_types.get(topic) or ANY_TYPE
    if ANY_TYPE in (wanted, found) or wanted == found:
        return Check("topic", topic, PASS, f"type {found}")
    return Check("topic", topic, FAIL, f"this version has the type {found}, the one before had {wanted}")


def _offered(own: Node, contract: Mapping[str, Any], state: MasterState) -> Check:
    """Everything that the version before had registered."""
    lacking = [
        *(f"does not publish {name}" for name in contract["topics"] if name not in own.publications),
        *(f"does not subscribe to {name}" for name in contract["subscriptions"] if name not in own.subscriptions),
        *(f"does not offer the service {name}" for name in contract["services"] if name not in own.services),
        *(
            f"does not serve the action {name}"
            for name in contract["actions"]
            if own.name not in action_of(state, name).servers
        ),
    ]
    reason = "as the version before: " + "; ".join(lacking) if lacking else "offers what the version before did"
    return Check("node", own.name, WAIT if lacking else PASS, reason)


def _reached(topic: str, lacking: list[str], peers: Mapping[str, Node], registered: int) -> Check:
    """A subscriber whose port refuses is dead; its registration alone must not keep a new version from coming."""
    waiting = [name for name in lacking if not (name in peers and peers[name].refused)]
    if not waiting:
        return Check("topic", topic, PASS, f"registered, but dead: {listed(lacking)}")
    told = [name if name not in peers or peers[name].reachable else f"{name} ({peers[name].error})" for name in waiting]
    reason = f"{registered - len(lacking)} of {count(registered, 'subscriber')} connected: missing {listed(told)}"
    return Check("topic", topic, WAIT, reason)


def _heard(graph: Graph, own: Node, topic: str, publishers: Iterable[str]) -> Check:
    """A subscription counts when its publishers say so: the subscriber itself says it before any handshake."""
    missing = []
    for name in publishers:
        node = graph.nodes[name]
        if node.refused or is_tool(name):
            continue
        unreached = graph.unreached(topic, name, [own.name])
        if unreached is None:
            missing.append(f"{name} ({node.error or 'it does not tell its connections'})")
        elif unreached:
            missing.append(name)
    if missing:
        return Check("topic", topic, WAIT, f"not connected to its publishers: missing {listed(missing)}")
    return Check("topic", topic, PASS, "connected to its publishers")


def _served(graph: Graph, own: Node, name: str) -> Check:
    check = check_service(graph, name)
    probe = graph.services[name].probe if name in graph.services else None
    if check.verdict == PASS and probe is not None and probe.provider not in ("", own.name):
        return Check("service", name, WAIT, f"{probe.provider} answers at {probe.uri}, not {own.name}")
    return check


def check_sums(graph: Graph, contract: Mapping[str, Any] | None, found: Mapping[str, str]) -> list[Check]:
    """Types of one name may differ in their definition; clients and subscribers of the old one are then refused."""
    if not contract:
        return []
    services = {name: graph.services[name].probe for name in contract["services"] if name in graph.services}
    sums = {**found, **{name: probe.md5sum for name, probe in services.items() if probe}}
    checks = []
    for kind, entries in (("topic", contract["topics"]), ("service", contract["services"])):
        for name, entry in entries.items():
            old, new = entry.get("md5sum") or ANY_TYPE, sums.get(name) or ANY_TYPE
            if ANY_TYPE not in (old, new) and old != new:
                what = f"definition of {entry.get('type') or 'its type'}"
                reason = f"this version's {what} has the md5sum {new}, the one before had {old}"
                checks.append(Check(kind, name, FAIL, reason))
    return checks


def least_rates(own: Node, wanted: Wanted) -> dict[str, float]:
    """Own topic -> messages per second that it has to carry; the higher of what is promised and what was recorded."""
    found = {topic: hz for topic, hz in wanted.min_rates.items() if topic in own.publications}
    if wanted.contract:
        share = 1 - wanted.contract["tolerance"]
        for topic, entry in wanted.contract["topics"].items():
            if entry.get("rate") and topic in own.publications:
                found[topic] = max(found.get(topic, 0.0), round(entry["rate"] * share, 3))
    return found


def check_rates(least: Mapping[str, float], node: str, rates: Mapping[str, Rate]) -> list[Check]:
    return [
        check_rate(TopicCondition(topic, min_rate=hz, publisher=node), rates.get(topic)) for topic, hz in least.items()
    ]
