# SPDX-License-Identifier: GPL-3.0-or-later
"""Checks of nodes, services, actions, topics and edges: one condition judged, with its reason.

Pure. `wait` is the verdict for everything that time may mend; `fail` only for what a living node itself contradicts.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Iterable, Sequence

from .._common.documents import Data
from .._common.poll import FAIL, PASS, WAIT, overall
from .conditions import ActionCondition, EdgeCondition, TopicCondition
from .graph import ANY_TYPE, BUSY_STATES, GOAL_STATES, Graph, Handshake, NodeKey, Rate, StatusReading, Topic, names_of
from .names import is_keeper, is_tool

RATE_TOLERANCE = 0.01  # what a window of one second can tell apart; a publisher at just min_rate must not flap


@dataclass(frozen=True)
class Check:
    """One condition judged. `reason` stands alone in a message; `observed` has the same as data."""

    kind: str
    name: str
    verdict: str
    reason: str
    observed: Data = field(default_factory=dict)

    def __str__(self) -> str:
        return f"{self.kind} {self.name}: {self.reason}"


def count(number: int, what: str) -> str:
    return f"{number} {what}" if number == 1 else f"{number} {what}s"


def listed(names: Iterable[object]) -> str:
    return ", ".join(sorted(map(str, names)))


def living(graph: Graph, keys: Iterable[NodeKey]) -> tuple[list[NodeKey], list[str]]:
    """Nodes split into those that answered and, with the reason, those that did not."""
    alive, dead = [], []
    for node in map(graph.at, keys):
        if node.reachable:
            alive.append(node.key)
        else:
            dead.append(f"{node.name} ({node.error or 'not asked'})")
    return alive, dead


def check_node(graph: Graph, name: str) -> Check:
    node = graph.node(name)
    if not graph.named(name):
        return Check("node", name, WAIT, "not registered with the master")
    observed = {"uri": node.uri, "pid": node.pid, "refused": node.refused}
    if not node.reachable:
        return Check("node", name, WAIT, f"registered, but down: {node.error}", observed)
    return Check("node", name, PASS, f"up, process {node.pid} at {node.uri}", observed)


def check_absent(graph: Graph, name: str) -> Check:
    node = graph.node(name)
    if not graph.named(name):
        return Check("absent", name, PASS, "gone from the graph")
    observed = {"uri": node.uri, "pid": node.pid}
    if node.gone:
        return Check("absent", name, PASS, f"gone, what is registered is stale: {node.error}", observed)
    if not node.reachable:
        return Check("absent", name, WAIT, f"still registered, and may only be late: {node.error}", observed)
    return Check("absent", name, WAIT, "still registered, and answers", observed)


def check_service(graph: Graph, name: str) -> Check:
    service = graph.services.get(name)
    if service is None:
        return Check("service", name, WAIT, "not registered with the master")
    providers = listed(service.providers)
    probe = service.probe
    if probe is None:
        return Check("service", name, WAIT, f"registered by {providers}, not asked")
    observed = {"provider": probe.provider, "type": probe.type, "uri": probe.uri}
    if probe.error:
        return Check("service", name, WAIT, f"registered by {providers}, but not served: {probe.error}", observed)
    if probe.provider and probe.provider not in names_of(service.providers):
        reason = f"registered by {providers}, but {probe.provider} answers at {probe.uri}: a stale registration"
        return Check("service", name, WAIT, reason, observed)
    return Check("service", name, PASS, f"served by {probe.provider or providers}", observed)


def idle(server: NodeKey, status: StatusReading) -> tuple[str, str]:
    """Idle must be seen twice: a goal that is on its way stands in no list yet."""
    busy = [state for reading in status.readings for state in reading if state in BUSY_STATES]
    if busy:
        last = [state for state in status.readings[-1] if state in BUSY_STATES] or busy
        states = [GOAL_STATES[state] for state in last]
        told = ", ".join(f"{states.count(state)} {state}" for state in dict.fromkeys(states))
        return WAIT, f"busy on {server}: {told}"
    if not status.readings:
        return WAIT, f"not known whether {server} is idle: {status.error}"
    if len(status.readings) < 2:
        return WAIT, f"idle on {server}, seen once only: {status.error or 'a second status is due'}"
    return PASS, f"idle on {server}, seen twice"


def check_action(graph: Graph, wanted: ActionCondition) -> Check:
    action, goal = graph.action(wanted.name), graph.topic(f"{wanted.name}/goal")
    parts = {
        "publishes its status": graph.topic(f"{wanted.name}/status").publishers,
        "takes its goals": goal.subscribers,
        "takes its cancels": graph.topic(f"{wanted.name}/cancel").subscribers,
    }
    if not (parts["publishes its status"] or goal.subscribers):
        return Check("action", wanted.name, WAIT, "no action server is registered with the master")
    observed: Data = {"servers": names_of(action.servers)}
    if not action.servers:
        lacking = " and ".join(what for what, keys in parts.items() if not keys) or "does all of it at once"
        return Check("action", wanted.name, WAIT, f"no whole action server: no node {lacking}", observed)
    read = {key: action.statuses.get(key, StatusReading(error="not asked")) for key in action.servers}
    alive = [key for key, status in read.items() if status.readings]
    observed["goals"] = {key.name: [GOAL_STATES.get(s, str(s)) for s in read[key].readings[-1]] for key in alive}
    if not alive:
        told = listed(f"{key} ({status.error})" for key, status in read.items())
        return Check("action", wanted.name, WAIT, f"no status can be read: {told}", observed)
    if wanted.state == "idle":
        counted = [key for key in read if key in alive or (key.name == wanted.server and not read[key].refused)]
        seen = [idle(key, read[key]) for key in counted]
        verdict = overall([one for one, _reason in seen])
        told = "; ".join(reason for one, reason in seen if one == verdict)
        return Check("action", wanted.name, verdict, told, observed)
    if len(alive) > 1:
        reason = f"{len(alive)} servers take the same goals: {listed(alive)}"
        return Check("action", wanted.name, WAIT, reason, observed)
    return Check("action", wanted.name, PASS, f"served by {alive[0]}", observed)


# ---- topics and edges


def _check_number(graph: Graph, what: str, keys: Iterable[NodeKey], least: int) -> tuple[str, str]:
    alive, dead = living(graph, keys)
    reason = count(len(alive), what)
    if len(alive) < least:
        reason += f" of at least {least}"
    if dead:
        reason += f"; registered, but down: {listed(dead)}"
    return (PASS if len(alive) >= least else WAIT), reason


def check_type(graph: Graph, topic: Topic, wanted: str, keys: Iterable[NodeKey]) -> tuple[str, str]:
    """A living node's own word counts; the master may still know the type of one that is gone."""
    alive, _dead = living(graph, keys)
    claims = {key: graph.at(key).own_types.get(topic.name, "") for key in alive}
    claims = {key: claim for key, claim in claims.items() if claim not in ("", ANY_TYPE)}
    wrong = {f"{claim} at {key}" for key, claim in claims.items() if claim != wanted}
    if wrong:
        return FAIL, f"the type is {listed(wrong)}, not {wanted}"
    if claims or topic.type == wanted:
        return PASS, f"type {wanted}"
    return WAIT, f"the type is {topic.type or 'not known'} to the master, not {wanted}"


