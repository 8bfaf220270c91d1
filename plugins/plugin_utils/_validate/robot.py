# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Checks between the apps of one robot, of its master and volumes, and between robots."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator

from ...module_utils._ros.names import resolve
from .._model import context, names
from .._model.app import App, Volume
from .._model.context import MasterSettings
from .._model.finding import Problem, join_path, repeated
from .._model.formats import FORMS, moving_tag
from .._model.topology import EDGE_CLUSTER
from .._objects.master import plain_keeper, plain_master
from .._objects.pod_settings import promised
from .._objects.security import more_than_baseline
from .dependencies import dependency_problems
from .draft import Draft
from .overrides import override_problems
from .when import when_problems

# Classes whose volumes are directories of one node: Kubernetes then places every pod of the claim on that node.
NODE_BOUND = (None, "local-path")


def robot_problems(draft: Draft, edge_count: int) -> list[Problem]:
    """Problems between the apps and volumes of one robot."""
    return [
        *_same_names(draft),
        *_volume_names(draft),
        *_pod_security(draft),
        *_pull_secrets(draft),
        *_volume_users(draft, edge_count),
        *dependency_problems(draft),
        *when_problems(draft.robot.when, f"{draft.path}.update_when"),
    ]


def _pod_security(draft: Draft) -> Iterator[Problem]:
    """A namespace's level refuses whole pods, which nobody would see before the rollout."""
    level = draft.robot.pod_security
    if level not in ("baseline", "restricted"):
        return
    for path, app, _raw in draft.apps():
        if app.scope != "fleet" and (more := more_than_baseline(app)):
            found = f"is {level}, but {path} has {more}"
            yield Problem(f"{draft.path}.robot_namespace_pod_security", found, "privileged, or leave it out")


def _pull_secrets(draft: Draft) -> Iterator[Problem]:
    """Two of one name are one Secret, and only the last login would be in it."""
    for index, name in repeated(draft.robot.pull_secrets):
        where = f"{draft.path}.robot_namespace_pull_secrets[{index}].name"
        yield Problem(where, f"is '{name}' for the second time", "a name of its own")


def _same_names(draft: Draft) -> Iterator[Problem]:
    """Two apps of one name are one Deployment; two nodes of one name shut each other down at the master."""
    by_name: dict[tuple[bool, str], str] = {}
    for index, raw in enumerate(draft.declared_apps):
        if isinstance(raw.get("name"), str):
            path = f"{draft.path}.ros_apps[{index}]"
            first = by_name.setdefault((raw.get("scope") == "fleet", raw["name"]), path)
            if first != path:
                yield Problem(f"{path}.name", f"is '{raw['name']}' as in {first}", "a name of its own")
    by_node: dict[str, tuple[str, str]] = {}
    for path, app, _raw in draft.apps():
        node = context.graph_node(app, draft.robot)
        first, name = by_node.setdefault(node, (path, app.name))
        if first != path and name != app.name:
            yield Problem(f"{path}.node_name", f"gives the ROS node {node} as {first} does", "a node name of its own")


def _volume_names(draft: Draft) -> Iterator[Problem]:
    """Each once, and none that a pod's other volumes have."""
    declared = draft.declared_volumes
    for index, name in enumerate(declared):
        if not isinstance(name, str):
            continue
        path = f"{draft.path}.persistent_storage.volumes[{index}].name"
        if name in declared[:index]:
            yield Problem(path, f"is '{name}' for the second time", "a name of its own")
        if re.fullmatch(r"(device|host-path)-[0-9]+", name):
            yield Problem(path, f"is '{name}', a name that devices and host paths get", "any other name")
        if name == names.CODE_NAME:
            yield Problem(path, f"is '{name}', the volume of the collection's own code", "any other name")


def _volume_users(draft: Draft, edge_count: int) -> Iterator[Problem]:
    """Access modes against who mounts the volume, and from how many nodes at once.

    ReadWriteOnce means one node: several pods of that node may share it, so an overlap is fine where both revisions
    run on the same node. That is certain for a local app (its robot), for a remote one with a single edge host, and
    for volumes that are bound to a node. ReadWriteOncePod means one pod: no overlap, no second app.
    """
    for volume in draft.robot.volumes:
        mode, name = volume.access_mode, volume.name
        users = [
            (join_path(path, "volumes", index), app, mount)
            for path, app, _raw in draft.apps()
            for index, mount in enumerate(app.volumes)
            if mount.name == name
        ]
        for path, _app, _mount in users[1:] if mode == "ReadWriteOncePod" else ():
            found = f"mounts {name}, a ReadWriteOncePod volume of {users[0][0]}"
            yield Problem(path, found, "one app per ReadWriteOncePod volume")
        others = [path for path, app, _mount in users if app.placement != users[0][1].placement]
        if mode == "ReadWriteOnce" and others:
            found = f"mounts the ReadWriteOnce volume {name} on another node than {users[0][0]} does"
            yield Problem(others[0], found, "apps of one placement, or access_mode: ReadWriteMany")
        for path, app, mount in users:
            if app.handoff == "overlap" and not _same_node(volume, app, edge_count):
                found = f"mounts the {mode} volume {name}, which two overlapping revisions cannot both have"
                allowed = "handoff: replace or drain, another access_mode, or ReadWriteOnce on one node"
                yield Problem(path, found, allowed)
            elif app.handoff == "overlap" and (why := mount.alone(volume)):
                allowed = "handoff: replace or drain, read_only: true, or shared: true where several may write at once"
                yield Problem(path, f"cannot be two overlapping revisions': {why}", allowed)


