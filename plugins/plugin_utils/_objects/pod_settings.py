# SPDX-License-Identifier: GPL-3.0-or-later
"""What our code in pods has to know: of its app, and the keeper of when its robot may be changed. Pure.

The former is part of the pod template: another readiness is another revision, which is proven and taken back as an
image is. The latter stands beside the Deployments (`_robot/door.py` reads it): what is changed there is no step, and
restarts nothing.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from typing import Any

from ...module_utils._ros.names import resolve
from ...module_utils._step.objects import Object
from ...module_utils._step.words import REST, REST_KEY
from .._model import context
from .._model.app import App, ReadyTopic
from .._model.context import Robot
from .common import config_map, owner_labels
from .pod_code import probe_command

GATE = ("app", "node", "expect_node", "min_rates", "space", "on_demand")


def app_settings(app: App, robot: Robot) -> dict[str, Any]:
    """What the code in an app's pod has to know of it.

    Names are full but for private ones that follow the node's name of a revision: those keep their `~`.
    """
    readiness, command, launch, overlaps = app.readiness, app.readiness.command, app.launch, app.handoff == "overlap"
    # the rate of a topic with several publishers is their sum, of which a pod sees its own part only
    rated = [topic for topic in readiness.topics if topic.get("min_rate") and (topic.get("publishers") or 1) < 2]
    params = {_param(name): value for name, value in app.params.items()}
    keep = [_param(name) for name in app.keep_params]
    more = {
        "launch": app.handoff if launch else "",
        "held": list(launch.replace) if launch and overlaps else [],
        "on_demand": overlaps and app.on_demand,
        "keep_params": keep,
    }
    return {
        "app": app.name,
        "node": context.graph_node(app, robot),
        "expect_node": readiness.nodes,
        "actions": [full_name(action["name"], app, robot) for action in readiness.actions],
        "stop_deadline": app.stop_deadline,
        "command": probe_command(command) if command and app.hooks == "app" else None,
        "min_rates": {full_name(topic["name"], app, robot): topic["min_rate"] for topic in rated},
        "keeper": context.keeper_uri(robot),
        "host_network": app.host_network,
        "space": context.robot_space(app, robot),
        **({"params": params} if params or keep else {}),
        **{key: value for key, value in more.items() if value},
    }


def gate_settings(app: App, robot: Robot) -> dict[str, Any]:
    """The part of it that a look from outside needs."""
    whole = app_settings(app, robot)
    return {key: whole[key] for key in GATE if key in whole}


def promised(robot: Robot) -> Iterator[tuple[str, App, ReadyTopic]]:
    """The topics that readiness says to be published, with their apps and what is said."""
    for app in robot.apps:
        for said in app.readiness.topics:
            topic = full_name(said["name"], app, robot)  # the graph alone knows a private one of a revision
            if (said.get("publishers") or said.get("min_rate")) and not topic.startswith("~"):
                yield topic, app, said


def full_name(name: str, app: App, robot: Robot) -> str:
    """As the graph has it; a private one that follows the node's name of a revision stays as it is."""
    kept = app.handoff != "overlap" or name[1:].lstrip("/") in app.private_names
    if name.startswith("~") and not kept:
        return f"~{name[1:].lstrip('/')}"
    return resolve(name, context.graph_namespace(app, robot), context.graph_node(app, robot))


def _param(name: str) -> str:
    return name if name.startswith("/") else f"~{name}"


def rest_maps(robot: Robot) -> list[Object]:
    """The ConfigMap `robot-rest`."""
    of_all = context.wanted_before(robot)
    apps = {
        app.name: {"when": context.wanted_before(robot, [app])[len(of_all) :], "idle": resting(app, robot)}
        for app in robot.apps
        if app.scope == "robot"  # nobody holds what is the whole fleet's by one robot
    }
    said = {"space": context.own_space(robot), "when": of_all, "windows": robot.windows.kept, "apps": apps}
    data = {REST_KEY: json.dumps(said, sort_keys=True)}
    return [config_map(REST, robot.namespace, owner_labels(robot.name), data)]


def resting(app: App, robot: Robot) -> list[str]:
    """Actions that have to be idle by the app's word, beside those that the graph shows its nodes to serve."""
    served = [item["name"] for item in app.readiness.actions] if app.handoff == "drain" else []
    space, node = context.graph_namespace(app, robot), context.graph_node(app, robot)
    return [resolve(name, space, node) for name in (*served, *app.update.idle)]
