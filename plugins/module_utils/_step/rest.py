# SPDX-License-Identifier: GPL-3.0-or-later
"""Whose nodes are changed, and what has to rest before that: for runs and for the keeper alike. Pure."""

from __future__ import annotations

from typing import Collection, Iterable, Mapping

from .._ros.graph import Graph, host_of, names_of
from .._ros.names import is_tool
from .objects import Object, address_of, app_of

MARGIN = 2.0  # seconds beyond those for which something has to be quiet, to see that


def own_nodes(
    named: Mapping[str, str], graph: Graph, pods: Iterable[Object], versions: Mapping[str, str] | None = None
) -> dict[str, list[str]]:
    """App -> its nodes, that of `named` first, whether it is in the graph or not.

    What a launch file starts has names of its own, but its pod's address, and where versions overlap the version behind
    its names (`versions`), whichever pod is there by now. An address of several apps' pods (that of the host, where
    they share its network) tells nothing.
    """
    apps_at: dict[str, set[str]] = {}
    for pod in filter(address_of, pods):
        apps_at.setdefault(address_of(pod), set()).add(app_of(pod))
    at = [(node.name, host_of(node.uri)) for name in graph.names if not is_tool(name) for node in graph.named(name)]
    found = {}
    for app, name in named.items():
        version = (versions or {}).get(app) or "/"  # with which no name ends
        others = [node for node, address in at if apps_at.get(address) == {app} or node.endswith(version)]
        found[app] = list(dict.fromkeys([*([name] if name else []), *others]))
    return found


def nodes_below(graph: Graph, space: str) -> list[str]:
    """A robot's nodes but somebody's tools; `space` is its ROS namespace, `/` where it has a master of its own."""
    return [name for name in graph.names if name.startswith(f"{space.rstrip('/')}/") and not is_tool(name)]


def actions_to_rest(graph: Graph, nodes: Collection[str], besides: Iterable[str] = ()) -> list[dict[str, str]]:
    """Actions that have to be idle before these nodes are replaced: those that the nodes serve on the graph, whether or
    not the inventory lists them, and `besides`.

    `server` stands where it is one of them: goals that come meanwhile are for the next one. An action that nobody
    serves cannot be busy. A server that lives and tells nothing may be.
    """
    # nothing listens where a dead one was; one that only does not answer may be at work
    served = {
        name: names_of(key for key in action.servers if not graph.at(key).refused)
        for name, action in graph.actions.items()
    }
    replaced = {name: [one for one in servers if one in nodes] for name, servers in served.items()}
    wanted = dict.fromkeys([*(name for name in sorted(replaced) if replaced[name]), *besides])
    return [
        {"name": name, **({"server": replaced[name][0]} if replaced[name] else {})}
        for name in wanted
        if served.get(name)
    ]
