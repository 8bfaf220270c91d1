# SPDX-License-Identifier: GPL-3.0-or-later
"""Checks between the apps of one robot, of its master and volumes, and between robots."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Sequence

from ...module_utils._ros.names import resolve
from ...module_utils._step.objects import Object
from .._model import context, names
from .._model.app import App
from .._model.finding import Problem, each, taken, twice
from .._model.formats import FORMS, moving_tag
from .._model.order import circle
from .._model.topology import EDGE_CLUSTER, members
from .._objects.app import app_deployment
from .._objects.master import keeper_objects, plain_keeper, plain_master, ros_core_objects
from .._objects.namespace import needs_fleet_namespace
from .._objects.placement import of_other_host
from .._objects.pod_security import refused
from .._objects.pod_settings import promised
from .app import app_problems, app_warnings, when_problems
from .draft import Draft, Inventory
from .overrides import override_problems
from .schema import did_you_mean

# Classes whose volumes are directories of one node: Kubernetes then places every pod of the claim on that node.
NODE_BOUND = (None, "local-path")


def robot_problems(draft: Draft, there: Inventory) -> Iterator[Problem]:
    """Problems of one robot: of its apps, between these and its volumes, and of its master."""
    for path, app, raw in draft.apps:
        found = [problem.below(path) for problem in app_problems(app, raw, draft)]
        yield from found
        asks = app.overrides or app.host_network or app.host_paths or app.devices
        if not found and (asks or draft.robot.pod_security):
            yield from _refused(draft, path, app_deployment(app, draft.robot))
    # two of one name are one Secret, and only the last login would be in it
    secrets = each(f"{draft.path}.robot_namespace_pull_secrets", draft.robot.pull_secrets, ".name")
    yield from twice(secrets, "a name of its own")
    yield from _same_names(draft)
    yield from _volume_names(draft)
    yield from _volume_users(draft, len(members(there.groups, "edge")))
    yield from _dependencies(draft)
    yield from when_problems(draft.robot.when, f"{draft.path}.update_when", draft.robot)
    yield from _master(draft, bool(there.variable(draft.robot.name, "ros_master_uri")))


def _refused(draft: Draft, path: str, deployment: Object) -> Iterator[Problem]:
    """What the API server would refuse of a pod: by its namespace's level, or as it may be on another one's host."""
    robot, base = draft.robot, f"{draft.path}.robot_namespace_"
    namespace, pod = deployment["metadata"]["namespace"], deployment["spec"]["template"]["spec"]
    level = robot.pod_security if namespace == robot.namespace else ""
    if more := ", ".join(refused(pod, level)):
        found = f"is {level}, but {path} has {more}"
        yield Problem(f"{base}pod_security", found, "privileged, or leave it out, or overrides")
    if not robot.edge_host_access and (more := ", ".join(of_other_host(pod, namespace))):
        found = f"is false, but {path} has {more}, and is not placed on the robot's own node"
        yield Problem(f"{base}edge_host_access", found, "true, or placement: local")


def _same_names(draft: Draft) -> Iterator[Problem]:
    """Two apps of one name are one step, two nodes of one name shut each other down at the master."""
    apps = [
        (path, raw["name"])
        for path, raw in each(f"{draft.path}.ros_apps", draft.declared_apps)
        if isinstance(raw.get("name"), str)
    ]
    for path, name, first in taken(apps):
        yield Problem(f"{path}.name", f"is '{name}' as in {first}", "a name of its own")
    nodes = [((path, app.name), context.graph_node(app, draft.robot)) for path, app, _raw in draft.apps]
    for (path, name), node, (first, other) in taken(nodes):
        if name != other:
            yield Problem(f"{path}.node_name", f"gives the ROS node {node} as {first} does", "a node name of its own")


def _volume_names(draft: Draft) -> Iterator[Problem]:
    """Each once, and none that a pod's other volumes have."""
    volumes = each(f"{draft.path}.persistent_storage.volumes", draft.declared_volumes, ".name")
    declared = [(path, name) for path, name in volumes if isinstance(name, str)]
    yield from twice(declared, "a name of its own")
    for path, name in declared:
        if re.fullmatch(r"(device|file|host-path)-[0-9]+", name):
            yield Problem(path, f"is '{name}', a name that devices, files and host paths get", "any other name")
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
            (where, app, mount)
            for path, app, _raw in draft.apps
            for where, mount in each(f"{path}.volumes", app.volumes)
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
            one_node = app.placement == "local" or edge_count <= 1 or volume.storage_class in NODE_BOUND
            if app.handoff == "overlap" and (mode == "ReadWriteOncePod" or (mode == "ReadWriteOnce" and not one_node)):
                found = f"mounts the {mode} volume {name}, which two overlapping revisions cannot both have"
                allowed = "handoff: replace or drain, another access_mode, or ReadWriteOnce on one node"
                yield Problem(path, found, allowed)
            elif app.handoff == "overlap" and (why := mount.alone(volume)):
                allowed = "handoff: replace or drain, read_only: true, or shared: true where several may write at once"
                yield Problem(path, f"cannot be two overlapping revisions': {why}", allowed)


