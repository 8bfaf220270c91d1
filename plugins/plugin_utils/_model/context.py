# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""What the collection has to know of a robot: its variables with every documented default filled in, and no secret.

`Robot.from_variables` fills the defaults in, once per run; everybody else reads a `Robot`. By `as_dict` and `from_dict`
it travels as an Ansible fact.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields, is_dataclass, replace
from typing import Any

from ansible_collections.rosops.fleet.plugins.module_utils._ros.names import resolve
from ansible_collections.rosops.fleet.plugins.plugin_utils._model import names
from ansible_collections.rosops.fleet.plugins.plugin_utils._model.sharing import unshared, unshared_volume
from ansible_collections.rosops.fleet.plugins.plugin_utils._model.windows import ALWAYS, Windows

_NAMESPACE = re.compile(r"(?:^|\s)__ns:=([\w/]+)")

# A handoff follows from what the app does on the graph: two publishers or services of one name live side by side for a
# moment, two action servers lose goals, and without a pattern nothing may be assumed. What two pods cannot have at once
# makes `replace` of `overlap`.
HANDOFF_BY_PATTERN: dict[str | None, str] = {
    "pubsub": "overlap",
    "service": "overlap",
    "action": "drain",
    None: "replace",
}


# s of a grace period beyond the stop hook's own time: for the hook to start on a busy robot, and for the app to end
STOP_MARGIN = 5


@dataclass(frozen=True)
class Volume:
    """An item of persistent_storage.volumes. Its keys, `mountPath` among them, are those of the dissertation."""

    name: str
    mountPath: str  # noqa: N815 - the inventory's own key
    size: str | float = "1Gi"
    storage_class: str | None = None
    access_mode: str = "ReadWriteOnce"


@dataclass(frozen=True)
class Mount:
    """A volume in an app's container."""

    name: str
    mount_path: str
    read_only: bool = False
    shared: bool = False  # several pods may write to it at once

    def alone(self, volume: Volume) -> str:
        """Why two pods cannot both mount the volume so, or nothing."""
        return unshared_volume(volume.name, volume.access_mode, self.read_only or self.shared)


@dataclass(frozen=True)
class HostPath:
    """A path of the host in an app's container; a host's files are not ours, so writing to them has to be asked for."""

    path: str
    mount_path: str
    read_only: bool = True


@dataclass(frozen=True)
class File:
    """A file in an app's container, by its path there: this text, or what a Secret has under a key.

    The Secret is somebody else's; only its name is known here.
    """

    path: str
    content: str = ""
    secret: str = ""
    key: str = ""
    mode: str = "0644"


@dataclass(frozen=True)
class Port:
    """A port of an app's container, and which one of the robot's host or of all hosts of the cluster leads there."""

    name: str
    port: int
    protocol: str = "TCP"
    host_port: int | None = None
    node_port: int | None = None


@dataclass(frozen=True)
class Launch:
    """A launch file. `replace` and `overlap` are nodes of it, with or without their namespaces."""

    files: tuple[str, ...]
    package: str = ""
    args: Mapping[str, Any] = field(default_factory=dict)
    replace: tuple[str, ...] = ()  # two of them must not be there: under `overlap` they are held back
    overlap: tuple[str, ...] = ()  # two of them may be, whatever they look like on the graph

    @property
    def words(self) -> list[str]:
        """What `_pod/launch.py` and roslaunch understand (wiki.ros.org/roslaunch/Commandline Tools)."""
        return [*self.files, *(f"{name}:={env_value(value)}" for name, value in sorted(self.args.items()))]


@dataclass(frozen=True)
class Readiness:
    """When an app is ready. Topics, services and actions are options of the module ros_ready; times are in seconds."""

    command: str | tuple[str, ...] | None = None
    nodes: bool = True
    topics: tuple[Mapping[str, Any], ...] = ()
    services: tuple[Mapping[str, Any], ...] = ()
    actions: tuple[Mapping[str, Any], ...] = ()
    absent: tuple[str, ...] = ()
    timeout: float = 60.0
    interval: float = 0.5
    consecutive: int = 1


