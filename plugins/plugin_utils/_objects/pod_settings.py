# SPDX-License-Identifier: GPL-3.0-or-later
"""An app -> what the code in its pod has to know of it. Pure.

It is part of the pod template: another readiness is another revision, which is proven and taken back as an image is.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from ...module_utils._ros.names import resolve
from .._model import context
from .._model.app import App, ReadyTopic
from .._model.context import Robot
from .pod_code import probe_command

GATE = ("app", "node", "expect_node", "min_rates", "space", "on_demand")


def app_settings(app: App, robot: Robot) -> dict[str, Any]:
    """What the code in an app's pod has to know of it.

    Names are full but for private ones that follow the node's name of a revision: those keep their `~`.
    """
    readiness, command, overlaps = app.readiness, app.readiness.command, app.handoff == "overlap"
    # the rate of a topic with several publishers is their sum, of which a pod sees its own part only
    rated = [topic for topic in readiness.topics if topic.get("min_rate") and (topic.get("publishers") or 1) < 2]
    params = {_param(name): value for name, value in app.params.items()}
    keep = [_param(name) for name in app.keep_params]
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
        **({"launch": app.handoff} if app.launch else {}),
        **({"held": list(app.launch.replace)} if overlaps and app.launch and app.launch.replace else {}),
        **({"on_demand": True} if overlaps and app.on_demand else {}),
        **({"params": params} if params or keep else {}),
        **({"keep_params": keep} if keep else {}),
    }


def gate_settings(app: App, robot: Robot) -> dict[str, Any]:
    """The part of it that a look from outside needs."""
    whole = app_settings(app, robot)
    return {key: whole[key] for key in GATE if key in whole}


def promised(robot: Robot) -> Iterator[tuple[str, App, ReadyTopic]]:
    """The topics that readiness says to be published, with their apps and what is said.

    Which name a private one of a revision has, the graph alone knows.
    """
    for app in robot.apps:
        for said in app.readiness.topics:
            topic = full_name(said["name"], app, robot)
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
