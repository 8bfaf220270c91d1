# SPDX-License-Identifier: GPL-3.0-or-later
"""The graph as JSON-able data, the shape that ros_graph_info returns, and back. Pure."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

from .._common.documents import Data, Document
from .graph import (
    GOAL_STATES,
    PARTS,
    Action,
    Graph,
    Keys,
    Node,
    NodeKey,
    Service,
    ServiceProbe,
    StatusReading,
    Topic,
    names_of,
)

MOST_GOALS = 10_000  # of a state; more make no difference to anybody


def graph_data(graph: Graph, definitions: bool = False) -> Data:
    """Nodes are called by their names alone. `definitions`: with the texts of topics' types."""
    return {
        "nodes": {name: _node_data(graph.node(name)) for name in graph.names},
        "topics": {name: _topic_data(topic, definitions) for name, topic in sorted(graph.topics.items())},
        "services": {
            name: {"providers": names_of(one.providers), **asdict(one.said), "up": one.up}
            for name, one in sorted(graph.services.items())
        },
        "actions": {name: _action_data(action) for name, action in sorted(graph.actions.items())},
    }


def graph_from(data: Document) -> Graph:
    """What `graph_data` made, or somebody wrote by hand: what is missing is not known.

    AttributeError, KeyError, TypeError or ValueError where it is no graph.
    """
    nodes = {name: _node_of(name, one) for name, one in data.get("nodes", {}).items()}

    def keys(names: Any) -> Keys:
        return tuple(nodes[name].key if name in nodes else NodeKey(name) for name in _texts(names))

    def topic(name: str, one: Document) -> Topic:
        edges, rates, unsteady = one.get("connections") or (), one.get("rates") or {}, one.get("unsteady") or {}
        return Topic(
            name,
            _text(one.get("type")),
            keys(one.get("publishers")),
            keys(one.get("subscribers")),
            tuple(zip(keys([edge["publisher"] for edge in edges]), keys([edge["subscriber"] for edge in edges]))),
            None if one.get("rate") is None else _number(one["rate"]),
            {key: _number(hz) for key, hz in zip(keys([*rates]), rates.values())},
            {key: _number(hz) for key, hz in zip(keys([*unsteady]), unsteady.values())},
            keys(one.get("latched")),
            _text(one.get("rate_error")),
            _text(one.get("md5sum")),
            None if one.get("definition") is None else _text(one["definition"]),
        )

    def action(name: str, one: Document) -> Action:
        servers, clients = keys(one.get("servers")), keys(one.get("clients"))
        return Action(name, _text(one.get("type")), servers, clients, _statuses_of(one, servers))

    def service(name: str, one: Document) -> Service:
        said = {part: _text(one.get(part)) for part in ("uri", "provider", "type", "error", "md5sum")}
        asked = one.get("up", bool(said["uri"])) or said["error"]
        return Service(name, keys(one.get("providers")), ServiceProbe(**said) if asked else None)

    return Graph(
        {node.key: node for node in nodes.values()},
        {name: topic(name, one) for name, one in data.get("topics", {}).items()},
        {name: service(name, one) for name, one in data.get("services", {}).items()},
        {name: action(name, one) for name, one in data.get("actions", {}).items()},
    )


def _text(value: Any) -> str:
    if value is not None and not isinstance(value, str):
        raise TypeError(f"{type(value).__name__} where there is to be a text")
    return value or ""


def _texts(values: Any) -> tuple[str, ...]:
    if values is not None and not isinstance(values, (list, tuple)):
        raise TypeError(f"{type(values).__name__} where there is to be a list")
    return tuple(map(_text, values or ()))


def _number(value: Any) -> float:
    if not isinstance(value, (int, float)):
        raise TypeError(f"{type(value).__name__} where there is to be a number")
    return value


def _node_data(node: Node) -> Data:
    said = {"uri": node.uri, "pid": node.pid, "reachable": node.reachable, "error": node.error, "refused": node.refused}
    return {**said, **{part: list(getattr(node, part)) for part in PARTS}}


def _node_of(name: str, data: Document) -> Node:
    uri, error, refused = _text(data.get("uri")), _text(data.get("error")), bool(data.get("refused"))
    known = data.get("reachable", True) and data.get("pid") is not None
    pid = int(_number(data["pid"])) if known else None
    has: Any = {part: _texts(data.get(part)) for part in PARTS}
    return Node(name, uri, pid, bool(uri or error), error, **has, refused=refused)


def _topic_data(topic: Topic, definitions: bool) -> Data:
    ends = {"publishers": topic.publishers, "subscribers": topic.subscribers, "latched": topic.latched}
    text = {"definition": topic.definition} if definitions and topic.definition is not None else {}
    return {
        "type": topic.type,
        "md5sum": topic.md5sum or None,
        **{role: names_of(keys) for role, keys in ends.items()},
        "connections": [{"publisher": key.name, "subscriber": peer.name} for key, peer in topic.connections],
        "rate": topic.rate,
        "rates": {key.name: hz for key, hz in topic.rates.items()},
        "unsteady": {key.name: hz for key, hz in topic.unsteady.items()},
        "rate_error": topic.rate_error,
        **text,
    }


def _action_data(action: Action) -> Data:
    states = [GOAL_STATES.get(state, str(state)) for listed in action.goals.values() for state in listed]
    return {
        "type": action.type,
        "servers": names_of(action.servers),
        "clients": names_of(action.clients),
        "up": action.up,
        "busy": action.busy,
        "goals": {state: states.count(state) for state in sorted(set(states))},
    }


def _statuses_of(data: Document, servers: Keys) -> dict[NodeKey, StatusReading]:
    """JSON does not say whose an action's goals are: they are the first server's."""
    numbers = {word: number for number, word in GOAL_STATES.items()}
    told = [(word, min(count, MOST_GOALS)) for word, count in (data.get("goals") or {}).items()]
    goals = tuple(numbers[word] if word in numbers else int(word) for word, count in told for _one in range(count))
    return {servers[0]: StatusReading((goals,))} if data.get("up") and servers else {}
