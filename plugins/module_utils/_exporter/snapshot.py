# SPDX-License-Identifier: GPL-3.0-or-later
"""What the exporter knows at one moment, and how it follows from the graph's answers. Pure.

A snapshot is never changed: a scrape renders one while the next is being made.
"""

from __future__ import annotations

import socket
import xmlrpc.client
from dataclasses import dataclass, field, replace
from typing import Iterable, Mapping

from .._common.errors import RefusalError, RosError
from .._ros import bus_stats, graph, replies
from .._ros.backend import MasterState
from .._ros.bus_stats import Counted, Flow, Stats
from .._ros.roslaunch import Child

REASONS = ("timeout", "refused", "unreachable", "fault", "malformed", "overflow")
FORGET_POLLS = 30  # a node that is gone for so long starts from nothing when it comes back
# Every node has these two; they say nothing that ros_node_up does not.
OWN_SERVICES = ("/get_loggers", "/set_logger_level")


@dataclass(frozen=True)
class NodeReply:
    """What one node said in one poll. `errors` are reasons; without a `pid` it did not answer at all."""

    uri: str = ""
    pid: int | None = None
    stats: Stats | None = None
    links: tuple[graph.Connection, ...] | None = None
    ours: tuple[int, ...] = ()  # ids of connections that the exporter itself had open
    services: Mapping[str, bool] = field(default_factory=dict)
    actions: Mapping[str, tuple[int, ...]] = field(default_factory=dict)
    errors: tuple[str, ...] = ()


@dataclass(frozen=True)
class History:
    """What outlives a poll: the counts of nodes, and for how many polls they were not in the graph."""

    counted: Mapping[str, Counted] = field(default_factory=dict)
    absent: Mapping[str, int] = field(default_factory=dict)
    seen: frozenset[str] | None = None  # nodes that were there at the poll before it, answering or not
    errors: Mapping[str, int] = field(default_factory=lambda: dict.fromkeys(REASONS, 0))
    polls: int = 0


@dataclass(frozen=True)
class GraphMetrics:
    """The graph of one poll, as metrics need it. `master` None: not asked yet."""

    master: bool | None = None
    nodes: Mapping[str, bool] = field(default_factory=dict)
    counts: Mapping[str, Mapping[Flow, bus_stats.Count]] = field(default_factory=dict)
    publishers: Mapping[str, int] = field(default_factory=dict)
    subscribers: Mapping[str, int] = field(default_factory=dict)
    connections: Mapping[tuple[str, str, str], int] = field(default_factory=dict)  # topic, node, direction
    services: Mapping[tuple[str, str], bool] = field(default_factory=dict)  # service, node
    goals: Mapping[str, Mapping[str, int]] = field(default_factory=dict)
    launched: Mapping[str, Child] = field(default_factory=dict)  # by the name of its node


@dataclass(frozen=True)
class Snapshot:
    ros: GraphMetrics = GraphMetrics()
    errors: Mapping[str, int] = field(default_factory=dict)
    polls: int = 0
    duration: float = 0.0
    at: float = 0.0


def reason(error: BaseException) -> str:
    """One of REASONS."""
    error = error.__cause__ or error  # the client's words for it are of no use here
    if isinstance(error, xmlrpc.client.Fault):
        # rospy's own trouble with a count past XML-RPC's 32 bits: "<class 'OverflowError'>:int exceeds XML-RPC limits"
        return "overflow" if "exceeds XML-RPC limits" in str(error.faultString) else "fault"
    if isinstance(error, RefusalError) or (isinstance(error, RosError) and str(error).startswith("refused")):
        return "fault"  # by a code, or in a handshake's field `error`
    if isinstance(error, (socket.timeout, TimeoutError)):  # two classes before Python 3.10
        return "timeout"
    if isinstance(error, ConnectionRefusedError):
        return "refused"
    return "unreachable" if isinstance(error, (OSError, UnicodeError)) else "malformed"


