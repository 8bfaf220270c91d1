# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""A robot's ctx and the in-pod code -> the ConfigMaps that pods mount. Pure.

Neither the code nor an app's settings are part of a pod template: a newer collection, or another readiness, restarts
nothing.
"""

from __future__ import annotations

import json
from typing import Any, Mapping

from ansible_collections.rosops.fleet.plugins.plugin_utils._model import context, names
from ansible_collections.rosops.fleet.plugins.plugin_utils._objects.app import probe_command

STOP_SECONDS = 5  # for a node to end that has nothing to drain


def hook_objects(ctx: Mapping[str, Any], code: Mapping[str, str]) -> list[dict[str, Any]]:
    """The ConfigMaps `rosops-hooks`, one per namespace that has pods with hooks; `code` is file name -> content.

    The one of the namespace `fleet` holds code alone, so that it is the same whichever robot it comes from; apps of
    scope `fleet` have a map of their own beside it.
    """
    full = context.complete_context(ctx)
    hooked = [app for app in full["apps"] if app["hooks"]]
    own = [app for app in hooked if app["scope"] != "fleet"]
    shared = [app for app in hooked if app["scope"] == "fleet"]
    mode, robot = full["master"]["mode"], full["robot"]
    objects = []
    if own or mode == "robot":  # the keeper of a master mounts it, too
        settings = dict(_settings_file(app, full) for app in own)
        objects.append(_config_map(names.HOOKS_NAME, full["namespace"], robot, {**code, **settings}))
    if shared or mode == "shared":
        objects.append(_config_map(names.HOOKS_NAME, names.FLEET_NAMESPACE, None, code))
    for app in shared:
        data = dict([_settings_file(app, full)])
        objects.append(_config_map(names.fleet_hooks_name(app["name"]), names.FLEET_NAMESPACE, None, data))
    return objects


def app_settings(app: Mapping[str, Any], ctx: Mapping[str, Any]) -> dict[str, Any]:
    """What the code in an app's pod has to know of it; both are complete.

    Names are full but for private ones that follow the node's name of a revision: those keep their `~`.
    """
    readiness, command = app["readiness"], app["readiness"]["command"]

    def resolve(name: str) -> str:
        kept = app["handoff"] != "overlap" or name[1:].lstrip("/") in app["private_names"]
        if name.startswith("~") and not kept:
            return f"~{name[1:].lstrip('/')}"
        return names.resolve_graph_name(name, context.graph_namespace(app, ctx), context.graph_node(app, ctx))

    # the rate of a topic with several publishers is their sum, of which a pod sees its own part only
    rated = [topic for topic in readiness["topics"] if topic.get("min_rate") and (topic.get("publishers") or 1) < 2]
    grace, drain = app["termination_grace_period"], app["handoff"] == "drain"
    return {
        "app": app["name"],
        "node": context.graph_node(app, ctx),
        "expect_node": readiness["nodes"],
        "pattern": app["pattern"],
        "handoff": app["handoff"],
        "actions": [resolve(action["name"]) for action in readiness["actions"]],
        "drain_deadline": app["drain_deadline"],
        "stop_deadline": min(grace, app["drain_deadline"] if drain else STOP_SECONDS),
        "command": probe_command(command) if command else None,
        "min_rates": {resolve(topic["name"]): topic["min_rate"] for topic in rated},
        "keeper": keeper_url(ctx),
    }


def keeper_url(ctx: Mapping[str, Any]) -> str | None:
    """Where pods find the keeper of their master; an external master has none."""
    mode = ctx["master"]["mode"]
    if mode == "external":
        return None
    host = names.KEEPER_NAME + (f".{names.FLEET_NAMESPACE}" if mode == "shared" else "")
    return f"http://{host}:{names.KEEPER_PORT}"


def _settings_file(app: Mapping[str, Any], ctx: Mapping[str, Any]) -> tuple[str, str]:
    return f"app-{app['name']}.json", json.dumps(app_settings(app, ctx), sort_keys=True)


def _config_map(name: str, namespace: str, robot: str | None, data: Mapping[str, str]) -> dict[str, Any]:
    labels = {"app.kubernetes.io/managed-by": names.MANAGER}
    if robot is not None:
        labels[names.LABEL_ROBOT] = robot
    return {
        "apiVersion": "v1",
        "kind": "ConfigMap",
        "metadata": {"name": name, "namespace": namespace, "labels": labels},
        "data": {key: data[key] for key in sorted(data)},
    }