def _dependencies(draft: Draft) -> Iterator[Problem]:
    """Dependencies on apps that are not there, and circles.

    Apps of one group change in one step, so between groups an order is needed, and inside one as well.
    """
    declared = [raw["name"] for raw in draft.declared_apps if isinstance(raw.get("name"), str)]
    apps = {app.name: (path, app) for path, app, _raw in draft.apps}
    unit = {name: f"group {app.update.group}" if app.update.group else name for name, (_path, app) in apps.items()}
    inside: dict[str, list[str]] = {name: [] for name in apps}
    between: dict[str, list[str]] = {name: [] for name in unit.values()}
    for path, app, _raw in draft.apps:
        for where, other in each(f"{path}.depends_on", app.depends_on):
            if other not in declared:
                found = f"is '{other}', an unknown app{did_you_mean(other, declared)}"
                yield Problem(where, found, f"an app of this robot: {', '.join(declared)}")
            elif other in apps and unit[other] == unit[app.name]:
                inside[app.name].append(other)
            elif other in apps:
                between[unit[app.name]].append(unit[other])
    for needs in (inside, between):
        if members_of := circle(needs):
            [member, *_others] = (name for name in apps if members_of[0] in (name, unit[name]))
            found = f"makes a circle: {' needs '.join([*members_of, members_of[0]])}"
            yield Problem(f"{apps[member][0]}.depends_on", found, "an order in which the apps can be updated")


def robot_warnings(draft: Draft, sound: bool) -> Iterator[Problem]:
    """What is allowed but seldom meant; some of it is worth a word only where the whole fleet is `sound`."""
    for path, app, raw in draft.apps:
        yield from (warning.below(path) for warning in app_warnings(app, raw))
    used = {mount.name for app in draft.robot.apps for mount in app.volumes}
    for name in [volume.name for volume in draft.robot.volumes if volume.name not in used]:
        yield Problem(f"{draft.path}.persistent_storage.volumes", f"no app mounts {name}")
    devices = [((path, app.name), device) for path, app, _raw in draft.apps for device in app.devices]
    for (path, _name), device, (_path, other) in taken(devices):
        yield Problem(f"{path}.devices", f"{device} is {other}'s, too; few devices serve two")
    image = draft.robot.master.image
    if moving_tag(image):
        yield Problem(f"{draft.path}.ros_master_image", f"{image} may mean another image tomorrow")
    # what no NetworkPolicy bounds
    for path in [path for path, app, _raw in draft.apps if app.host_network]:
        yield Problem(f"{path}.host_network", "no NetworkPolicy holds there: who reaches the host reaches the app")
    if draft.robot.master.mode == "external":
        told = "no NetworkPolicy holds for a master outside, and nodes outside reach the robot's pods from"
        yield Problem(f"{draft.path}.ros_master_uri", f"{told} networks in robot_namespace_admits alone")
    # what the robot is asked before a change, and its own app has to answer
    publishers = {topic: app.name for topic, app, _said in promised(draft.robot)} if sound else {}
    for where, item in each(f"{draft.path}.update_when", draft.robot.when, ".topic"):
        if publisher := "topic" in item and publishers.get(resolve(item["topic"], context.own_space(draft.robot), "")):
            yield Problem(
                where,
                f"is published by app {publisher}: while that app is down, the robot gives no answer and is waited for",
                "-e update_on_busy=force, for the run that mends it",
            )


