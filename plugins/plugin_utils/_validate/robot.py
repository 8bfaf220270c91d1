# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Checks between the apps of one robot, of its master and volumes, and between robots."""

from __future__ import annotations

from typing import Any, Iterator, Mapping

from ansible_collections.rosops.fleet.plugins.plugin_utils._model import context, names
from ansible_collections.rosops.fleet.plugins.plugin_utils._model.finding import Problem, join_path
from ansible_collections.rosops.fleet.plugins.plugin_utils._model.formats import FORMS, moving_tag
from ansible_collections.rosops.fleet.plugins.plugin_utils._objects.app import canonical_hash
from ansible_collections.rosops.fleet.plugins.plugin_utils._objects.master import plain_master
from ansible_collections.rosops.fleet.plugins.plugin_utils._validate.dependencies import dependency_problems
from ansible_collections.rosops.fleet.plugins.plugin_utils._validate.overrides import override_problems

Ctx = Mapping[str, Any]
# Classes whose volumes are directories of one node: Kubernetes then places every pod of the claim on that node.
NODE_BOUND = (None, "local-path")


def robot_problems(ctx: Ctx, positions: list[int], edge_count: int) -> list[Problem]:
    """Problems between the apps and volumes of one robot; `positions` are the apps' places in ros_apps."""
    apps = [(f"hosts.{ctx['robot']}.ros_apps[{position}]", app) for app, position in zip(ctx["apps"], positions)]
    found = [*_same_names(ctx, apps), *_same_volumes(ctx), *_volume_users(ctx, apps, edge_count)]
    return [*found, *dependency_problems(ctx, apps)]


def _same_names(ctx: Ctx, apps: list[tuple[str, Any]]) -> Iterator[Problem]:
    """Two apps of one name are one Deployment; two nodes of one name shut each other down at the master."""
    by_name: dict[tuple[bool, str], str] = {}
    for index, raw in enumerate(ctx["declared_apps"]):
        if isinstance(raw.get("name"), str):
            path = f"hosts.{ctx['robot']}.ros_apps[{index}]"
            first = by_name.setdefault((raw.get("scope") == "fleet", raw["name"]), path)
            if first != path:
                yield Problem(f"{path}.name", f"is '{raw['name']}' as in {first}", "a name of its own")
    by_node: dict[str, tuple[str, str]] = {}
    for path, app in apps:
        node = context.graph_node(app, ctx)
        first, name = by_node.setdefault(node, (path, app["name"]))
        if first != path and name != app["name"]:
            yield Problem(f"{path}.node_name", f"gives the ROS node {node} as {first} does", "a node name of its own")


def _same_volumes(ctx: Ctx) -> Iterator[Problem]:
    declared = ctx["declared_volumes"]
    for index, name in enumerate(declared):
        if isinstance(name, str) and name in declared[:index]:
            path = f"hosts.{ctx['robot']}.persistent_storage.volumes[{index}].name"
            yield Problem(path, f"is '{name}' for the second time", "a name of its own")
        if (
            isinstance(name, str)
            and name.rpartition("-")[0] in ("device", "host-path")
            and name.rpartition("-")[2].isdigit()
        ):
            path = f"hosts.{ctx['robot']}.persistent_storage.volumes[{index}].name"
            yield Problem(path, f"is '{name}', a name that devices and host paths get", "any other name")
        if name == names.HOOKS_NAME:
            path = f"hosts.{ctx['robot']}.persistent_storage.volumes[{index}].name"
            yield Problem(path, f"is '{name}', the volume of the collection's own code", "any other name")


def _volume_users(ctx: Ctx, apps: list[tuple[str, Any]], edge_count: int) -> Iterator[Problem]:
    """Access modes against who mounts the volume, and from how many nodes at once.

    ReadWriteOnce means one node: several pods of that node may share it, so an overlap is fine where both revisions
    run on the same node. That is certain for a local app (its robot), for a remote one with a single edge host, and
    for volumes that are bound to a node. ReadWriteOncePod means one pod: no overlap, no second app.
    """
    for volume in ctx["volumes"]:
        mode, name = volume["access_mode"], volume["name"]
        users = [
            (join_path(path, "volumes", index), app)
            for path, app in apps
            for index, mount in enumerate(app["volumes"])
            if mount["name"] == name
        ]
        if mode == "ReadWriteOncePod":
            for path, _app in users[1:]:
                yield Problem(
                    path,
                    f"mounts {name}, a ReadWriteOncePod volume of {users[0][0]}",
                    "one app per ReadWriteOncePod volume",
                )
        if mode == "ReadWriteOnce" and len({app["placement"] for _path, app in users}) > 1:
            others = [path for path, app in users if app["placement"] != users[0][1]["placement"]]
            yield Problem(
                others[0],
                f"mounts the ReadWriteOnce volume {name} on another node than {users[0][0]} does",
                "apps of one placement, or access_mode: ReadWriteMany",
            )
        for path, app in users:
            if app["handoff"] == "overlap" and not _overlap_fits(volume, app, edge_count):
                yield Problem(
                    path,
                    f"mounts the {mode} volume {name}, which two overlapping revisions cannot both have",
                    "handoff: replace or drain, another access_mode, or ReadWriteOnce on one node",
                )


