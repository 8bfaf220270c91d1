# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Of a ROS graph: which node runs where, who hears whom on what, and who should but does not. Pure.

The five topics of an action are one link, and a topic that nobody listens to is none.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Iterator
from typing import Any

from ansible_collections.rosops.fleet.plugins.module_utils._ros.contract import ACTION_TOPICS
from ansible_collections.rosops.fleet.plugins.module_utils._ros.graph import Graph, Topic, host_of, names_of
from ansible_collections.rosops.fleet.plugins.plugin_utils._report.launched import apps_of, owners_of

Row = dict[str, Any]
PLUMBING_TOPICS = frozenset({"/rosout", "/rosout_agg", "/clock"})


class Places:
    """Where ROS nodes run, and for which app, by the addresses that they are registered with. `apps`: masters, too."""

    def __init__(self, apps: Iterable[Row], nodes: Iterable[Row]) -> None:
        self._apps = list(apps)
        self._nodes = {str(row["address"]): str(row["name"]) for row in nodes if row.get("address")}

    def of(self, graph: str, uri: str) -> dict[str, str]:
        """`at`: the host, or the bare address of a process that no pod of ours has. `app`: empty where nobody knows."""
        address = host_of(uri)
        here = [row for row in apps_of(graph, self._apps) if address in row.get("addresses", ())]
        if len(_hosts(here)) > 1:  # pods of two clusters may have it: then the robot's own is meant
            here = [row for row in here if row["robot"] == graph]
        hosts = _hosts(here)
        at = hosts.pop() if len(hosts) == 1 else self._nodes.get(address, address)
        return {"at": at, "app": owners_of(here).get(address, ("", ""))[1]}


def _hosts(rows: Iterable[Row]) -> set[str]:
    return {host for row in rows for host in row["nodes"]}


def links(robot: str, graph: Graph) -> list[Row]:
    """Who hears whom: robot, name, action, publishers, subscribers, and as `broken` the pairs of these that are
    registered, alive and not connected."""
    of_actions = {f"{name}/{part}" for name in graph.actions for part in ACTION_TOPICS}
    found = [_action_link(name, graph) for name in sorted(graph.actions)]
    found += [
        _link(name, topic, graph)
        for name, topic in sorted(graph.topics.items())
        if name not in of_actions | PLUMBING_TOPICS
    ]
    return [{"robot": robot, **link} for link in found if link["subscribers"]]


def _link(name: str, topic: Topic, graph: Graph) -> Row:
    return {
        "name": name,
        "action": False,
        "publishers": names_of(topic.publishers),
        "subscribers": names_of(topic.subscribers),
        "broken": list(_broken(topic, graph)),
    }


def _broken(topic: Topic, graph: Graph) -> Iterator[list[str]]:
    """By the publishers' own word. What a node that does not answer is connected to, nobody knows."""
    for ends in itertools.product(topic.publishers, topic.subscribers):
        if all(graph.at(end).reachable for end in ends) and ends not in topic.connections:
            yield names_of(ends)


def _action_link(name: str, graph: Graph) -> Row:
    """From its clients to its server; goals have to get there, results have to come back."""
    goal, result = graph.topic(f"{name}/goal"), graph.topic(f"{name}/result")
    clients = names_of(goal.publishers)
    back = [[client, server] for server, client in _broken(result, graph)]
    broken = [*_broken(goal, graph), *(pair for pair in back if pair[0] in clients)]
    pairs = [list(pair) for pair in dict.fromkeys(map(tuple, broken))]
    return {**_link(name, goal, graph), "action": True, "broken": pairs}
