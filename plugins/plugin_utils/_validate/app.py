# SPDX-License-Identifier: GPL-3.0-or-later
"""Checks of one app that no type can make: what its parts say about each other and about its robot.

Every check takes the completed app, the app as the operator wrote it, and its robot's draft. Paths are the app's own.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from ...module_utils._common.errors import SpecError
from ...module_utils._pod.sidecar import PORT as SIDECAR_PORT
from ...module_utils._ros.conditions import conditions_from
from ...module_utils._ros.names import resolve
from .._model import context, names
from .._model.app import STOP_MARGIN, App
from .._model.context import Robot
from .._model.finding import Problem, each, join_path, taken, twice
from .._model.formats import FORMS, moving_tag, quantity_value
from .._objects.app import plain_deployment
from .._objects.pod_code import IN_POD
from .draft import Draft, Said
from .launches import launch_problems
from .overrides import inside, override_problems

BEFORE = "command, or hooks: sidecar"
FILES_BYTES = 900_000  # the API takes no object above a megabyte (kubernetes.io, ConfigMap)
_MASTER = re.compile(r"(?:^|[\s/;&|(])(?:roscore|rosmaster)(?:$|[\s;&|)])")
# Programs that an image like ros:noetic has below /opt/ros alone: its PATH does not lead there.
_ROS_TOOLS = ("rosrun", "roslaunch", "rostopic", "rosservice", "rosparam", "rosnode", "rosbag")
LAUNCHES = "roslaunch names its nodes itself"
_SHELLS = ("sh", "bash", "dash")
# What a `sh -c` script reads the appended ROS node name from.
_NAME_READERS = re.compile(r"\$\{?(?:@|\*|0|1|" + names.NODE_NAME_ENV + r")")
# keys of an app that a robot without ROS has no use for
OF_ROS = ("launch", "params", "keep_params", "private_names", "node_name", "pattern", "on_demand")
OF_READINESS = ("nodes", "topics", "services", "actions", "absent")
OF_UPDATES = ("idle", "ignore", "renamed", "rates")
_GRACE = ("spec", "template", "spec", "terminationGracePeriodSeconds")


def app_problems(app: App, raw: Said, draft: Draft) -> Iterator[Problem]:
    """All problems of one app whose keys have the types that they have to have."""
    for check in (
        _without_ros, _command, _launch, _handoff, _placement, _namespace, _grace, _volumes, _params, _files, _ports,
        _mounts, _readiness,
    ):  # fmt: skip
        yield from check(app, raw, draft)
    yield from when_problems(app.update.when, "update.when", draft.robot)
    plain = plain_deployment(app, draft.robot)
    yield from override_problems(plain, app.overrides, names.APP_CONTAINER, "overrides")


def app_warnings(app: App, raw: Said) -> Iterator[Problem]:
    """What is allowed but seldom meant."""
    if moving_tag(app.image):
        yield Problem("image", f"{app.image} may mean another image tomorrow; name a version or a digest")
    if app.devices:
        yield Problem("devices", "the container runs privileged, as Kubernetes has no other plain way to a device")
    if app.command and app.command[0] in _ROS_TOOLS:
        told = f"{app.command[0]} is found once the image's entry point has run, which a command replaces"
        yield Problem("command[0]", f"{told}; begin it with /ros_entrypoint.sh")
    for name, value in app.launch.args.items() if app.launch else ():
        if not str(value).strip():
            yield Problem(f"launch.args.{name}", "is empty, so that roslaunch does not take it")
    if raw.get("private_names") and app.handoff != "overlap":
        yield Problem("private_names", f"has no effect with the handoff {app.handoff}")


def when_problems(items: Sequence[Said], path: str, robot: Robot) -> Iterator[Problem]:
    """Problems of what has to be said before an update, as the module on the robot will find them.

    The items passed the schema; `path` is where their list is.
    """
    for where, item in each(path, items, ".topic"):
        if robot.master.mode == "none" and "topic" in item:
            yield Problem(where, "is about ROS, and ros_master_mode is none", "url")
    try:
        conditions_from({"values": items})
    except SpecError as error:
        for line in error.details["errors"]:
            where, _colon, problem = line.partition(": ")
            allowed = "what ros_ready's option values takes (ansible-doc rosops.fleet.ros_ready)"
            yield Problem(path + where.removeprefix("values"), problem, allowed)


def _words(app: App) -> list[tuple[str, str]]:
    """The words of its command line, each with its place."""
    return [*each("command", app.command), *each("args", app.args)]


def _without_ros(app: App, raw: Said, draft: Draft) -> Iterator[Problem]:
    if draft.robot.master.mode != "none":
        return
    said = [key for key in OF_ROS if raw.get(key)]
    said += [f"readiness.{key}" for key in OF_READINESS if (raw.get("readiness") or {}).get(key)]
    said += [f"update.{key}" for key in OF_UPDATES if (raw.get("update") or {}).get(key)]
    for key in said:
        yield Problem(key, "is about ROS, and ros_master_mode is none", "leave it out")
    if raw.get("hooks") not in (None, "none"):
        yield Problem("hooks", f"is {raw['hooks']}, but there is no ROS graph to look at", "none, or leave it out")
    if app.handoff == "drain":
        yield Problem("handoff", "is drain, but there are no goals to wait for", "overlap, or replace")


def _command(app: App, raw: Said, draft: Draft) -> Iterator[Problem]:
    if of := {names.MASTER_NAME: "the ROS master", names.KEEPER_NAME: "the ROS master's keeper"}.get(app.name):
        yield Problem("name", f"is {app.name}, the name of {of}", "any other name")
    # two masters in one namespace share no graph; one of them serves nobody
    for place, word in _words(app) if draft.robot.master.ours else ():
        if _MASTER.search(word):
            allowed = "an app without roscore; the collection runs the master (ros_master_mode)"
            yield Problem(place, "starts a second ROS master", allowed)
    # the ROS node name is appended to args, and args of our own replace those of the image
    named = draft.robot.master.mode != "none" and (app.readiness.nodes or app.handoff == "overlap")
    if named and not {"command", "args", "launch"} & {*raw}:
        yield Problem(
            "command",
            "is missing, as is args",
            "args: [], where the image's own entry point hands its arguments on: the ROS node name is appended, and "
            "they replace the image's; or what is to run, as command and args",
        )


def _launch(app: App, raw: Said, draft: Draft) -> Iterator[Problem]:
    launch = app.launch
    if not launch:
        return
    if "args" in raw:
        yield Problem("args", "is beside launch, which makes the arguments", "launch.args, or args alone")
    if app.readiness.nodes:
        yield Problem("readiness.nodes", f"is true, but {LAUNCHES}", "leave it out")
    for file in [] if launch.package else [file for file in launch.file if not file.startswith("/")]:
        yield Problem("launch.package", f"is missing, and {file} is no whole path", "a package, or /the/whole/path")
    for name in [name for name, value in launch.args.items() if ":=" in str(value)]:
        yield Problem(f"launch.args.{name}", "has := in its value, which roslaunch does not take", "a value without it")
    if app.hooks == "none":
        yield Problem("hooks", "is none, but what starts the launch file is part of them", "app, or sidecar")
    for key, said in (("launch.replace", launch.replace), ("launch.overlap", launch.overlap)):
        if said and app.handoff != "overlap":
            found = f"has no effect: handoff is {app.handoff}, so all its nodes are replaced together"
            yield Problem(key, found, "pattern: pubsub, or leave it out")
        yield from twice(each(key, said), "each node once", "names {} for the second time")
    for where, node in each("launch.overlap", launch.overlap):
        if node in launch.replace:
            yield Problem(where, f"is {node}, which launch.replace names, too", "one of the two")
    for name in app.private_names:
        found = f"names {name}, but a launch file's private names are found on the graph"
        yield Problem("private_names", found, "leave it out")
    yield from launch_problems(app, launch, context.graph_namespace(app, draft.robot))


def _handoff(app: App, _raw: Said, _draft: Draft) -> Iterator[Problem]:
    if app.pattern == "action" and app.handoff == "overlap":
        found = "is overlap for the pattern action: two action servers lose goals"
        yield Problem("handoff", found, "drain or replace")
    for reason in app.alone() if app.handoff == "overlap" else ():
        yield Problem("handoff", f"is overlap, but {reason}", "replace, drain, or leave it out")
    # some commands drop the name that is appended; their nodes are then not where the gate looks for them
    reason = name_is_lost([*app.command, *app.args])
    if reason and app.handoff == "overlap":
        allowed = "handoff: replace, or a command that takes __name:= from its last argument"
        if reason == LAUNCHES:
            allowed = "launch: {package, file, args} instead of the command, or handoff: replace"
        yield Problem("handoff", f"is overlap, but {reason}", allowed)
    if reason and app.readiness.nodes:
        allowed = "readiness.nodes: false, with what the app offers under topics, services or actions"
        yield Problem("readiness.nodes", f"is true, but {reason}", allowed)


def name_is_lost(words: list[str]) -> str:
    """Why a command does not hand `__name:=` on to its ROS node; empty if it does."""
    programs = [word.rsplit("/", 1)[-1] for word in words]
    if "roslaunch" in programs:
        return LAUNCHES
    for index, program in enumerate(programs[:-2]):
        if program in _SHELLS and re.fullmatch(r"-[a-z]*c", words[index + 1]):
            script = words[index + 2]
            if re.search(r"\broslaunch\b", script):
                return LAUNCHES
            if not _NAME_READERS.search(script):
                return f'the script of sh -c does not hand its arguments on ("$@", or __name:=${names.NODE_NAME_ENV})'
    return ""


def _placement(app: App, raw: Said, draft: Draft) -> Iterator[Problem]:
    master, by_default = draft.robot.master.mode, "" if "placement" in raw else " (the default)"
    if draft.robot.mode == "standalone" and app.placement == "remote":
        found = f"is remote{by_default}, but a standalone robot has no edge host in its cluster"
        yield Problem("placement", found, "local")
    # a remote pod may be placed on any edge host, of which nobody knows what is plugged in
    if app.devices and app.placement == "remote":
        yield Problem("placement", "is remote, but devices are the robot's", "local, or leave it out")
    if app.scope == "fleet" and master in ("robot", "none"):
        allowed = "scope: robot, or ros_master_mode shared or external"
        yield Problem("scope", "is fleet, but the robots share no ROS master", allowed)
    if app.scope == "fleet" and app.placement == "local":
        yield Problem("placement", "is local for an app of the whole fleet", "remote")
    if raw.get("liveness_timeout") and not draft.robot.master.ours:
        found = f"is {app.liveness_timeout}, but at a master that is not ours the keeper begins no pod anew"
        yield Problem("liveness_timeout", found, "leave it out, or ros_master_mode robot or shared")


def _namespace(app: App, _raw: Said, draft: Draft) -> Iterator[Problem]:
    """Robots that share a master are kept apart by their namespaces; and where nodes are has to be known."""
    space, said = context.robot_space(app, draft.robot), context.said_namespace(app)
    if said and space != "/" and not f"{said}/".startswith(f"{space}/"):
        where = "env.ROS_NAMESPACE" if "ROS_NAMESPACE" in app.env else "args"
        found = f"takes the app to {said}, out of the namespace {space} that keeps robots on one master apart"
        yield Problem(where, found, f"leave it out, or a namespace below {space}")
    for place, word in _words(app):
        if "ROS_NAMESPACE=" in word and app.readiness.nodes:
            found = "sets ROS_NAMESPACE within the command, so that nobody knows where its node is"
            yield Problem(place, found, "env: {ROS_NAMESPACE: ...}, or __ns:= in args")
    if isinstance(app.env.get("ROS_NAMESPACE"), Mapping):
        found = "is in a Secret, so that nobody knows where its node is"
        yield Problem("env.ROS_NAMESPACE", found, "the namespace as a text")
    for key in (names.NODE_NAME_ENV, names.SETTINGS_ENV, names.REVISION_ENV, names.TEMPLATE_ENV, "ROS_HOSTNAME"):
        if key in app.env:
            reason = "would hide the pod's ROS_IP" if key == "ROS_HOSTNAME" else "is set by the collection"
            yield Problem(f"env.{key}", reason, "leave it out")


def _grace(app: App, raw: Said, _draft: Draft) -> Iterator[Problem]:
    """Kubernetes kills the pod when the grace period ends, drained or not."""
    drains, least = app.handoff == "drain" or "drain_deadline" in raw, app.drain_deadline + STOP_MARGIN
    for where, grace in (
        ("termination_grace_period", app.termination_grace_period),
        (join_path("overrides", *_GRACE), inside(app.overrides, _GRACE)),
    ):
        if drains and isinstance(grace, int) and grace < least:
            found = f"is {grace} s, less than the drain deadline of {app.drain_deadline} s and {STOP_MARGIN} s to end"
            yield Problem(where, found, f"{least} or more, or a shorter drain_deadline")


def _volumes(app: App, _raw: Said, draft: Draft) -> Iterator[Problem]:
    declared = [name for name in draft.declared_volumes if isinstance(name, str)]
    modes = {volume.name: volume.access_mode for volume in draft.robot.volumes}
    for where, mount in each("volumes", app.volumes):
        if mount.name not in declared:
            allowed = f"a volume of persistent_storage.volumes: {' or '.join(declared) or 'none is declared'}"
            yield Problem(f"{where}.name", f"is '{mount.name}', an unknown volume", allowed)
        if modes.get(mount.name) == "ReadOnlyMany" and not mount.read_only:
            yield Problem(f"{where}.read_only", "is false, but the volume is ReadOnlyMany", "true")
    yield from twice(each("volumes", (mount.name for mount in app.volumes), ".name"), "each volume once per app")


def _params(app: App, _raw: Said, draft: Draft) -> Iterator[Problem]:
    """They are set before the app starts, and who reads one that is everybody's is everybody's business.

    What the node has set by itself may be kept, too; what is everybody's stays without that.
    """
    # what it lacks to have something of ours done before it starts
    lacks = "" if app.command or app.hooks == "sidecar" else "no command"
    lacks = "no hooks" if app.hooks not in IN_POD else lacks
    kept = [*each("keep_params", app.keep_params)]
    for key, said, done in (("params", app.params, "set"), ("keep_params", kept, "looked up")):
        if said and lacks:
            yield Problem(key, f"cannot be {done} before the app starts, as it has {lacks}", BEFORE)
    for where, name in [*((f"params.{name}", name) for name in app.params), *kept]:
        if not name.startswith("/") and not app.readiness.nodes:
            found = "is private to a node, and the app names its nodes itself"
            yield Problem(where, found, f"/<node>/{name}")
    yield from twice(kept, "each name once", "is {} for the second time")
    for where, name in kept:
        of_all = any(f"{one}/".startswith(f"{name}/") or f"{name}/".startswith(f"{one}/") for one in app.params)
        if name.startswith("/") and not of_all:
            yield Problem(where, f"is {name}, which params do not set, so that it stays", "a name of params")
    space = context.robot_space(app, draft.robot).rstrip("/")
    for name, value in app.params.items():
        where = f"params.{name}"
        if name.startswith("/") and app.handoff == "overlap":
            found = "is read by the version before, too, as handoff is overlap"
            yield Problem(where, found, "a private name, without the slash, or handoff: replace")
        elif name.startswith("/") and not name.startswith(f"{space}/"):
            found = f"is out of the namespace {space} that keeps robots on one master apart"
            yield Problem(where, found, f"{space}{name}")
        yield from _value_problems(value, where)


def _value_problems(value: Any, path: str) -> Iterator[Problem]:
    """What XML-RPC can carry (xmlrpc.com/spec.md); names of parameters are texts."""
    if isinstance(value, Mapping):
        for key, item in value.items():
            if not key or "/" in key:
                yield Problem(join_path(path, key), "is no name of a parameter", "text without a slash")
            yield from _value_problems(item, join_path(path, key))
    elif isinstance(value, (list, tuple)):
        for index, item in enumerate(value):
            yield from _value_problems(item, join_path(path, index))
    elif isinstance(value, int) and not -(2**31) <= value < 2**31:
        yield Problem(path, f"is {value}, more than 32 bits", "a smaller number, or a text")
    elif value is None:
        yield Problem(path, "is empty (null)", "a text, a number, true, false, a list or a mapping")


def _files(app: App, raw: Said, _draft: Draft) -> Iterator[Problem]:
    form = FORMS["secret-key"]
    for (where, item), given in zip(each("files", app.files), raw.get("files") or (), strict=True):
        if ("content" in given) == ("secret" in given):
            found = "has both content and secret" if item.secret else "has neither content nor secret"
            yield Problem(where, found, "content with the file's text, or the name of a secret that is there")
        if "key" in given and not item.secret:
            yield Problem(f"{where}.key", "has no effect without secret", "leave it out")
        elif item.secret and not form.test(item.key):
            yield Problem(f"{where}.key", f"is missing, and {item.key} is no key of a Secret", form.allowed)
    size = sum(len(item.content.encode()) for item in app.files)
    if size > FILES_BYTES:
        allowed = f"at most {FILES_BYTES} bytes in one app; larger ones belong into its image or on a volume"
        yield Problem("files", f"hold {size} bytes", allowed)


def _ports(app: App, raw: Said, draft: Draft) -> Iterator[Problem]:
    again = "is {} for the second time"
    yield from twice(each("ports", (port.name for port in app.ports), ".name"), "a name of its own", again)
    numbers = each("ports", ((one.port, one.protocol) for one in app.ports), ".port")
    yield from twice(numbers, "each port once per app", "is {0[0]} for the second time")
    for where, port in each("ports", app.ports):
        if port.host_port and app.placement == "remote":
            by_default = "" if "placement" in raw else " (the default)"
            found = f"is one edge host's, and placement is remote{by_default}, so nobody knows whose"
            yield Problem(f"{where}.host_port", found, "node_port, which every host has, or placement: local")
        if port.host_port and app.host_network:
            found = f"has no effect, as host_network gives it the host's port {port.port}"
            yield Problem(f"{where}.host_port", found, "leave it out")
        if app.hooks == "sidecar" and (port.port, port.protocol) == (SIDECAR_PORT, "TCP"):
            yield Problem(f"{where}.port", f"is {port.port}, the port of the hooks' sidecar", "any other port")
    why = context.not_gated(app, draft.robot)
    if app.hooks == "gate" and why:
        yield Problem("hooks", f"is gate, but {why}", "app, or sidecar")
    # the kubelet asks a sidecar by the pod's address
    if app.hooks == "sidecar" and app.host_network:
        found = "is sidecar, but with host_network its port is the host's, and another app's sidecar has the same"
        yield Problem("hooks", found, "app, or none, or leave host_network out")


def _mounts(app: App, _raw: Said, _draft: Draft) -> Iterator[Problem]:
    """Kubernetes refuses two mounts at one path, and a request above its limit, long after validation."""
    mounts = [
        *([("the collection's own code", names.CODE_DIR)] if app.hooks == "app" else ()),
        *each("volumes", (mount.mount_path for mount in app.volumes), ".mount_path"),
        *each("files", (item.path for item in app.files), ".path"),
        *each("devices", app.devices),
        *each("host_paths", (mount.mount_path for mount in app.host_paths), ".mount_path"),
    ]
    for where, path, other in taken((where, path.rstrip("/")) for where, path in mounts):
        found = f"is {path}, where {other.partition('.')[0]} is mounted already"
        yield Problem(where, found, "a path of its own")
    limits = app.resources.get("limits") or {}
    for name, asked in (app.resources.get("requests") or {}).items():
        request, limit = quantity_value(str(asked)), quantity_value(str(limits.get(name)))
        if request is not None and limit is not None and request > limit:
            found = f"is {asked}, above the limit of {limits[name]}"
            yield Problem(f"resources.requests.{name}", found, f"at most {limits[name]}")


def _readiness(app: App, _raw: Said, draft: Draft) -> Iterator[Problem]:
    ready = app.readiness
    if ready.interval > ready.timeout:
        found = f"is {ready.interval} s, longer than the timeout of {ready.timeout} s"
        yield Problem("readiness.interval", found, f"at most {ready.timeout}")
    if ready.http and ready.command:
        yield Problem("readiness.http", "is beside readiness.command", "one of the two")
    own, namespace = context.graph_node(app, draft.robot), context.graph_namespace(app, draft.robot)
    for where, name in each("readiness.absent", ready.absent if ready.nodes else ()):
        if resolve(name, namespace, own) == own:
            yield Problem(where, "is the app's own node", "nodes that must be gone")
    for kind, items in (("topics", ready.topics), ("services", ready.services), ("actions", ready.actions)):
        named = each(f"readiness.{kind}", (item["name"] for item in items))
        yield from twice(named, "each name once, with all its conditions", "names {} for the second time")