def _counted(keys: Sequence[NodeKey]) -> Sequence[NodeKey]:
    """Without tools, which come and go; where there is nobody else, an app has such a name."""
    return [key for key in keys if not is_tool(key.name)] or keys


def _check_connected(graph: Graph, topic: Topic, whose: NodeKey | None) -> tuple[str, str, list[str]]:
    """Every subscriber that lives must be a destination of every publisher that lives, and there must be one of each.

    Or of the one publisher that is meant (`whose`), which is up, whoever subscribes. Somebody's laptop that fell asleep
    with a subscription is no fault of anybody's.
    """
    ends = {"publisher": [whose] if whose else _counted(topic.publishers), "subscriber": _counted(topic.subscribers)}
    alive = {role: [key for key in keys if not graph.at(key).gone] for role, keys in ends.items()}
    for role, keys in ends.items() if not whose else ():
        if not keys:
            return WAIT, f"not connected: no {role} is registered", []
        if not alive[role]:
            told = listed(f"{key} ({graph.at(key).error})" for key in keys)
            return WAIT, f"not connected: every {role} is registered, but down: {told}", names_of(topic.subscribers)
    down = [key for keys in ends.values() for key in keys if graph.at(key).gone]
    note = f"; down, so not counted: {listed(down)}" if down else ""
    reasons: list[str] = []
    lacking: set[NodeKey] = set()
    number = count(len(alive["subscriber"]), "subscriber")
    for publisher in alive["publisher"]:
        missing = graph.unreached(topic.name, publisher, alive["subscriber"])
        lacking.update(alive["subscriber"] if missing is None else missing)
        if missing is None:
            reasons.append(_unknown(graph, publisher))
        elif missing:
            have = len(alive["subscriber"]) - len(missing)
            reasons.append(f"{have} of {number} connected to {publisher}: missing {listed(missing)}")
    if reasons:
        return WAIT, "; ".join(reasons) + note, names_of(sorted(lacking))
    return PASS, f"{number} connected to {whose or count(len(alive['publisher']), 'publisher')}{note}", []


def _unknown(graph: Graph, publisher: NodeKey) -> str:
    why = graph.at(publisher).error or "it did not tell them"
    return f"the connections of {publisher} are not known ({why})"


