# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""ROS 1's replies -> the graph. Pure: nothing here opens a connection.

Replies come in as plain lists, as either client library gives them, from peers that may be wrong: a row that makes no
sense is left out, never an exception.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, Iterable, Mapping

from .._common.errors import RefusalError, RosError
from .graph import Connection, Graph, MasterState, Node, NodeKey, ServiceProbe, StatusReading


@dataclass(frozen=True)
class NodeAnswer:
    """Raw replies of one node. `error` is why it did not answer; None in a field: not asked."""

    uri: str = ""
    pid: int | None = None
    error: str = ""
    bus: Any = None
    publications: Any = None
    subscriptions: Any = None
    refused: bool = False  # nothing listens at its address: it is dead, where one that is late may only be busy


def unwrap(reply: Any) -> Any:
    """The value of a `[code, message, value]` reply; RefusalError with the peer's message where the code is not 1."""
    shaped = isinstance(reply, (list, tuple)) and len(reply) >= 3
    if not shaped or isinstance(reply[0], bool) or not isinstance(reply[0], int):
        raise RosError("the reply is not [code, message, value]")
    if reply[0] != 1:
        raise RefusalError(str(reply[1])[:200] or f"refused with code {reply[0]}")
    return reply[2]


def _rows(raw: Any, least: int) -> Iterable[Any]:
    """The rows of a list of lists that are at least so long; anything else is left out."""
    if isinstance(raw, (list, tuple)):
        for row in raw:
            if isinstance(row, (list, tuple)) and len(row) >= least:
                yield row


def registrations(raw: Any) -> dict[str, tuple[str, ...]]:
    """One third of getSystemState's value."""
    found: dict[str, tuple[str, ...]] = {}
    for name, nodes, *_more in _rows(raw, 2):
        if isinstance(name, str) and isinstance(nodes, (list, tuple)):
            found[name] = tuple(sorted({node for node in nodes if isinstance(node, str)}))
    return found


def topic_types(raw: Any) -> dict[str, str]:
    """[[topic, type], ...] as getTopicTypes, getPublications and getSubscriptions give it."""
    return {row[0]: row[1] for row in _rows(raw, 2) if isinstance(row[0], str) and isinstance(row[1], str)}


def master_state(system_state: Any, types: Any = None) -> MasterState:
    """getSystemState's and getTopicTypes' values."""
    if not isinstance(system_state, (list, tuple)) or len(system_state) < 3:
        raise RosError("the master's system state is not [publishers, subscribers, services]")
    publishers, subscribers, services = (registrations(part) for part in system_state[:3])
    return MasterState(publishers, subscribers, services, topic_types(types))


def connections(raw: Any) -> tuple[Connection, ...]:
    """getBusInfo's value: [id, peer, direction, transport, topic, connected, ...]; older nodes end after the topic."""
    found = []
    for row in _rows(raw, 5):
        peer, direction, transport, topic = row[1:5]
        if all(isinstance(value, str) for value in (peer, direction, transport, topic)):
            connected = bool(row[5]) if len(row) > 5 else True
            info = row[6] if len(row) > 6 and isinstance(row[6], str) else ""
            found.append(Connection(topic, peer, direction, transport, connected, info))
    return tuple(found)


def shared_uris(uris: Mapping[str, str]) -> frozenset[str]:
    """Nodes registered under an address that another node has, too: only one of them can be who it says."""
    nodes: dict[str, list[str]] = {}
    for name, uri in uris.items():
        nodes.setdefault(uri, []).append(name)
    return frozenset(name for uri, names in nodes.items() if uri and len(names) > 1 for name in names)


def _node(state: MasterState, name: str, answer: NodeAnswer, doubtful: bool) -> Node:
    published, subscribed = state.of(name, state.publishers), state.of(name, state.subscribers)
    services = state.of(name, state.services)
    own = {**topic_types(answer.subscriptions), **topic_types(answer.publications)}
    pid, error = answer.pid, answer.error
    if doubtful and pid is not None and any(topic not in own for topic in (*published, *subscribed)):
        pid, error = None, f"another node answers at {answer.uri}: a stale registration"
    bus = connections(answer.bus) if pid is not None and answer.bus is not None else None
    return Node(name, answer.uri, pid, True, error, published, subscribed, services, own, bus, answer.refused)


def build(
    state: MasterState,
    answers: Mapping[str, NodeAnswer],
    probes: Mapping[str, ServiceProbe] | None = None,
    statuses: Mapping[str, Mapping[str, StatusReading]] | None = None,
) -> Graph:
    """Registrations and answers -> graph. A node without an answer stands in it as not asked."""
    doubtful = shared_uris({name: answer.uri for name, answer in answers.items()})
    answered = [_node(state, name, answer, name in doubtful) for name, answer in answers.items()]
    graph = state.graph.answered(answered)
    edges: dict[str, set[tuple[NodeKey, NodeKey]]] = {}
    for node in answered:
        for one in node.connections or ():
            if one.direction != "i" and one.connected and one.topic in graph.topics:
                edges.setdefault(one.topic, set()).add((node.key, graph.node(one.peer).key))
    connected = {name: replace(graph.topics[name], connections=tuple(sorted(found))) for name, found in edges.items()}
    probed = {
        name: replace(graph.services[name], probe=probe)
        for name, probe in (probes or {}).items()
        if name in graph.services
    }
    asked = {
        name: replace(graph.action(name), statuses={graph.node(server).key: one for server, one in found.items()})
        for name, found in (statuses or {}).items()
    }
    return replace(
        graph,
        topics={**graph.topics, **connected},
        services={**graph.services, **probed},
        actions={**graph.actions, **asked},
    )
