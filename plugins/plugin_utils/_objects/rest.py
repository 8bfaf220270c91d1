# SPDX-License-Identifier: GPL-3.0-or-later
"""When a robot may be changed, as its keeper reads it (`_robot/door.py`). Pure.

It stands beside the Deployments and not in them: what is changed here is no step, and restarts nothing.
"""

from __future__ import annotations

import json

from ...module_utils._ros.names import resolve
from ...module_utils._step.objects import Object
from ...module_utils._step.words import REST, REST_KEY
from .._model import context
from .._model.app import App
from .._model.context import Robot
from .common import config_map, owner_labels


def rest_maps(robot: Robot) -> list[Object]:
    """The ConfigMap `robot-rest`; none for an external master, which has no keeper."""
    if robot.master.mode == "external":
        return []
    of_all = context.wanted_before(robot)
    apps = {
        app.name: {"when": context.wanted_before(robot, [app])[len(of_all) :], "idle": _idle(app, robot)}
        for app in robot.apps
        if app.scope == "robot"  # nobody holds what is the whole fleet's by one robot
    }
    said = {"space": context.own_space(robot), "when": of_all, "windows": robot.windows.kept, "apps": apps}
    data = {REST_KEY: json.dumps(said, sort_keys=True)}
    return [config_map(REST, robot.namespace, owner_labels(robot.name), data)]


def _idle(app: App, robot: Robot) -> list[str]:
    """Actions that have to be idle beside those that the graph shows its nodes to serve."""
    served = [item["name"] for item in app.readiness.actions] if app.handoff == "drain" else []
    space, node = context.graph_namespace(app, robot), context.graph_node(app, robot)
    return [resolve(name, space, node) for name in (*served, *app.update.idle)]