def check_topic(graph: Graph, wanted: TopicCondition) -> Check:
    topic = graph.topics.get(wanted.name)
    if topic is None:
        return Check("topic", wanted.name, WAIT, "nobody has registered it with the master")
    parts: list[tuple[str, str]] = []
    ends = {"publishers": names_of(topic.publishers), "subscribers": names_of(topic.subscribers)}
    observed: Data = {"type": topic.type, **ends}
    whose = graph.node(wanted.publisher).key if wanted.publisher else None
    if wanted.publisher:
        away = _unseen(graph, wanted.name, wanted.publisher, "publisher")
        parts.append((WAIT, away) if away else (PASS, f"published by {wanted.publisher}"))
    if wanted.type:
        keys = [whose] if whose else [*topic.publishers, *topic.subscribers]
        parts.append(check_type(graph, topic, wanted.type, keys))
    least = wanted.publishers
    if least is None and wanted.subscribers is None and not wanted.connected and not wanted.publisher:
        least = 1
    if least is not None:
        # the keeper publishes in the place of one that has nothing to say yet
        own = [key for key in topic.publishers if not is_keeper(key.name)]
        parts.append(_check_number(graph, "publisher", own, least))
    if wanted.subscribers is not None:
        parts.append(_check_number(graph, "subscriber", topic.subscribers, wanted.subscribers))
    if wanted.connected and (not whose or parts[0][0] == PASS):
        verdict, reason, missing = _check_connected(graph, topic, whose)
        parts.append((verdict, reason))
        observed.update(missing=missing, connections=len(topic.connections))
    verdict = overall([part[0] for part in parts])
    # what is wrong says the most; what is right is told only when nothing is wrong
    reasons = [reason for part, reason in parts if part != PASS or verdict == PASS]
    return Check("topic", wanted.name, verdict, "; ".join(reasons), observed)


def check_rate(wanted: TopicCondition, rate: Rate | None) -> Check:
    """Of the whole topic, or of the publisher that is asked for."""
    least, whose = wanted.min_rate or 0.0, f" by {wanted.publisher}" if wanted.publisher else ""
    if rate is not None and wanted.publisher:
        own = (part for key, part in rate.by.items() if key.name == wanted.publisher)
        rate = next(own, Rate(error=f"{wanted.publisher} does not publish it"))
    if rate is None:
        why = f"not measured: at least {least:g} Hz is looked at once all else passes"
        return Check("rate", wanted.name, WAIT, why)
    observed = {"rate": round(rate.hz, 3), "messages": rate.messages, "seconds": round(rate.seconds, 3)}
    if rate.error:
        return Check("rate", wanted.name, WAIT, f"not measured: {rate.error}", observed)
    seen = f"{rate.hz:.1f} Hz{whose} ({count(rate.messages, 'message')} in {rate.seconds:.1f} s)"
    if rate.hz >= least * (1 - RATE_TOLERANCE):
        return Check("rate", wanted.name, PASS, f"{seen}, at least {least:g} Hz", observed)
    return Check("rate", wanted.name, WAIT, f"{seen} of at least {least:g} Hz", observed)


def check_latched(wanted: TopicCondition, said: Handshake | None) -> Check:
    """What a publisher says of itself; a value that a node latches later has to reach who comes later still."""
    if said is None:
        return Check("latched", wanted.name, WAIT, "not known: no publisher says whether it latches")
    observed = {"publisher": said.publisher.name, "latching": said.latching}
    if said.latching:
        return Check("latched", wanted.name, PASS, f"latched by {said.publisher}", observed)
    return Check("latched", wanted.name, FAIL, f"{said.publisher} publishes it without latching", observed)


def _unseen(graph: Graph, topic: str, name: str, role: str) -> str:
    """Why a look shows a node as no end of a topic's connections, or nothing. `role`: "publisher" or "subscriber"."""
    node, found = graph.node(name), graph.topic(topic)
    if not graph.named(name):
        return f"{name} is not registered with the master"
    if not node.reachable:
        return f"{name} is registered, but down: {node.error or 'not asked'}"
    if role == "publisher":
        return "" if name in names_of(found.publishers) else f"{name} lives, but does not publish it"
    return "" if name in names_of(found.subscribers) else f"{name} lives, but does not subscribe to it"


def check_edge(graph: Graph, wanted: EdgeCondition) -> Check:
    """A connection by its publisher's word. Where an end is gone that may leave by itself, nothing is left to ask."""
    name, ends = str(wanted), {"publisher": wanted.publisher, "subscriber": wanted.subscriber}
    if graph.topic(wanted.topic).connects(wanted.publisher, wanted.subscriber):
        return Check("edge", name, PASS, "connected", {"connected": True})
    away = {role: why for role, end in ends.items() if (why := _unseen(graph, wanted.topic, end, role))}
    peer = graph.node(ends.get(wanted.peer, ""))
    # one that does not answer may only be late
    if wanted.peer in away and (peer.reachable or peer.gone or not graph.named(peer.name)):
        why = f"passes unconnected, as its peer left: {away[wanted.peer]}"
        return Check("edge", name, PASS, why, {"connected": False})
    publisher = graph.node(wanted.publisher)
    if away:
        reason = "; ".join(away.values())
    elif publisher.connections is None:
        reason = _unknown(graph, publisher.key)
    else:
        reason = f"{wanted.subscriber} is not connected to {wanted.publisher}"
    silent = [end for end in ends.values() if not graph.node(end).reachable]
    return Check("edge", name, WAIT, reason, {"connected": False, "silent": silent})
