# SPDX-License-Identifier: GPL-3.0-or-later
"""ROS 1's replies -> the graph. Pure: nothing here opens a connection, and whoever reads bytes bounds their number.

Replies come in as either client library gives them, from peers that may be hostile, or only wrong: what could do harm
is an error, a row that makes no sense is left out.
"""

from __future__ import annotations

import xmlrpc.client
from dataclasses import dataclass, replace
from typing import Any, Callable, Iterable, Mapping
from xml.parsers import expat

from .._common.documents import DIGITS
from .._common.errors import RefusalError, RosError
from .backend import MasterState
from .graph import Connection, Graph, Node, NodeKey, ServiceProbe, Stats, StatusReading

DEPTH = 300  # tags within each other: a list or a mapping in another one takes three


class _Values(xmlrpc.client.Unmarshaller):
    """The library's, with whole numbers that end, and no list within lists without end."""

    depth = 0

    def start(self, tag: str, attrs: dict[str, str]) -> None:
        self.depth += 1
        if self.depth > DEPTH:
            raise RosError(f"a value has more than {DEPTH} tags within each other")
        super().start(tag, attrs)

    def end(self, tag: str) -> None:
        self.depth -= 1
        super().end(tag)

    dispatch: dict[str, Callable[..., None]] = dict(xmlrpc.client.Unmarshaller.dispatch)  # noqa: RUF012 - inherited

    def end_number(self, data: str) -> None:
        if len(data.strip()) > DIGITS:
            raise RosError(f"a number has more than {DIGITS} digits")
        self.end_int(data)

    for _tag in ("i1", "i2", "i4", "i8", "int", "biginteger"):
        dispatch[_tag] = end_number


def loads(body: bytes) -> tuple[Any, str | None]:
    """As xmlrpc.client's `loads`: the parameters, and the method of a call. Fault is the peer's own word; RosError for
    what is no XML-RPC, or is made to do harm.

    The library's own parser expands entities, so that a few hundred bytes become as much memory as the peer wants, and
    reads numbers of any length, which takes the square of the length. No ROS peer needs either.
    """
    values = _Values()
    parser = expat.ParserCreate()
    parser.StartElementHandler = values.start
    parser.EndElementHandler = values.end
    parser.CharacterDataHandler = values.data
    parser.StartDoctypeDeclHandler = _refuse  # entities are declared in a document type alone
    values.xml("", None)  # expat hands on text, which nobody has to decode
    try:
        parser.Parse(body, True)
        return values.close(), values.getmethodname()
    except (RosError, xmlrpc.client.Fault):
        raise
    except Exception as error:  # of the library, which has no list of what it raises
        raise RosError(f"it is nonsense ({type(error).__name__}: {str(error)[:100]})") from error


def _refuse(*_: Any) -> None:
    raise RosError("a document type or entities are declared, which no ROS peer does")


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
    stats: Stats | None = None


def unwrap(reply: Any) -> Any:
    """The value of a `[code, message, value]` reply; RefusalError with the peer's message where the code is not 1."""
    shaped = isinstance(reply, (list, tuple)) and len(reply) >= 3
    if not shaped or isinstance(reply[0], bool) or not isinstance(reply[0], int):
        raise RosError("the reply is not [code, message, value]")
    if reply[0] != 1:
        raise RefusalError(str(reply[1])[:200] or f"refused with code {reply[0]}")
    return reply[2]


def rows(raw: Any, least: int) -> Iterable[Any]:
    """The rows of a list of lists that are at least so long; anything else is left out."""
    if isinstance(raw, (list, tuple)):
        for row in raw:
            if isinstance(row, (list, tuple)) and len(row) >= least:
                yield row


def registrations(raw: Any) -> dict[str, tuple[str, ...]]:
    """One third of getSystemState's value."""
    found: dict[str, tuple[str, ...]] = {}
    for name, nodes, *_more in rows(raw, 2):
        if isinstance(name, str) and isinstance(nodes, (list, tuple)):
            found[name] = tuple(sorted({node for node in nodes if isinstance(node, str)}))
    return found


def topic_types(raw: Any) -> dict[str, str]:
    """[[topic, type], ...] as getTopicTypes, getPublications and getSubscriptions give it."""
    return {row[0]: row[1] for row in rows(raw, 2) if isinstance(row[0], str) and isinstance(row[1], str)}


def master_state(system_state: Any, types: Any = None) -> MasterState:
    """getSystemState's and getTopicTypes' values."""
    if not isinstance(system_state, (list, tuple)) or len(system_state) < 3:
        raise RosError("the master's system state is not [publishers, subscribers, services]")
    publishers, subscribers, services = (registrations(part) for part in system_state[:3])
    return MasterState(publishers, subscribers, services, topic_types(types))


def connections(raw: Any) -> tuple[Connection, ...]:
    """getBusInfo's value: [id, peer, direction, transport, topic, connected, ...]; older nodes end after the topic."""
    found = []
    for row in rows(raw, 5):
        peer, direction, transport, topic = row[1:5]
        if all(isinstance(value, str) for value in (peer, direction, transport, topic)):
            connected = bool(row[5]) if len(row) > 5 else True
            number = row[0] if isinstance(row[0], int) else -1
            found.append(Connection(topic, peer, direction, transport, connected, number))
    return tuple(found)


def shared_uris(uris: Mapping[str, str]) -> frozenset[str]:
    """Nodes registered under an address that another node has, too: only one of them can be who it says."""
    nodes: dict[str, list[str]] = {}
    for name, uri in uris.items():
        nodes.setdefault(uri, []).append(name)
    return frozenset(name for uri, names in nodes.items() if uri and len(names) > 1 for name in names)


def _node(state: MasterState, name: str, answer: NodeAnswer, doubtful: bool) -> Node:
    has = state.graph.node(name)
    own = {**topic_types(answer.subscriptions), **topic_types(answer.publications)}
    pid, error = answer.pid, answer.error
    if doubtful and pid is not None and any(topic not in own for topic in (*has.publications, *has.subscriptions)):
        pid, error = None, f"another node answers at {answer.uri}: a stale registration"
    bus = connections(answer.bus) if pid is not None and answer.bus is not None else None
    said = replace(has, uri=answer.uri, pid=pid, asked=True, error=error, refused=answer.refused)
    return replace(said, own_types=own, connections=bus, stats=answer.stats)


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
    topics, services, actions = dict(graph.topics), dict(graph.services), dict(graph.actions)
    for name, found in edges.items():
        topics[name] = replace(topics[name], connections=tuple(sorted(found)))
    for name, probe in (probes or {}).items():
        if name in services:
            services[name] = replace(services[name], probe=probe)
    for name, read in (statuses or {}).items():
        of_each = {graph.node(server).key: one for server, one in read.items()}
        actions[name] = replace(graph.action(name), statuses=of_each)
    return replace(graph, topics=topics, services=services, actions=actions)
