# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Checks of topics: who publishes and subscribes, of what type, connected to whom, how fast, and single connections.

Pure. `wait` is the verdict for everything that time may mend; `fail` only for what a living node itself contradicts.
Runs on Python 3.8 with the standard library, on hosts and in pods.
"""

from __future__ import annotations

from typing import Any, Iterable

from .._common.poll import FAIL, PASS, WAIT, overall
from .checks import Check, count, is_down, listed, living
from .conditions import EdgeCondition, TopicCondition
from .graph import ANY_TYPE, Graph, Node, Rate, Topic

RATE_TOLERANCE = 0.01  # what a window of one second can tell apart; a publisher at just min_rate must not flap


def _check_number(graph: Graph, what: str, names: tuple[str, ...], least: int) -> tuple[str, str]:
    alive, dead = living(graph, names)
    reason = count(len(alive), what)
    if len(alive) < least:
        reason += f" of at least {least}"
    if dead:
        reason += f"; registered, but down: {listed(dead)}"
    return (PASS if len(alive) >= least else WAIT), reason


def _check_type(graph: Graph, topic: Topic, wanted: str, names: Iterable[str]) -> tuple[str, str]:
    """A living node's own word counts; the master may still know the type of one that is gone."""
    alive, _dead = living(graph, names)
    claims = {name: graph.nodes[name].own_types.get(topic.name, "") for name in alive}
    claims = {name: claim for name, claim in claims.items() if claim not in ("", ANY_TYPE)}
    wrong = {name: claim for name, claim in claims.items() if claim != wanted}
    if wrong:
        return FAIL, f"the type is {listed({f'{claim} at {name}' for name, claim in wrong.items()})}, not {wanted}"
    if claims or topic.type == wanted:
        return PASS, f"type {wanted}"
    return WAIT, f"the type is {topic.type or 'not known'} to the master, not {wanted}"


def _check_connected(graph: Graph, topic: Topic) -> tuple[str, str, list[str]]:
    """Every registered subscriber must be a destination of every publisher, by the publisher's own word.

    The subscriber's word is worth nothing here: it reports a connection before the handshake.
    """
    if not topic.publishers or not topic.subscribers:
        lacking = "publisher" if not topic.publishers else "subscriber"
        return WAIT, f"not connected: no {lacking} is registered", []
    reasons: list[str] = []
    missing_all: set[str] = set()
    done = 0
    for publisher in topic.publishers:
        node = graph.nodes.get(publisher, Node(publisher))
        if node.connections is None:
            reasons.append(f"the connections of {publisher} are not known ({node.error or 'it did not tell them'})")
            missing_all.update(topic.subscribers)
            continue
        ends = {peer for name, peer in topic.connections if name == publisher}
        missing = [name for name in topic.subscribers if name not in ends]
        missing_all.update(missing)
        if not missing:
            done += 1
            continue
        have = len(topic.subscribers) - len(missing)
        told = [f"{name} (down: {graph.nodes[name].error})" if is_down(graph, name) else name for name in missing]
        reasons.append(f"{have} of {count(len(topic.subscribers), 'subscriber')} connected to {publisher}: "
                       f"missing {listed(told)}")  # fmt: skip
    if reasons:
        return WAIT, "; ".join(reasons), sorted(missing_all)
    return PASS, f"{count(len(topic.subscribers), 'subscriber')} connected to {count(done, 'publisher')}", []


def _check_publisher(graph: Graph, topic: Topic, name: str) -> tuple[str, str]:
    if name not in topic.publishers:
        return WAIT, f"{name} does not publish it"
    node = graph.nodes.get(name, Node(name))
    if not node.reachable:
        return WAIT, f"its publisher {name} is registered, but down: {node.error or 'not asked'}"
    return PASS, f"published by {name}"


def _check_connected_to(graph: Graph, topic: Topic, publisher: str) -> tuple[str, str, list[str]]:
    """Every subscriber that lives must be a destination of this publisher; what died is no fault of it."""
    node = graph.nodes.get(publisher, Node(publisher))
    if node.connections is None:
        why = node.error or "it did not tell them"
        return WAIT, f"the connections of {publisher} are not known ({why})", list(topic.subscribers)
    ends = {peer for name, peer in topic.connections if name == publisher}
    dead = [name for name in topic.subscribers if name not in ends and is_down(graph, name)]
    alive = [name for name in topic.subscribers if name not in dead]
    missing = [name for name in alive if name not in ends]
    note = f"; down, so not counted: {listed(dead)}" if dead else ""
    if missing:
        have = f"{len(alive) - len(missing)} of {count(len(alive), 'subscriber')}"
        return WAIT, f"{have} connected to {publisher}: missing {listed(missing)}{note}", missing
    return PASS, f"{count(len(alive), 'subscriber')} connected to {publisher}{note}", []