@dataclass(frozen=True)
class UpdateSettings:
    """How an app is updated: without `group` alone, without `on_busy` as the run says.

    `when` is what messages must say before (items of ros_ready's option `values`). The last three are what an update is
    meant to change: names and patterns, old name -> new name, topic -> Hz.
    """

    group: str | None = None
    idle: tuple[str, ...] = ()
    on_busy: str | None = None
    when: tuple[Mapping[str, Any], ...] = ()
    ignore: tuple[str, ...] = ()
    renamed: Mapping[str, str] = field(default_factory=dict)
    rates: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class App:
    """An item of ros_apps. Times are in seconds."""

    name: str
    image: str
    handoff: str
    node_name: str
    command: tuple[str, ...] = ()
    args: tuple[str, ...] = ()
    launch: Launch | None = None  # instead of args
    env: Mapping[str, str | Mapping[str, str]] = field(default_factory=dict)  # text, or Secret and key
    params: Mapping[str, Any] = field(default_factory=dict)  # private to the node, but for names with a slash first
    keep_params: tuple[str, ...] = ()  # names of such
    files: tuple[File, ...] = ()
    ports: tuple[Port, ...] = ()
    placement: str = "remote"
    scope: str = "robot"
    pattern: str | None = None
    private_names: tuple[str, ...] = ()  # without their ~
    volumes: tuple[Mount, ...] = ()
    readiness: Readiness = Readiness()
    hooks: str = "app"  # in the app's container, in a sidecar, or none
    depends_on: tuple[str, ...] = ()
    update: UpdateSettings = UpdateSettings()
    drain_deadline: int = 30
    termination_grace_period: int = 45
    liveness_timeout: int = 120  # as the keeper has it where a pod says nothing; 0: its pod is never begun anew
    resources: Mapping[str, Any] = field(default_factory=dict)
    devices: tuple[str, ...] = ()
    host_network: bool = False
    host_paths: tuple[HostPath, ...] = ()
    overrides: Mapping[str, Any] = field(default_factory=dict)

    @property
    def stop_deadline(self) -> float:
        """Seconds that the stop hook has. Where nobody asked for draining, the grace period may be shorter."""
        grace = self.termination_grace_period
        return min(self.drain_deadline, max(grace - STOP_MARGIN, grace / 2))

    def alone(self) -> list[str]:
        """Why two pods of it cannot be up at once, volumes aside."""
        ports = [{"hostPort": port.host_port} for port in self.ports]
        # a launch file may say which of its nodes has the device: that one is never there twice
        devices = () if self.launch and self.launch.replace else self.devices
        return unshared(devices, self.host_network, self.resources, [self.overrides, ports])


@dataclass(frozen=True)
class Master:
    """The robot's ROS master; a shared one serves all robots and so stands on the edge. `uri` is of an external one.

    `addresses` is Service -> its address, of the master's and its keeper's, as far as the cluster has told them.
    """

    mode: str = "robot"
    image: str = "ros:noetic-ros-core"
    uri: str = ""
    placement: str = "local"
    overrides: Mapping[str, Any] = field(default_factory=dict)
    goal_forwarding: bool = True
    keeper_overrides: Mapping[str, Any] = field(default_factory=dict)
    addresses: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True)
class Robot:
    """One robot. `pull_secrets` are names of Secrets; what is in them stays in the inventory.

    `when` is what messages must say before anything is changed that its apps may notice, as UpdateSettings has it,
    `windows` are the times in which that may be.
    """

    name: str
    namespace: str
    mode: str = "agent"
    apps: tuple[App, ...] = ()
    volumes: tuple[Volume, ...] = ()
    master: Master = Master()
    quota: Mapping[str, Any] = field(default_factory=dict)
    limits: Mapping[str, Any] = field(default_factory=dict)
    pod_security: str = ""
    pull_secrets: tuple[str, ...] = ()
    when: tuple[Mapping[str, Any], ...] = ()
    windows: Windows = ALWAYS

    @classmethod
    def from_variables(cls, variables: Mapping[str, Any], name: str) -> Robot:
        """The robot of an inventory host from its Ansible variables; null and the empty text stand for the default.

        Raises KeyError, TypeError or AttributeError for what the validation refuses.
        """

        def variable(key: str) -> Any:
            # `in` first: hostvars answers .get() of a name it does not know with a marker on some versions
            return variables[key] if key in variables else None  # noqa: SIM401

        volumes = [_volume(item) for item in (variable("persistent_storage") or {}).get("volumes") or ()]
        keys = ("mode", "image", "uri", "placement", "overrides", "goal_forwarding", "keeper_overrides")
        secrets = variable("robot_namespace_pull_secrets") or ()
        windows = {"spans": variable("update_windows"), "zone": variable("update_timezone")}
        return cls(
            **_given(
                {
                    "name": name,
                    "namespace": names.robot_namespace(name),
                    "mode": variable("robot_mode"),
                    "apps": [_app(item, volumes) for item in variable("ros_apps") or ()],
                    "volumes": volumes,
                    "master": _master({key: variable(f"ros_master_{key}") for key in keys}),
                    "quota": variable("robot_namespace_quota"),
                    "limits": variable("robot_namespace_limits"),
                    "pod_security": variable("robot_namespace_pod_security"),
                    "pull_secrets": [secret["name"] for secret in secrets],
                    "when": variable("update_when"),
                    "windows": Windows(**_given(windows)),
                }
            )
        )

    def as_dict(self) -> dict[str, Any]:
        """The robot in mappings, lists and scalars."""
        found: dict[str, Any] = _plain(self)
        return found

    @classmethod
    def from_dict(cls, value: Mapping[str, Any]) -> Robot:
        """The robot that `as_dict` described."""
        given = {
            "apps": [_app_from_dict(item) for item in value["apps"]],
            "volumes": [Volume(**item) for item in value["volumes"]],
            "master": Master(**value["master"]),
            "windows": Windows(**_tuples(value["windows"])),
        }
        return cls(**_tuples({**value, **given}))

    def app(self, name: str) -> App:
        """The app of this name; KeyError where there is none."""
        for app in self.apps:
            if app.name == name:
                return app
        raise KeyError(name)