def _master(draft: Draft, uri: bool) -> Iterator[Problem]:
    """Of the robot's ROS master; `uri`: the operator wrote one."""
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
    if master.mode in ("shared", "external") and not FORMS["node-name"].test(names.ros_name(robot.name)):
        found = "begins with a digit, but robots that share a master get a ROS namespace of their name"
        yield Problem(f"groups.robots.{robot.name}", found, "a name that begins with a letter")
    for key, plain, overrides, container, whole in (
        ("overrides", plain_master, master.overrides, names.MASTER_CONTAINER, ros_core_objects),
        ("keeper_overrides", plain_keeper, master.keeper_overrides, names.KEEPER_NAME, keeper_objects),
    ):
        if master.ours or plain is plain_keeper:
            problems = override_problems(plain(robot), overrides, container, base + key)
            yield from problems
            if not problems and (overrides or robot.pod_security):
                yield from _refused(draft, base + key, whole(robot)[0])


def port_problems(drafts: Iterable[Draft]) -> Iterator[Problem]:
    """A port of a host or of all hosts of a cluster leads to one app."""
    first: dict[tuple[str, str, int, str], tuple[str, str]] = {}
    for draft in drafts:
        robot = draft.robot
        cluster = robot.name if robot.mode == "standalone" else EDGE_CLUSTER
        for path, app, _raw in draft.apps:
            for where, port in each(f"{path}.ports", app.ports):
                # the fleet's one app comes out of every robot's variables
                owner = f"{app.name} {port.name}" if app.scope == "fleet" else where
                of_both = (("host_port", robot.name, port.host_port), ("node_port", cluster, port.node_port))
                for key, place, number in of_both:
                    other = first.setdefault((key, place, number or 0, port.protocol), (owner, where))
                    if number and other[0] != owner:
                        yield Problem(f"{where}.{key}", f"is {number} as that of {other[1]}", f"a {key} of its own")


def fleet_app_problems(drafts: Sequence[Draft]) -> Iterator[Problem]:
    """Objects of the whole fleet come out of every robot's variables, so these have to agree."""
    apps: dict[str, tuple[str, App]] = {}
    nodes: dict[str, tuple[str, App]] = {}
    shared = [draft for draft in drafts if draft.robot.master.mode == "shared"]
    for draft in shared:
        if draft.robot.master != shared[0].robot.master:
            found = f"differs from the one of {shared[0].robot.name}, although the master is shared"
            yield Problem(f"{draft.path}.ros_master_image", found, "the same ros_master_* variables for all robots")
    at_fleets = [draft for draft in drafts if needs_fleet_namespace(draft.robot) and draft.robot.mode != "standalone"]
    for draft in at_fleets:
        if draft.robot.edge_host_access != at_fleets[0].robot.edge_host_access:
            found = f"differs from the one of {at_fleets[0].robot.name}, and both have the namespace fleet"
            yield Problem(f"{draft.path}.robot_namespace_edge_host_access", found, "the same for all of them")
    for path, app in [(path, app) for draft in drafts for path, app, _raw in draft.apps if app.scope == "fleet"]:
        first, same = apps.setdefault(app.name, (path, app))
        if app != same:
            yield Problem(path, f"differs from {first}, but scope fleet means one app for all", "one definition")
        first, same = nodes.setdefault(app.node_name, (path, app))
        # two of one robot are told by its own checks
        if same.name != app.name and first.partition(".ros_apps[")[0] != path.partition(".ros_apps[")[0]:
            yield Problem(f"{path}.node_name", f"is the ROS node name of {first} too", "a node name of its own")
