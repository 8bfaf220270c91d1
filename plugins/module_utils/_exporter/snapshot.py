# SPDX-License-Identifier: GPL-3.0-or-later
"""What the exporter knows at one moment, and how it follows from the graph's answers. Pure.

A snapshot is never changed: a scrape renders one while the next is being made.
"""

from __future__ import annotations

import socket
import xmlrpc.client
from dataclasses import dataclass, field, replace
from typing import Iterable, Mapping, Tuple, Union

from .._common.errors import RefusalError, RosError
from .._ros import bus_stats
from .._ros.bus_stats import Counted
from .._ros.graph import GOAL_STATES, Action, Count, Graph, Node
from .._ros.roslaunch import Child

CALLER = "/ros_exporter"
Key = Union[str, Tuple[str, ...]]  # a word for each of a metric's labels
Numbers = Mapping[str, Mapping[Key, float]]
REASONS = ("timeout", "refused", "unreachable", "fault", "malformed", "overflow")
FORGET_POLLS = 30  # a node that is gone for so long starts from nothing when it comes back
# Every node has these two; they say nothing that ros_node_up does not.
OWN_SERVICES = ("/get_loggers", "/set_logger_level")


@dataclass(frozen=True)
class History:
    """What outlives a poll: the counts of nodes, and for how many polls they were not in the graph."""

    counted: Mapping[str, Counted] = field(default_factory=dict)
    absent: Mapping[str, int] = field(default_factory=dict)
    seen: frozenset[str] | None = None  # nodes that were there at the poll before it, answering or not
    errors: Mapping[str, int] = field(default_factory=lambda: dict.fromkeys(REASONS, 0))
    polls: int = 0


@dataclass(frozen=True)
class Snapshot:
    """`ros` has the graph's metrics, by name. Without one nothing is known of it."""

    ros: Numbers = field(default_factory=dict)
    history: History = field(default_factory=History)
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


def master_away(memory: History, why: str) -> tuple[Numbers, History]:
    """Nothing is known of the nodes; what was counted so far stays for when they are back."""
    errors = dict(memory.errors)
    errors[why] += 1
    return {"ros_master_up": {(): 0}}, replace(memory, errors=errors, polls=memory.polls + 1)


def next_poll(
    graph: Graph, wrong: Iterable[str], memory: History, launched: Iterable[Child] = ()
) -> tuple[Numbers, History]:
    """The graph of this poll, and what the next one has to know. `wrong`: why questions got no usable answer."""
    errors = dict(memory.errors)
    for why in wrong:
        errors[why] += 1
    nodes = {node.name: node for node in graph.nodes.values()}
    counted = dict(memory.counted)
    flows: dict[Key, Count] = {}
    for name, node in nodes.items():
        if node.pid is None or node.stats is None:
            continue
        process, before = (node.uri, node.pid), counted.get(name)
        # another process under a name that was there before has begun since, too
        new = memory.seen is not None and name not in memory.seen
        fresh = new or (before is not None and before.process != process)
        ours = [link.number for link in node.connections or () if link.peer == CALLER]
        counted[name] = bus_stats.advance(before, process, node.stats, fresh, ours)
        flows.update({(topic, name, way): count for (topic, way), count in counted[name].totals.items()})
    absent = {name: memory.absent.get(name, 0) + 1 for name in counted if name not in nodes}
    counted = {name: one for name, one in counted.items() if absent.get(name, 0) <= FORGET_POLLS}
    # while a pod takes another's place both have it: the one that lives counts
    children = {child.node: child for child in sorted(launched, key=lambda child: child.alive)}
    numbers: Numbers = {
        "ros_master_up": {(): 1},
        "ros_node_up": {name: node.reachable for name, node in nodes.items()},
        "ros_topic_messages_total": {key: count.messages for key, count in flows.items()},
        "ros_topic_bytes_total": {key: count.bytes for key, count in flows.items()},
        "ros_topic_publishers": {one.name: len(one.publishers) for one in graph.topics.values() if one.publishers},
        "ros_topic_subscribers": {one.name: len(one.subscribers) for one in graph.topics.values() if one.subscribers},
        "ros_topic_connections": _connections(node for node in nodes.values() if node.reachable),
        "ros_service_up": {
            (name, provider.name): graph.at(provider).reachable and service.up
            for name, service in graph.services.items()
            if is_watched(name)
            for provider in service.providers
        },
        "ros_action_goals": _goals(action for action in graph.actions.values() if action.goals),
        "ros_launch_process_up": {node: child.alive for node, child in children.items()},
        "ros_launch_process_starts_total": {node: child.spawned for node, child in children.items()},
    }
    return numbers, History(counted, absent, frozenset(nodes), errors, memory.polls + 1)


def is_watched(service: str) -> bool:
    """Whether it is worth a look."""
    return not service.endswith(OWN_SERVICES)


def _connections(nodes: Iterable[Node]) -> dict[Key, float]:
    """Connections by topic, node and direction; 0 for a topic of the node that has none."""
    found: dict[Key, float] = {}
    for node in nodes:
        for topic, direction in node.stats.flows if node.stats is not None else ():
            found[topic, node.name, direction] = 0
        for link in node.connections or ():
            if link.connected and link.peer != CALLER:
                # "b", a connection for both directions, is in no client library's code
                key = (link.topic, node.name, bus_stats.IN if link.direction == "i" else bus_stats.OUT)
                found[key] = found.get(key, 0) + 1
    return found


def _goals(actions: Iterable[Action]) -> dict[Key, float]:
    """Goals by action and state, every state with its zero, so that a state that ends is seen to end."""
    listed = {action.name: [state for goals in action.goals.values() for state in goals] for action in actions}
    states = GOAL_STATES.items()
    return {(name, word.lower()): goals.count(state) for name, goals in listed.items() for state, word in states}
