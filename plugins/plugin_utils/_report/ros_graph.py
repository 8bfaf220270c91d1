# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Of a ROS graph: which node runs where, who hears whom on what, and who should but does not. Pure.

The five topics of an action are one link, and a topic that nobody listens to is none.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from typing import Any

from ansible_collections.rosops.fleet.plugins.module_utils._ros.graph import host_of
from ansible_collections.rosops.fleet.plugins.plugin_utils._report.launched import apps_of, owners_of

Row = dict[str, Any]
PLUMBING_TOPICS = frozenset({"/rosout", "/rosout_agg", "/clock"})
ACTION_TOPICS = ("goal", "cancel", "status", "feedback", "result")


class Places:
    """Where ROS nodes run, and for which app, by the addresses that they are registered with. `apps`: masters, too."""

    def __init__(self, apps: Iterable[Row], nodes: Iterable[Row]) -> None:
        self._apps = list(apps)
        self._nodes = {str(row["address"]): str(row["name"]) for row in nodes if row.get("address")}

    def of(self, graph: str, node: Mapping[str, Any]) -> dict[str, str]:
        """`at`: the host, or the bare address of a process that no pod of ours has. `app`: empty where nobody knows."""
        address = host_of(str(node.get("uri") or ""))
        here = [row for row in apps_of(graph, self._apps) if address in row.get("addresses", ())]
        if len(_hosts(here)) > 1:  # pods of two clusters may have it: then the robot's own is meant
            here = [row for row in here if row["robot"] == graph]
        hosts = _hosts(here)
        at = hosts.pop() if len(hosts) == 1 else self._nodes.get(address, address)
        return {"at": at, "app": owners_of(here).get(address, ("", ""))[1]}


def _hosts(rows: Iterable[Row]) -> set[str]:
    return {host for row in rows for host in row["nodes"]}


def links(robot: str, graph: Mapping[str, Any]) -> list[Row]:
    """Who hears whom: robot, name, action, publishers, subscribers, and as `broken` the pairs of these that are
    registered, alive and not connected."""
    topics = {name: one for name, one in (graph.get("topics") or {}).items() if name not in PLUMBING_TOPICS}
    up = {name for name, node in (graph.get("nodes") or {}).items() if node.get("reachable")}
    actions = graph.get("actions") or {}
    of_actions = {f"{name}/{part}" for name in actions for part in ACTION_TOPICS}
    found = [_action_link(name, topics, up) for name in sorted(actions)]
    found += [_link(name, topic, up) for name, topic in sorted(topics.items()) if name not in of_actions]
    return [{"robot": robot, **link} for link in found if link["subscribers"]]


def _link(name: str, topic: Mapping[str, Any], up: set[str]) -> Row:
    return {
        "name": name,
        "action": False,
        "publishers": list(topic.get("publishers") or []),
        "subscribers": list(topic.get("subscribers") or []),
        "broken": list(_broken(topic, up)),
    }


def _broken(topic: Mapping[str, Any], up: set[str]) -> Iterator[list[str]]:
    """By the publishers' own word. What a node that does not answer is connected to, nobody knows."""
    there = {(one.get("publisher"), one.get("subscriber")) for one in topic.get("connections") or []}
    for publisher in topic.get("publishers") or []:
        for subscriber in topic.get("subscribers") or []:
            if publisher in up and subscriber in up and (publisher, subscriber) not in there:
                yield [publisher, subscriber]


def _action_link(name: str, topics: Mapping[str, Mapping[str, Any]], up: set[str]) -> Row:
    """From its clients to its server; goals have to get there, results have to come back."""
    goal, result = (topics.get(f"{name}/{part}", {}) for part in ("goal", "result"))
    back = [[client, server] for server, client in _broken(result, up)]
    broken = [*_broken(goal, up), *(pair for pair in back if pair[0] in (goal.get("publishers") or []))]
    pairs = [list(pair) for pair in dict.fromkeys(map(tuple, broken))]
    return {**_link(name, goal, up), "action": True, "broken": pairs}
