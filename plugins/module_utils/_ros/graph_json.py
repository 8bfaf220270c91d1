# SPDX-License-Identifier: GPL-3.0-or-later
"""The graph as JSON-able data, the shape that ros_graph_info returns, and back. Pure."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any, Iterable

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


def graph_data(graph: Graph, definitions: bool = False) -> Data:
    """Nodes are called by their names alone. `definitions`: with the texts of topics' types."""
    return {
        "nodes": {name: _node_data(graph.node(name)) for name in graph.names},
        "topics": {name: _topic_data(topic, definitions) for name, topic in sorted(graph.topics.items())},
        "services": {name: _service_data(service) for name, service in sorted(graph.services.items())},
        "actions": {name: _action_data(action) for name, action in sorted(graph.actions.items())},
    }


def graph_from(data: Document) -> Graph:
    """What `graph_data` made, or somebody wrote by hand: what is missing is not known.

    AttributeError, KeyError, TypeError or ValueError where it is no graph.
    """
    nodes = {name: _node_of(name, one) for name, one in data.get("nodes", {}).items()}

    def keys(names: Iterable[str] | None) -> Keys:
        return tuple(nodes[name].key if name in nodes else NodeKey(name) for name in names or ())

    def topic(name: str, one: Document) -> Topic:
        edges, rates, unsteady = one.get("connections") or (), one.get("rates") or {}, one.get("unsteady") or {}
        return Topic(
            name,
            one.get("type") or "",
            keys(one.get("publishers")),
            keys(one.get("subscribers")),
            tuple(zip(keys(edge["publisher"] for edge in edges), keys(edge["subscriber"] for edge in edges))),
            one.get("rate"),
            dict(zip(keys(rates), rates.values())),
            dict(zip(keys(unsteady), unsteady.values())),
            keys(one.get("latched")),
            one.get("rate_error") or "",
            one.get("md5sum") or "",
            one.get("definition"),
        )

    def action(name: str, one: Document) -> Action:
        servers, clients = keys(one.get("servers")), keys(one.get("clients"))
        return Action(name, one.get("type") or "", servers, clients, _statuses_of(one, servers))

    def service(name: str, one: Document) -> Service:
        return Service(name, keys(one.get("providers")), _probe_of(one))

    return Graph(
        {node.key: node for node in nodes.values()},
        {name: topic(name, one) for name, one in data.get("topics", {}).items()},
        {name: service(name, one) for name, one in data.get("services", {}).items()},
        {name: action(name, one) for name, one in data.get("actions", {}).items()},
    )


def _node_data(node: Node) -> Data:
    said = {"uri": node.uri, "pid": node.pid, "reachable": node.reachable, "error": node.error, "refused": node.refused}
    return {**said, **{part: list(getattr(node, part)) for part in PARTS}}


def _node_of(name: str, data: Document) -> Node:
    uri, error, refused = data.get("uri") or "", data.get("error") or "", bool(data.get("refused"))
    pid = data.get("pid") if data.get("reachable", True) else None
    has: Any = {part: tuple(data.get(part) or ()) for part in PARTS}
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


def _service_data(service: Service) -> Data:
    said = asdict(service.said)
    return {"providers": names_of(service.providers), **said, "up": service.up}


def _probe_of(data: Document) -> ServiceProbe | None:
    parts = {part: data.get(part) or "" for part in ("uri", "provider", "type", "error", "md5sum")}
    return ServiceProbe(**parts) if data.get("up", bool(parts["uri"])) or parts["error"] else None


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
    told = (data.get("goals") or {}).items()
    goals = tuple(numbers[word] if word in numbers else int(word) for word, count in told for _one in range(count))
    return {servers[0]: StatusReading((goals,))} if data.get("up") and servers else {}
