# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""A robot's variables, with every documented default filled in, as the one input of the workload functions.

ctx = {robot, mode, namespace, apps, volumes, master: {mode, image, uri, placement, overrides}, quota, limits,
pull_secrets}
"""

from __future__ import annotations

from typing import Any, Mapping

from ansible_collections.rosops.fleet.plugins.plugin_utils._model import names

MASTER_IMAGE = "ros:noetic-ros-core"
DRAIN_DEADLINE = 30
GRACE_PERIOD = 45
READY_TIMEOUT = 60.0
READY_INTERVAL = 0.5
READY_CONSECUTIVE = 1

# Design decision 1: the handoff follows from what the app does on the graph; without a pattern nothing may be assumed.
HANDOFF_BY_PATTERN: dict[str | None, str] = {
    "pubsub": "overlap",
    "service": "overlap",
    "action": "drain",
    None: "replace",
}


def fleet_context(variables: Mapping[str, Any], robot: str) -> dict[str, Any]:
    """ctx of a robot from its Ansible variables (`hostvars[robot]`)."""

    def variable(name: str) -> Any:
        # `in` first: hostvars answers .get() of a name it does not know with a marker on some versions
        return variables[name] if name in variables else None  # noqa: SIM401

    storage = variable("persistent_storage") or {}
    return complete_context(
        {
            "robot": robot,
            "mode": variable("robot_mode"),
            "apps": variable("ros_apps"),
            "volumes": storage.get("volumes"),
            "master": {
                "mode": variable("ros_master_mode"),
                "image": variable("ros_master_image"),
                "uri": variable("ros_master_uri"),
                "placement": variable("ros_master_placement"),
                "overrides": variable("ros_master_overrides"),
            },
            "quota": variable("robot_namespace_quota"),
            "limits": variable("robot_namespace_limits"),
            "pull_secrets": variable("robot_namespace_pull_secrets"),
        }
    )


def complete_context(ctx: Mapping[str, Any]) -> dict[str, Any]:
    """The ctx with defaults in place of missing or null keys; completing twice changes nothing."""
    robot = str(ctx["robot"])
    volumes = [complete_volume(volume) for volume in ctx.get("volumes") or []]
    return {
        "robot": robot,
        "mode": ctx.get("mode") or "agent",
        "namespace": ctx.get("namespace") or names.robot_namespace(robot),
        "apps": [complete_app(app, volumes) for app in ctx.get("apps") or []],
        "volumes": volumes,
        "master": complete_master(ctx.get("master") or {}),
        "quota": dict(ctx.get("quota") or {}),
        "limits": dict(ctx.get("limits") or {}),
        "pull_secrets": list(ctx.get("pull_secrets") or []),
    }


def complete_master(master: Mapping[str, Any]) -> dict[str, Any]:
    """The master's settings; a shared one serves all robots and so stands on the edge."""
    mode = master.get("mode") or "robot"
    return {
        "mode": mode,
        "image": master.get("image") or MASTER_IMAGE,
        "uri": master.get("uri") or "",
        "placement": master.get("placement") or ("remote" if mode == "shared" else "local"),
        "overrides": dict(master.get("overrides") or {}),
    }


def complete_volume(volume: Mapping[str, Any]) -> dict[str, Any]:
    """An item of persistent_storage.volumes with the seed's defaults."""
    name = str(volume["name"])
    return {
        "name": name,
        "size": volume.get("size") or "1Gi",
        "storage_class": volume.get("storage_class"),
        "mountPath": volume.get("mountPath") or names.default_mount_path(name),
        "access_mode": volume.get("access_mode") or "ReadWriteOnce",
    }