def namespace_of(app: App, robot: Robot) -> str:
    """Where an app's objects live."""
    return names.FLEET_NAMESPACE if app.scope == "fleet" else robot.namespace


def master_namespace(robot: Robot) -> str:
    """Where the objects of the robot's master live."""
    return names.FLEET_NAMESPACE if robot.master.mode == "shared" else robot.namespace


def master_owner(robot: Robot) -> str | None:
    """The robot to which its master belongs; None for one of the whole fleet."""
    return None if robot.master.mode == "shared" else robot.name


def master_uri(robot: Robot) -> str:
    """ROS_MASTER_URI as the robot's pods need it."""
    if robot.master.mode == "external":
        return robot.master.uri
    return _service_uri(robot, names.MASTER_NAME, names.MASTER_PORT)


def keeper_uri(robot: Robot) -> str | None:
    """Where pods find the keeper of their master; an external master has none."""
    return None if robot.master.mode == "external" else _service_uri(robot, names.KEEPER_NAME, names.KEEPER_PORT)


def _service_uri(robot: Robot, name: str, port: int) -> str:
    """By its address: to look a name up takes the cluster's DNS, which is on another host that may be away."""
    by_name = name + (f".{names.FLEET_NAMESPACE}" if robot.master.mode == "shared" else "")
    return f"http://{robot.master.addresses.get(name) or by_name}:{port}"


def own_space(robot: Robot) -> str:
    """The robot's own ROS namespace where several robots share a master, else the root."""
    return "/" if robot.master.mode == "robot" else "/" + names.ros_name(robot.name)


def robot_space(app: App, robot: Robot) -> str:
    """The ROS namespace that an app gets."""
    return "/" if app.scope == "fleet" else own_space(robot)


def said_namespace(app: App) -> str:
    """The ROS namespace that the app's own command line or environment gives it; empty without one.

    Both client libraries take a `__ns:=` before the variable, and a relative name as one below the root.
    """
    words = [found[1] for word in (*app.command, *app.args) for found in _NAMESPACE.finditer(word)]
    said = words[-1] if words else app.env.get("ROS_NAMESPACE", "")
    return "/" + said.strip("/") if said and isinstance(said, str) else ""


def graph_namespace(app: App, robot: Robot) -> str:
    """The ROS namespace of an app's nodes: as it says itself, else the one that it gets."""
    return said_namespace(app) or robot_space(app, robot)


def graph_node(app: App, robot: Robot, suffix: str = "") -> str:
    """The full ROS node name of an app, with the revision's suffix where it has one."""
    return resolve(app.node_name + suffix, graph_namespace(app, robot), "")


def env_value(value: Any) -> str | Mapping[str, str]:
    """An environment value as the text a container gets, or where it is; YAML's booleans become true and false."""
    if isinstance(value, Mapping):
        return dict(value)
    if isinstance(value, bool):
        return "true" if value else "false"
    return str(value)


