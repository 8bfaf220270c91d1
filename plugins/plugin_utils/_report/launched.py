# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""What became of the processes that launch files have started, by the apps that they belong to. Pure.

A crash is a problem. A process that has ended nobody knows how may have done its work: a row, for a person to judge.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from ansible_collections.rosops.fleet.plugins.plugin_utils._model import names

SHARED = "(shared)"  # whose the graph of a shared master is
Row = dict[str, Any]
Owner = tuple[str, str]  # robot, app


def apps_of(graph: str, apps: Iterable[Row]) -> list[Row]:
    """Those whose nodes may be in the graph of a robot, or in the shared one, which is all robots'."""
    return [row for row in apps if graph == SHARED or row["robot"] in (graph, SHARED)]


def launched_rows(apps: Iterable[Row], graphs: Mapping[str, Mapping[str, Any]]) -> tuple[list[Row], list[Row]]:
    """Problems, and processes that have ended nobody knows how. `graphs` are those of ros_graph_info by robot."""
    rows = list(apps)
    problems: list[Row] = []
    ended: list[Row] = []
    for robot, graph in sorted(graphs.items()):
        owners = owners_of(apps_of(robot, rows))
        for child in graph.get("launched") or ():
            of, app = owners.get(child["host"], (robot, ""))
            if child["crash"]:
                where = f"app {app} of {of}" if app else f"launch file at {child['host']} of {of}"
                what = f"{child['node']} {child['crash']}"
                problems.append({"where": where, "what": what, "todo": logs_of(of, app) if app else ""})
            elif not child["alive"] and child["exit_code"] is None:
                ended.append({"robot": of, "app": app, "node": child["node"], "host": child["host"]})
    return problems, ended


def logs_of(robot: str, app: str, more: str = "") -> str:
    """How one reads what an app has written."""
    namespace = names.FLEET_NAMESPACE if robot == SHARED else names.robot_namespace(robot)
    return f"k3s kubectl -n {namespace} logs deploy/{app}{more}"


def owners_of(apps: Iterable[Mapping[str, Any]]) -> dict[str, Owner]:
    """Address -> whose it is. One that several apps have (that of the host, where they share its network) tells
    nothing."""
    found: dict[str, set[Owner]] = {}
    for row in apps:
        for address in row.get("addresses") or ():
            found.setdefault(address, set()).add((row["robot"], row["name"]))
    return {address: owners.pop() for address, owners in found.items() if len(owners) == 1}
