# SPDX-License-Identifier: GPL-3.0-or-later
"""Judge the own nodes' part of the graph: is it wholly connected, and does it give what its predecessor gave?

An app has one node, or all that its launch file starts: together they owe what the version before gave. What a gate
looks at, too, is judged by the gate's checks.

Pure. `wait` is the verdict for everything that time may mend; `fail` is kept for what this revision itself
contradicts.
"""

from __future__ import annotations

from typing import Iterable, Mapping, Sequence

from .._common.poll import FAIL, PASS, WAIT
from .._ros.backend import MasterState, Questions
from .._ros.checks import Check, check_edge, check_latched, check_node, check_service, check_topic, check_type
from .._ros.conditions import EdgeCondition, TopicCondition
from .._ros.contract import Contract, conditions
from .._ros.graph import ANY_TYPE, PATIENCE, Graph, Handshake, Node, ServiceProbe, names_of
from .._ros.names import is_tool

# Every node logs there, at no rate, and rosout connects by itself whenever it comes: not worth keeping anybody waiting.
UNCOUNTED = frozenset({"/rosout"})


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


def gaps(graph: Graph, own: Sequence[str]) -> list[EdgeCondition]:
    """The connections that both ends are registered for and that own nodes do not have yet; their peers may leave.

    Tools that somebody has open do not count. A subscription counts when its publisher says so: the subscriber itself
    says it before any handshake.
    """
    found = []
    for node in [node for node in map(graph.node, own) if node.reachable]:
        for topic in node.publications:
            counted = [key for key in graph.topic(topic).subscribers if not is_tool(key.name)]
            told = graph.unreached(topic, node.key, counted)
            missing = counted if told is None else told
            found += [EdgeCondition(node.name, topic, key.name, "subscriber") for key in missing]
        for topic in node.subscriptions:
            others = [key for key in graph.topic(topic).publishers if key.name not in own and not is_tool(key.name)]
            missing = [key for key in others if graph.unreached(topic, key, [node.key]) != []]
            found += [EdgeCondition(key.name, topic, node.name, "publisher") for key in missing]
    return [gap for gap in found if gap.topic not in UNCOUNTED]


def is_forgiven(gap: EdgeCondition, contract: Contract | None, seconds: float) -> bool:
    """Whether a connection that has been missing for so long need not be waited for, though its peer lives.

    A peer that had the version before must have this one, too, however long ago the connection began to be missing.
    """
    edge = gap.publisher, gap.topic, gap.subscriber
    return contract is not None and edge not in contract.edges and seconds >= PATIENCE


def judge(graph: Graph, own: Iterable[str], contract: Contract | None, awaited: Iterable[EdgeCondition]) -> list[Check]:
    """All but rates and handshakes, which are read once all of this passes. `awaited`: the gaps that count."""
    nodes = [graph.node(name) for name in own]
    checks = [check_node(graph, node.name) for node in nodes]
    alive = [node for node in nodes if node.reachable]
    if not alive:
        return checks
    if contract:
        checks += _promised(graph, alive, contract)
    untold = [node.name for node in alive if node.connections is None]
    checks += [Check("node", name, WAIT, "it does not tell its connections") for name in untold]
    checks += [check_edge(graph, gap) for gap in awaited]
    return [*checks, *(_served(graph, node, name) for node in alive for name in node.services)]


def _promised(graph: Graph, own: list[Node], contract: Contract) -> list[Check]:
    checks = [check_topic(graph, one) for one in _topics(contract)]
    for topic, wanted in contract.subscriptions.items():
        told = [node.key for node in own if node.own_types.get(topic, ANY_TYPE) != ANY_TYPE]
        if wanted and told:
            checks.append(Check("topic", topic, *check_type(graph, graph.topic(topic), wanted, told)))
    return [*checks, _offered(graph, own, contract), *_together(graph, own, contract)]


def _offered(graph: Graph, own: list[Node], contract: Contract) -> Check:
    """What the version before had registered beside its topics."""
    names = {node.name for node in own}
    subscribed = {name for node in own for name in node.subscriptions}
    served = {name for node in own for name in node.services}
    lacking = [f"does not start {name}" for name in contract.nodes if name not in names and len(contract.nodes) > 1]
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
        if ends & names and ends <= members:
            yield check_edge(graph, EdgeCondition(publisher, topic, subscriber))


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
    latched = [(one, found[one.name]) for one in _topics(contract) if one.latched and one.name in found]
    return [*checks, *(check_latched(one, said) for one, said in latched if said.publisher.name == one.publisher)]


def rated(own: Sequence[Node], contract: Contract | None, min_rates: Mapping[str, float]) -> list[TopicCondition]:
    """The rates of the own nodes' topics: each node owes what it gave before, all together what is promised."""
    mine = {(topic, node.name) for node in own for topic in node.publications}
    promised = {topic: min_rates[topic] for topic, _node in mine if topic in min_rates}
    before = [one for one in _topics(contract) if (one.name, one.publisher) in mine]
    together = (TopicCondition(topic, min_rate=hz) for topic, hz in sorted(promised.items()))
    return [one for one in (*before, *together) if one.min_rate]


def _topics(contract: Contract | None) -> list[TopicCondition]:
    """What each node owes of its topics."""
    return [TopicCondition(**one) for one in conditions(contract)["topics"]] if contract else []