def _volume(raw: Mapping[str, Any]) -> Volume:
    return Volume(**{"mountPath": names.default_mount_path(str(raw["name"])), **_given(raw)})


def _app(raw: Mapping[str, Any], volumes: Sequence[Volume]) -> App:
    paths = {volume.name: volume.mountPath for volume in volumes}

    def mount(item: Mapping[str, Any]) -> Mount:
        path = paths.get(item["name"], names.default_mount_path(str(item["name"])))
        return Mount(**{"mount_path": path, **_given(item)})

    given = _given(raw)
    readiness, launch = given.get("readiness", {}), given.get("launch")
    if launch:
        readiness = {"nodes": False, **readiness}
    computed = {
        "launch": _launch(launch) if launch else None,
        "handoff": given.get("handoff") or HANDOFF_BY_PATTERN[given.get("pattern")],
        "placement": given.get("placement") or ("local" if given.get("devices") else "remote"),
        "node_name": given.get("node_name") or names.ros_name(str(raw["name"])),
        "env": {str(key): env_value(value) for key, value in (raw.get("env") or {}).items()},
        "private_names": [str(name).lstrip("~") for name in given.get("private_names", ())],
        "depends_on": list(dict.fromkeys(given.get("depends_on", ()))),
        "volumes": [mount(item) for item in given.get("volumes", ())],
        "files": [_file(item) for item in given.get("files", ())],
        "ports": [Port(**_given(item)) for item in given.get("ports", ())],
        "host_paths": [
            HostPath(**{"mount_path": item["path"], **_given(item)}) for item in given.get("host_paths", ())
        ],
        "readiness": _readiness(readiness),
        "update": UpdateSettings(**_given(given.get("update", {}))),
    }
    app = App(**_tuples({**given, **computed}))
    if given.get("handoff") or app.handoff != "overlap":
        return app
    pairs = [(mount, volume) for mount in app.volumes for volume in volumes if mount.name == volume.name]
    alone = app.alone() or any(mount.alone(volume) for mount, volume in pairs)
    return replace(app, handoff="replace") if alone else app


def _launch(raw: Mapping[str, Any]) -> Launch:
    """One file may be said without a list."""
    given = _given({key: value for key, value in raw.items() if key != "file"})
    files = raw["file"]
    return Launch(tuple(files) if isinstance(files, list) else (files,), **given)


def _file(raw: Mapping[str, Any]) -> File:
    """A Secret's key is named as the file, unless it is said."""
    key = {"key": raw["path"].rpartition("/")[2]} if raw.get("secret") else {}
    return File(**{**key, **_given(raw)})


def _readiness(raw: Mapping[str, Any]) -> Readiness:
    """Services and actions may be given as plain names."""

    def named(item: Any) -> dict[str, Any]:
        return dict(item) if isinstance(item, Mapping) else {"name": item}

    given = _given(raw)
    given["services"] = [named(item) for item in given.get("services", ())]
    given["actions"] = [{"state": "up", **named(item)} for item in given.get("actions", ())]
    return Readiness(**_tuples(given))


def _master(raw: Mapping[str, Any]) -> Master:
    given = _given(raw)
    return Master(**{"placement": "remote" if given.get("mode") == "shared" else "local", **given})


def _app_from_dict(value: Mapping[str, Any]) -> App:
    given = {
        "volumes": [Mount(**item) for item in value["volumes"]],
        "launch": Launch(**_tuples(value["launch"])) if value["launch"] else None,
        "files": [File(**item) for item in value["files"]],
        "ports": [Port(**item) for item in value["ports"]],
        "host_paths": [HostPath(**item) for item in value["host_paths"]],
        "readiness": Readiness(**_tuples(value["readiness"])),
        "update": UpdateSettings(**_tuples(value["update"])),
    }
    return App(**_tuples({**value, **given}))


def _given(raw: Mapping[str, Any]) -> dict[str, Any]:
    """What is said in a mapping; its lists become tuples."""
    return _tuples({key: value for key, value in raw.items() if value is not None and value != ""})


def _tuples(value: Mapping[str, Any]) -> dict[str, Any]:
    return {str(key): tuple(item) if isinstance(item, list) else item for key, item in value.items()}


def _plain(value: Any) -> Any:
    if is_dataclass(value):
        return {item.name: _plain(getattr(value, item.name)) for item in fields(value)}
    if isinstance(value, Mapping):
        return {key: _plain(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(item) for item in value]
    return value