def _same_node(volume: Volume, app: App, edge_count: int) -> bool:
    if volume.access_mode == "ReadWriteOnce":
        return app.placement == "local" or edge_count <= 1 or volume.storage_class in NODE_BOUND
    return volume.access_mode != "ReadWriteOncePod"


def answer_warnings(draft: Draft) -> Iterator[Problem]:
    """What a robot without a mistake is asked before a change, and what its own app has to answer."""
    publishers = {topic: app.name for topic, app, _said in promised(draft.robot)}
    for number, item in enumerate(draft.robot.when):
        if publisher := publishers.get(resolve(item["topic"], context.own_space(draft.robot), "")):
            yield Problem(
                f"{draft.path}.update_when[{number}].topic",
                f"is published by app {publisher}: while that app is down, the robot gives no answer and is waited for",
                "-e update_on_busy=force, for the run that mends it",
            )


def robot_warnings(draft: Draft) -> Iterator[Problem]:
    """Volumes nobody mounts, and a master image that may change by itself."""
    used = {mount.name for app in draft.robot.apps for mount in app.volumes}
    for volume in draft.robot.volumes:
        if volume.name not in used:
            yield Problem(f"{draft.path}.persistent_storage.volumes", f"no app mounts {volume.name}")
    first: dict[str, str] = {}
    for path, app, _raw in draft.apps():
        for device in app.devices:
            if first.setdefault(device, app.name) != app.name:
                yield Problem(f"{path}.devices", f"{device} is {first[device]}'s, too; few devices serve two")
    image = draft.robot.master.image
    if draft.robot.master.mode != "external" and moving_tag(image):
        yield Problem(f"{draft.path}.ros_master_image", f"{image} may mean another image tomorrow")


def master_problems(draft: Draft, uri: str) -> Iterator[Problem]:
    """Problems of the robot's ROS master; `uri` is what the operator wrote."""
    robot, master, base = draft.robot, draft.robot.master, f"{draft.path}.ros_master_"
    if master.mode == "external" and not uri:
        yield Problem(f"{base}uri", "is missing for ros_master_mode external", "http://<host>:<port>")
    if master.mode != "external" and uri:
        found = f"is set, but ros_master_mode is {master.mode}"
        yield Problem(f"{base}uri", found, "leave it out, or ros_master_mode: external")
    if robot.mode == "standalone" and master.mode == "shared":
        yield Problem(f"{base}mode", "is shared, but a standalone robot is a cluster of its own", "robot or external")
    elif robot.mode == "standalone" and master.mode == "robot" and master.placement == "remote":
        yield Problem(f"{base}placement", "is remote, but a standalone robot has no edge host in its cluster", "local")
    if master.mode == "shared" and master.placement == "local":
        yield Problem(f"{base}placement", "is local for a master that all robots share", "remote")
    if master.mode != "robot" and not FORMS["node-name"].test(names.ros_name(robot.name)):
        found = "begins with a digit, but robots that share a master get a ROS namespace of their name"
        yield Problem(f"groups.robots.{robot.name}", found, "a name that begins with a letter")
    for key, plain, overrides, container in (
        ("overrides", plain_master, master.overrides, names.MASTER_CONTAINER),
        ("keeper_overrides", plain_keeper, master.keeper_overrides, names.KEEPER_NAME),
    ):
        if master.mode != "external":
            yield from override_problems(plain(robot), overrides, container, base + key)


def port_problems(drafts: Iterable[Draft]) -> Iterator[Problem]:
    """A port of a host or of all hosts of a cluster leads to one app."""
    taken: dict[tuple[str, str, int, str], tuple[str, str]] = {}
    for draft in drafts:
        robot = draft.robot
        cluster = robot.name if robot.mode == "standalone" else EDGE_CLUSTER
        for path, app, _raw in draft.apps():
            for index, port in enumerate(app.ports):
                where = join_path(path, "ports", index)
                # the fleet's one app comes out of every robot's variables
                owner = f"{app.name} {index}" if app.scope == "fleet" else where
                of_both = (("host_port", robot.name, port.host_port), ("node_port", cluster, port.node_port))
                for key, place, number in of_both:
                    other = taken.setdefault((key, place, number or 0, port.protocol), (owner, where))
                    if number and other[0] != owner:
                        yield Problem(f"{where}.{key}", f"is {number} as that of {other[1]}", f"a {key} of its own")


def fleet_app_problems(drafts: Iterable[Draft]) -> Iterator[Problem]:
    """Objects of the whole fleet come out of every robot's variables, so these have to agree."""
    known: dict[str, tuple[str, App]] = {}
    nodes: dict[str, tuple[str, App]] = {}
    first: tuple[str, MasterSettings] | None = None
    for draft in drafts:
        if draft.robot.master.mode == "shared":
            first = first or (draft.robot.name, draft.robot.master)
            if draft.robot.master != first[1]:
                found = f"differs from the one of {first[0]}, although the master is shared"
                yield Problem(f"{draft.path}.ros_master_image", found, "the same ros_master_* variables for all robots")
        for path, app, _raw in draft.apps():
            if app.scope != "fleet":
                continue
            known_path, known_app = known.setdefault(app.name, (path, app))
            if app != known_app:
                found = f"differs from {known_path}, but scope fleet means one app for all"
                yield Problem(path, found, "one definition")
            node_path, node_app = nodes.setdefault(app.node_name, (path, app))
            if node_app.name != app.name and not node_path.startswith(f"{draft.path}."):
                yield Problem(f"{path}.node_name", f"is the ROS node name of {node_path} too", "a node name of its own")
