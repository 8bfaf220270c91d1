# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""What became of the processes that launch files have started, by the apps that they belong to. Pure.

A crash is a problem. A process that has ended nobody knows how may have done its work: a row, for a person to judge.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

Row = dict[str, Any]
Owner = tuple[str, str]  # robot, app


def apps_of(graph: str, apps: Iterable[Row], shared: str) -> list[Row]:
    """Those whose nodes may be in the graph of a robot, or in that of the name `shared`, which is all robots'."""
    return [row for row in apps if graph == shared or row["robot"] in (graph, shared)]


def launched_rows(
    apps: Iterable[Row], graphs: Mapping[str, Mapping[str, Any]], shared: str
) -> tuple[list[Row], list[Row]]:
    """Problems, and processes that have ended nobody knows how. `graphs` are those of ros_graph_info by robot."""
    rows = list(apps)
    problems: list[Row] = []
    ended: list[Row] = []
    for robot, graph in sorted(graphs.items()):
        owners = _owners(apps_of(robot, rows, shared))
        for child in graph.get("launched") or ():
            of, app = owners.get(child["host"], (robot, ""))
            if child["crash"]:
                where = f"app {app} of {of}" if app else f"launch file at {child['host']} of {of}"
                problems.append({"where": where, "what": f"{child['node']} {child['crash']}"})
            elif not child["alive"] and child["exit_code"] is None:
                ended.append({"robot": of, "app": app, "node": child["node"], "host": child["host"]})
    return problems, ended


def _owners(apps: Iterable[Mapping[str, Any]]) -> dict[str, Owner]:
    """Address -> whose it is. One that several apps have (that of the host, where they share its network) tells
    nothing."""
    found: dict[str, set[Owner]] = {}
    for row in apps:
        for address in row.get("addresses") or ():
            found.setdefault(address, set()).add((row["robot"], row["name"]))
    return {address: owners.pop() for address, owners in found.items() if len(owners) == 1}
