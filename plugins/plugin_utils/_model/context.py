# SPDX-License-Identifier: GPL-3.0-or-later
"""What the collection has to know of a robot: its variables with every documented default filled in, and no secret.

`Robot.from_variables` fills the defaults in, once per run; everybody else reads a `Robot`. By `plain` and `read` of
keys.py it travels as an Ansible fact.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import Annotated, Any

from ansible.module_utils.parsing.convert_bool import boolean

from ...module_utils._common.documents import Variables
from ...module_utils._ros.names import resolve
from . import names
from .app import App, Volume, When
from .keys import Follows, read
from .windows import ALWAYS, Windows

_NAMESPACE = re.compile(r"(?:^|\s)__ns:=([\w/]+)")


@dataclass(frozen=True)
class MasterSettings:
    """The robot's ROS master; a shared one serves all robots and so stands on the edge. `uri` is of an external one.

    `addresses` is Service -> its address, of the master's and its keeper's, as far as the cluster has told them.
    """

    mode: str = "robot"
    image: str = "ros:noetic-ros-core"
    uri: str = ""
    placement: Annotated[str, Follows(lambda said: "remote" if said.get("mode") == "shared" else "local")] = "local"
    overrides: Variables = field(default_factory=dict)
    goal_forwarding: bool = True
    keeper_overrides: Variables = field(default_factory=dict)
    addresses: Mapping[str, str] = field(default_factory=dict)

    @property
    def ours(self) -> bool:
        """Whether it runs in the cluster: neither is it somebody else's, nor is there no ROS."""
        return self.mode in ("robot", "shared")


@dataclass(frozen=True)
class Observability:
    """What the robot's own pods have to know of the variable `observability`; the rest of it is the cluster's."""

    enabled: bool = False
    ros_metrics: bool = True


@dataclass(frozen=True)
class Robot:
    """One robot. `pull_secrets` are names of Secrets; what is in them stays in the inventory.

    `when` is what messages must say before anything is changed that its apps may notice, as UpdateSettings has it,
    `windows` are the times in which that may be. `old_labels`: those of its workloads that choose their
    node by the labels of 1.0.
    """

    name: str
    namespace: str
    mode: str = "agent"
    apps: tuple[App, ...] = ()
    volumes: tuple[Volume, ...] = ()
    master: MasterSettings = MasterSettings()
    quota: Variables = field(default_factory=dict)
    limits: Variables = field(default_factory=dict)
    pod_security: str = ""
    edge_host_access: Annotated[bool, boolean] = False  # a variable that `-e name=value` gives is a text
    admits: tuple[str, ...] = ()
    pull_secrets: tuple[str, ...] = ()
    when: When = ()
    windows: Windows = ALWAYS
    observability: Observability = Observability()
    old_labels: tuple[str, ...] = ()

    @classmethod
    def from_variables(cls, variables: Variables, name: str) -> Robot:
        """The robot of an inventory host from its Ansible variables, as `read` takes them."""
        apps = variables.get("ros_apps") or ()
        master = ("mode", "image", "uri", "placement", "overrides", "goal_forwarding", "keeper_overrides")
        namespace = ("quota", "limits", "pod_security", "edge_host_access", "admits")
        found = read(
            cls,
            {
                "name": name,
                "namespace": names.robot_namespace(name),
                "mode": variables.get("robot_mode"),
                "apps": apps,
                "volumes": (variables.get("persistent_storage") or {}).get("volumes"),
                "master": {key: variables.get(f"ros_master_{key}") for key in master},
                **{key: variables.get(f"robot_namespace_{key}") for key in namespace},
                "pull_secrets": [secret["name"] for secret in variables.get("robot_namespace_pull_secrets") or ()],
                "when": variables.get("update_when"),
                "observability": variables.get("observability"),
                "windows": {"spans": variables.get("update_windows"), "zone": variables.get("update_timezone")},
            },
        )
        settled = (_settled(app, said, found) for app, said in zip(found.apps, apps))
        return replace(found, apps=tuple(settled))


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
    """ROS_MASTER_URI as the robot's pods need it; without ROS the keeper's, which has an empty graph."""
    if robot.master.mode == "external":
        return robot.master.uri
    if robot.master.mode == "none":
        return _service_uri(robot, names.KEEPER_NAME, names.KEEPER_PORT)
    return _service_uri(robot, names.MASTER_NAME, names.MASTER_PORT)


def keeper_uri(robot: Robot) -> str | None:
    """Where pods find the keeper that holds goals and latched messages; an external master has none."""
    return _service_uri(robot, names.KEEPER_NAME, names.KEEPER_PORT) if robot.master.ours else None


def _service_uri(robot: Robot, name: str, port: int) -> str:
    """By its address: to look a name up takes the cluster's DNS, which is on another host that may be away."""
    by_name = name + (f".{names.FLEET_NAMESPACE}" if robot.master.mode == "shared" else "")
    return f"http://{robot.master.addresses.get(name) or by_name}:{port}"


def own_space(robot: Robot) -> str:
    """The robot's own ROS namespace where several robots share a master, else the root."""
    return "/" if robot.master.mode in ("robot", "none") else "/" + names.ros_name(robot.name)


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


def wanted_before(robot: Robot, apps: Iterable[App] = ()) -> list[dict[str, Any]]:
    """What has to be said before these apps are changed, or anything of the robot; topics with their full names."""
    said = [(item, own_space(robot)) for item in robot.when]
    said += [(item, graph_namespace(app, robot)) for app in apps for item in app.update.when]
    named: list[tuple[dict[str, Any], str]] = [({**item}, space) for item, space in said]
    return [{**item, "topic": resolve(item["topic"], space, "")} if "topic" in item else item for item, space in named]


def _settled(app: App, said: Variables, robot: Robot) -> App:
    """The app with the defaults that follow from the robot's volumes and master, and from how it is started."""
    paths = {volume.name: volume.mountPath for volume in robot.volumes}
    mounts = [
        replace(mount, mount_path=mount.mount_path or paths.get(mount.name) or names.default_mount_path(mount.name))
        for mount in app.volumes
    ]
    nodes = app.readiness.nodes and not (app.launch and (said.get("readiness") or {}).get("nodes") is None)
    nodes = nodes and robot.master.mode != "none"
    app = replace(app, volumes=tuple(mounts), readiness=replace(app.readiness, nodes=nodes))
    if app.handoff == "overlap" and not said.get("handoff"):
        pairs = [(mount, volume) for mount in mounts for volume in robot.volumes if mount.name == volume.name]
        alone = app.alone() or any(mount.alone(volume) for mount, volume in pairs)
        app = replace(app, handoff="replace") if alone else app
    calls = app.pattern != "pubsub" or app.readiness.services or app.readiness.actions
    if robot.master.mode == "none":
        return replace(app, hooks="none")
    if said.get("hooks") or calls or not_gated(app, robot):
        return app
    return replace(app, hooks="gate")


def not_gated(app: App, robot: Robot) -> str:
    """Why no keeper can say from outside when a pod of the app is ready; empty where one can."""
    if namespace_of(app, robot) not in (robot.namespace, master_namespace(robot)):
        return "no keeper looks after what is the whole fleet's"
    if app.handoff != "overlap":
        return f"handoff is {app.handoff}, and who comes waits in the pod for the end of who goes"
    if app.launch:
        return "launch is started by code in the pod"
    return "params are set in the pod before it starts" if app.params or app.keep_params else ""
