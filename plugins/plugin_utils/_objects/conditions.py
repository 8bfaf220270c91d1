# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""What the ROS graph of a robot must show when all its apps are up. Pure."""

from __future__ import annotations

from typing import Any

from ...module_utils._ros.names import resolve
from .._model import context, names
from .._model.app import USUAL, App
from .._model.context import Robot
from .app import app_deployment
from .pod_settings import full_name


def graph_conditions(robot: Robot) -> dict[str, Any]:
    """Options of ros_ready, every name in full.

    `{nodes, topics, services, actions, absent, timeout, interval, consecutive}`, and `master_uri` for an external
    master only: the address of a master in the cluster is known to the cluster (its Service), not to the inventory.
    """
    lists: dict[str, list[Any]] = {key: [] for key in ("nodes", "topics", "services", "actions", "absent")}
    for app in robot.apps:
        for kind, items in _app_conditions(app, robot).items():
            lists[kind] += [item for item in items if item not in lists[kind]]
    ready = [app.readiness for app in robot.apps] or [USUAL]
    return {
        **lists,
        "timeout": max(item.timeout for item in ready),
        "interval": min(item.interval for item in ready),
        "consecutive": max(item.consecutive for item in ready),
        **({"master_uri": robot.master.uri} if robot.master.mode == "external" else {}),
    }


def _app_conditions(app: App, robot: Robot) -> dict[str, list[Any]]:
    metadata = app_deployment(app, robot)["spec"]["template"]["metadata"]
    # those of a launch file are not promised
    node = metadata["annotations"].get(names.ANNOTATION_NODE) or context.graph_node(app, robot)
    readiness = app.readiness

    def full(name: str) -> str:
        return resolve(full_name(name, app, robot), "/", node)

    return {
        "nodes": [node] if readiness.nodes else [],
        "topics": [{**item, "name": full(item["name"])} for item in readiness.topics],
        "services": [{**item, "name": full(item["name"])} for item in readiness.services],
        "actions": [{**item, "name": full(item["name"])} for item in readiness.actions],
        "absent": [full(name) for name in readiness.absent],
    }