def is_stale(state: MasterState, name: str, answer: NodeReply) -> bool:
    """Whether a node that answers at an address of two nodes is the other one: it lacks what this one registered."""
    if answer.stats is None:
        return False
    own, node = {topic for topic, _direction in answer.stats.flows}, state.graph.node(name)
    return not own.issuperset((*node.publications, *node.subscriptions))


def master_away(memory: History, why: str) -> tuple[GraphMetrics, History]:
    """Nothing is known of the nodes; what was counted so far stays for when they are back."""
    errors = dict(memory.errors)
    errors[why] += 1
    return GraphMetrics(master=False), replace(memory, errors=errors, polls=memory.polls + 1)


def next_poll(
    state: MasterState, answers: Mapping[str, NodeReply], memory: History, launched: Iterable[Child] = ()
) -> tuple[GraphMetrics, History]:
    """The graph of this poll, and what the next one has to know."""
    doubtful = replies.shared_uris({name: answer.uri for name, answer in answers.items() if answer.pid is not None})
    up, errors = {}, dict(memory.errors)
    counted, counts = dict(memory.counted), {}
    for name, answer in answers.items():
        for why in answer.errors:
            errors[why] += 1
        up[name] = answer.pid is not None and not (name in doubtful and is_stale(state, name, answer))
        if not up[name] or answer.pid is None or answer.stats is None:
            continue
        process, before = (answer.uri, answer.pid), counted.get(name)
        # another process under a name that was there before has begun since, too
        new = memory.seen is not None and name not in memory.seen
        fresh = new or (before is not None and before.process != process)
        counted[name] = bus_stats.advance(before, process, answer.stats, fresh, answer.ours)
        counts[name] = counted[name].totals
    absent = {name: memory.absent.get(name, 0) + 1 for name in counted if name not in answers}
    counted = {name: one for name, one in counted.items() if absent.get(name, 0) <= FORGET_POLLS}
    answering = {name: answers[name] for name in up if up[name]}
    ros = GraphMetrics(
        True,
        up,
        counts,
        {topic: len(names) for topic, names in state.publishers.items()},
        {topic: len(names) for topic, names in state.subscribers.items()},
        _connections(answering),
        {
            (service, node): up.get(node, False) and answers[node].services.get(service, False)
            for service, providers in watched(state).items()
            for node in providers
            if node in answers
        },
        _goals(answering),
        # while a pod takes another's place both have it: the one that lives counts
        {child.node: child for child in sorted(launched, key=lambda child: child.alive)},
    )
    return ros, History(counted, absent, frozenset(answers), errors, memory.polls + 1)


def watched(state: MasterState) -> dict[str, tuple[str, ...]]:
    """The services that are worth a look, with their providers."""
    return {name: nodes for name, nodes in state.services.items() if not name.endswith(OWN_SERVICES)}


def _connections(answers: Mapping[str, NodeReply]) -> dict[tuple[str, str, str], int]:
    """Connections by topic, node and direction; 0 for a topic of the node that has none."""
    found: dict[tuple[str, str, str], int] = {}
    for name, answer in answers.items():
        for topic, direction in answer.stats.flows if answer.stats is not None else ():
            found[(topic, name, direction)] = 0
        for link in answer.links or ():
            if link.connected:
                # "b", a connection for both directions, is in no client library's code
                key = (link.topic, name, bus_stats.IN if link.direction == "i" else bus_stats.OUT)
                found[key] = found.get(key, 0) + 1
    return found


def _goals(answers: Mapping[str, NodeReply]) -> dict[str, dict[str, int]]:
    """Goals by action and state, every state with its zero, so that a state that ends is seen to end."""
    found: dict[str, dict[str, int]] = {}
    for answer in answers.values():
        for action, goals in answer.actions.items():
            states = found.setdefault(action, {word.lower(): 0 for word in graph.GOAL_STATES.values()})
            for state in goals:
                if state in graph.GOAL_STATES:
                    states[graph.GOAL_STATES[state].lower()] += 1
    return found