def complete_app(app: Mapping[str, Any], volumes: list[dict[str, Any]]) -> dict[str, Any]:
    """An item of ros_apps with every key present; `volumes` gives the default mount paths."""
    name = str(app["name"])
    paths = {volume["name"]: volume["mountPath"] for volume in volumes}
    pattern = app.get("pattern")
    grace = app.get("termination_grace_period")
    return {
        "name": name,
        "image": app["image"],
        "command": list(app.get("command") or []),
        "args": list(app.get("args") or []),
        "env": {str(key): env_text(value) for key, value in (app.get("env") or {}).items()},
        "placement": app.get("placement") or "remote",
        "scope": app.get("scope") or "robot",
        "pattern": pattern,
        "handoff": app.get("handoff") or HANDOFF_BY_PATTERN[pattern],
        "node_name": app.get("node_name") or names.ros_name(name),
        "private_names": [str(private).lstrip("~") for private in app.get("private_names") or []],
        "volumes": [
            {
                "name": mount["name"],
                "mount_path": mount.get("mount_path")
                or paths.get(mount["name"], names.default_mount_path(str(mount["name"]))),
                "read_only": bool(mount.get("read_only", False)),
            }
            for mount in app.get("volumes") or []
        ],
        "readiness": complete_readiness(app.get("readiness") or {}),
        "hooks": bool(app.get("hooks", True)),
        "depends_on": list(dict.fromkeys(app.get("depends_on") or [])),
        "update": complete_update(app.get("update") or {}),
        "drain_deadline": DRAIN_DEADLINE if app.get("drain_deadline") is None else app["drain_deadline"],
        "termination_grace_period": GRACE_PERIOD if grace is None else grace,
        "resources": dict(app.get("resources") or {}),
        "devices": list(app.get("devices") or []),
        "host_network": bool(app.get("host_network", False)),
        "host_paths": [
            {
                "path": mount["path"],
                "mount_path": mount.get("mount_path") or mount["path"],
                # a robot's files are not ours: writing to them has to be asked for
                "read_only": bool(mount.get("read_only", True)),
            }
            for mount in app.get("host_paths") or []
        ],
        "overrides": dict(app.get("overrides") or {}),
    }


def complete_readiness(readiness: Mapping[str, Any]) -> dict[str, Any]:
    """The readiness of an app; services and actions may be given as plain names."""

    def value(key: str, default: Any) -> Any:
        return default if readiness.get(key) is None else readiness[key]

    return {
        "command": readiness.get("command"),
        "nodes": value("nodes", True),
        "topics": [dict(topic) for topic in value("topics", [])],
        "services": [dict(item) if isinstance(item, Mapping) else {"name": item} for item in value("services", [])],
        "actions": [
            {"state": "up", **(item if isinstance(item, Mapping) else {"name": item})} for item in value("actions", [])
        ],
        "absent": list(value("absent", [])),
        "timeout": value("timeout", READY_TIMEOUT),
        "interval": value("interval", READY_INTERVAL),
        "consecutive": value("consecutive", READY_CONSECUTIVE),
    }


def complete_update(update: Mapping[str, Any]) -> dict[str, Any]:
    """How an app is updated. Without `on_busy` the run's setting decides, without `group` it is alone."""
    return {
        "group": update.get("group") or None,
        "idle": list(update.get("idle") or []),
        "on_busy": update.get("on_busy") or None,
    }


def env_text(value: Any) -> str:
    """An environment value as the text a container gets; YAML's booleans become true and false."""
    if isinstance(value, bool):
        return "true" if value else "false"
    return str(value)


def namespace_of(app: Mapping[str, Any], ctx: Mapping[str, Any]) -> str:
    """Where an app's objects live."""
    return names.FLEET_NAMESPACE if app["scope"] == "fleet" else str(ctx["namespace"])


def master_uri(ctx: Mapping[str, Any]) -> str:
    """ROS_MASTER_URI as the robot's pods need it."""
    master = ctx["master"]
    if master["mode"] == "external":
        return str(master["uri"])
    host = names.MASTER_NAME + (f".{names.FLEET_NAMESPACE}" if master["mode"] == "shared" else "")
    return f"http://{host}:{names.MASTER_PORT}"


def graph_namespace(app: Mapping[str, Any], ctx: Mapping[str, Any]) -> str:
    """The ROS namespace of an app: the robot's own one where several robots share a master, else the root."""
    if app["scope"] == "fleet" or ctx["master"]["mode"] == "robot":
        return "/"
    return "/" + names.ros_name(str(ctx["robot"]))


def graph_node(app: Mapping[str, Any], ctx: Mapping[str, Any], suffix: str = "") -> str:
    """The full ROS node name of an app, with the revision's suffix where it has one."""
    return names.resolve_graph_name(str(app["node_name"]) + suffix, graph_namespace(app, ctx), "")