def check_topic(graph: Graph, wanted: TopicCondition) -> Check:
    topic = graph.topics.get(wanted.name)
    if topic is None:
        return Check("topic", wanted.name, WAIT, "nobody has registered it with the master")
    parts: list[tuple[str, str]] = []
    observed: dict[str, Any] = {
        "type": topic.type,
        "publishers": list(topic.publishers),
        "subscribers": list(topic.subscribers),
    }
    if wanted.publisher:
        parts.append(_check_publisher(graph, topic, wanted.publisher))
    if wanted.type:
        names = [wanted.publisher] if wanted.publisher else [*topic.publishers, *topic.subscribers]
        parts.append(_check_type(graph, topic, wanted.type, names))
    least = wanted.publishers
    if least is None and wanted.subscribers is None and not wanted.connected and not wanted.publisher:
        least = 1
    if least is not None:
        parts.append(_check_number(graph, "publisher", topic.publishers, least))
    if wanted.subscribers is not None:
        parts.append(_check_number(graph, "subscriber", topic.subscribers, wanted.subscribers))
    if wanted.connected and (not wanted.publisher or parts[0][0] == PASS):
        found = _check_connected_to(graph, topic, wanted.publisher) if wanted.publisher else None
        verdict, reason, missing = found or _check_connected(graph, topic)
        parts.append((verdict, reason))
        observed["missing"] = missing
        observed["connections"] = len(topic.connections)
    verdict = overall([part[0] for part in parts])
    # what is wrong says the most; what is right is told only when nothing is wrong
    reasons = [reason for part, reason in parts if part != PASS or verdict == PASS]
    return Check("topic", wanted.name, verdict, "; ".join(reasons), observed)


def check_rate(wanted: TopicCondition, rate: Rate | None) -> Check:
    """Of the whole topic, or of the publisher that is asked for."""
    least, whose = wanted.min_rate or 0.0, f" by {wanted.publisher}" if wanted.publisher else ""
    if rate is not None and wanted.publisher:
        rate = rate.by.get(wanted.publisher, Rate(error=f"{wanted.publisher} does not publish it"))
    if rate is None:
        return Check(
            "rate", wanted.name, WAIT, f"not measured: at least {least:g} Hz is looked at once all else passes"
        )
    observed = {"rate": round(rate.hz, 3), "messages": rate.messages, "seconds": round(rate.seconds, 3)}
    if rate.error:
        return Check("rate", wanted.name, WAIT, f"not measured: {rate.error}", observed)
    seen = f"{rate.hz:.1f} Hz{whose} ({count(rate.messages, 'message')} in {rate.seconds:.1f} s)"
    if rate.hz >= least * (1 - RATE_TOLERANCE):
        return Check("rate", wanted.name, PASS, f"{seen}, at least {least:g} Hz", observed)
    return Check("rate", wanted.name, WAIT, f"{seen} of at least {least:g} Hz", observed)


def _left(graph: Graph, name: str) -> str:
    """Why a node is no end of a connection any more, or nothing."""
    node = graph.nodes.get(name)
    if node is None:
        return f"{name} is not registered with the master"
    return "" if node.reachable else f"{name} is registered, but down: {node.error or 'not asked'}"


def check_edge(graph: Graph, wanted: EdgeCondition) -> Check:
    """A connection by its publisher's word. Where an end is gone that may leave by itself, nothing is left to ask."""
    name, ends = str(wanted), (wanted.publisher, wanted.subscriber)
    topic = graph.topics.get(wanted.topic, Topic(wanted.topic))
    if ends in topic.connections:
        return Check("edge", name, PASS, "connected", {"connected": True})
    peer = {"publisher": wanted.publisher, "subscriber": wanted.subscriber}.get(wanted.peer, "")
    left = _left(graph, peer) if peer else ""
    if left:
        return Check("edge", name, PASS, f"passes unconnected, as its peer left: {left}", {"connected": False})
    gone = [why for why in (_left(graph, end) for end in ends) if why]
    publisher = graph.nodes.get(wanted.publisher, Node(wanted.publisher))
    if gone:
        reason = "; ".join(gone)
    elif wanted.publisher not in topic.publishers:
        reason = f"{wanted.publisher} lives, but does not publish it"
    elif wanted.subscriber not in topic.subscribers:
        reason = f"{wanted.subscriber} lives, but does not subscribe to it"
    elif publisher.connections is None:
        reason = f"the connections of {wanted.publisher} are not known (it did not tell them)"
    else:
        reason = f"{wanted.subscriber} is not connected to {wanted.publisher}"
    return Check("edge", name, WAIT, reason, {"connected": False})