def _overlap_fits(volume: Mapping[str, Any], app: Mapping[str, Any], edge_count: int) -> bool:
    if volume["access_mode"] == "ReadWriteOnce":
        return app["placement"] == "local" or edge_count <= 1 or volume["storage_class"] in NODE_BOUND
    return bool(volume["access_mode"] != "ReadWriteOncePod")


def volume_warnings(ctx: Ctx) -> list[str]:
    """Volumes nobody mounts, and a master image that may change by itself."""
    used = {mount["name"] for app in ctx["apps"] for mount in app["volumes"]}
    warnings = [
        f"hosts.{ctx['robot']}.persistent_storage.volumes: no app mounts {volume['name']}"
        for volume in ctx["volumes"]
        if volume["name"] not in used
    ]
    if ctx["master"]["mode"] != "external" and moving_tag(ctx["master"]["image"]):
        image = ctx["master"]["image"]
        warnings.append(f"hosts.{ctx['robot']}.ros_master_image: {image} may mean another image tomorrow")
    return warnings


def master_problems(ctx: Ctx, variables: Mapping[str, Any]) -> list[Problem]:
    """Problems of the robot's ROS master; `variables` are the host's as the operator wrote them."""
    master, base = ctx["master"], f"hosts.{ctx['robot']}"
    uri = variables.get("ros_master_uri", "")
    problems = []
    if master["mode"] == "external" and not uri:
        problems.append(
            Problem(f"{base}.ros_master_uri", "is missing for ros_master_mode external", "http://<host>:<port>")
        )
    if master["mode"] != "external" and uri:
        found = f"is set, but ros_master_mode is {master['mode']}"
        problems.append(Problem(f"{base}.ros_master_uri", found, "leave it out, or ros_master_mode: external"))
    if ctx["mode"] == "standalone" and master["mode"] == "shared":
        found = "is shared, but a standalone robot is a cluster of its own"
        problems.append(Problem(f"{base}.ros_master_mode", found, "robot or external"))
    elif ctx["mode"] == "standalone" and master["mode"] == "robot" and master["placement"] == "remote":
        found = "is remote, but a standalone robot has no edge host in its cluster"
        problems.append(Problem(f"{base}.ros_master_placement", found, "local"))
    if master["mode"] == "shared" and master["placement"] == "local":
        problems.append(
            Problem(f"{base}.ros_master_placement", "is local for a master that all robots share", "remote")
        )
    if master["mode"] != "robot" and not FORMS["node-name"].test(names.ros_name(ctx["robot"])):
        found = "begins with a digit, but robots that share a master get a ROS namespace of their name"
        problems.append(Problem(f"groups.robots.{ctx['robot']}", found, "a name that begins with a letter"))
    if master["mode"] != "external":
        path = f"{base}.ros_master_overrides"
        problems += override_problems(plain_master(ctx), master["overrides"], names.MASTER_CONTAINER, path)
    return problems


def fleet_app_problems(robots: Mapping[str, tuple[Ctx, list[int]]]) -> Iterator[Problem]:
    """Objects of the whole fleet come out of every robot's variables, so these have to agree."""
    first_app: dict[str, tuple[str, str]] = {}
    nodes: dict[str, tuple[str, str]] = {}
    first_master: tuple[str, str] | None = None
    for robot, (ctx, positions) in robots.items():
        if ctx["master"]["mode"] == "shared":
            digest = canonical_hash(ctx["master"])
            first_master = first_master or (robot, digest)
            if digest != first_master[1]:
                found = f"differs from the one of {first_master[0]}, although the master is shared"
                yield Problem(
                    f"hosts.{robot}.ros_master_image", found, "the same ros_master_* variables for all robots"
                )
        for app, position in zip(ctx["apps"], positions):
            if app["scope"] != "fleet":
                continue
            path, digest = f"hosts.{robot}.ros_apps[{position}]", canonical_hash(app)
            known_path, known_digest = first_app.setdefault(app["name"], (path, digest))
            if digest != known_digest:
                yield Problem(
                    path, f"differs from {known_path}, but scope fleet means one app for all", "one definition"
                )
            node_app, node_path = nodes.setdefault(app["node_name"], (app["name"], path))
            if node_app != app["name"] and node_path.split(".")[1] != robot:
                yield Problem(f"{path}.node_name", f"is the ROS node name of {node_path} too", "a node name of its own")
