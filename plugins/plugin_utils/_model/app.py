# SPDX-License-Identifier: GPL-3.0-or-later
"""The keys of an app and of a volume: the only table of them. What its annotations mean: keys.py.

A key is added here. After that `python tools/docs/keys.py` writes the roles' argument specs.
"""

# no `from __future__ import annotations`: a lambda in an annotation that is a text would not find this module's names
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Annotated, Any, Literal, Required, TypedDict

from ...module_utils._common.documents import Variables
from ...module_utils._step.words import LIVENESS_LEAST, LIVENESS_TIMEOUT
from .formats import FILLED, FORMS, Form, number, whole
from .keys import Follows, either
from .names import default_mount_path, ros_name

# A handoff follows from what the app does on the graph: two publishers or services of one name live side by side for a
# moment, two action servers lose goals, and without a pattern nothing may be assumed. What two pods cannot have at once
# makes `replace` of `overlap`.
HANDOFF_BY_PATTERN = {"pubsub": "overlap", "service": "overlap", "action": "drain", None: "replace"}

# s of a grace period beyond the stop hook's own time: for the hook to start on a busy robot, and for the app to end
STOP_MARGIN = 5

# What these have on the graph is their clients' wish, and the clients come to a pod once it is ready.
_ON_DEMAND = re.compile(r"\b(rosbridge_(server|websocket|tcp|udp)|foxglove_bridge|web_video_server)\b")

AppName = Annotated[str, FORMS["app-name"]]
GraphName = Annotated[str, FORMS["graph-name"]]
Filled = Annotated[str, FILLED]
Positive = Annotated[float, number(0, above=True)]
NotNegative = Annotated[float, number(0)]
Count = Annotated[int, whole(0)]
NEVER = f"0 for never, or {LIVENESS_LEAST} seconds and more"
Liveness = Annotated[int, Form(lambda said: said == 0 or LIVENESS_LEAST <= said <= 86400, NEVER)]
Scalar = str | float | bool
GraphPattern = Annotated[str, FORMS["graph-pattern"]]
LaunchFile = Annotated[str, FORMS["launch-file"]]
MountPath = Annotated[str, FORMS["mount-path"]]
NodePath = Annotated[str, FORMS["node-path"]]
ParamName = Annotated[str, FORMS["param-name"]]
VolumeName = Annotated[str, FORMS["volume-name"]]
QUANTITY = either(FORMS["quantity"].allowed, Annotated[str, FORMS["quantity"]], NotNegative)
SIZE = either(FORMS["size"].allowed, Annotated[str, FORMS["size"]], Positive)
Quantities = Mapping[Annotated[str, FORMS["resource-name"]], Annotated[str | float, QUANTITY]]
PORT = whole(1, 65535)
NODE_PORT = whole(30000, 32767)
NAMED = "a ROS name or a mapping with the key name"


def env_value(value: Any) -> str | Mapping[str, str]:
    """An environment value as the text a container gets, or where it is; YAML's booleans become true and false."""
    if isinstance(value, Mapping):
        return dict(value)
    if isinstance(value, bool):
        return "true" if value else "false"
    return str(value)


class Condition(TypedDict, total=False):
    """What messages must say. Its keys are documented with the module ros_ready, and what else of them has to be true
    is judged by its code (_validate/app.py, when_problems)."""

    topic: GraphName
    url: Filled
    field: Filled
    equals: Scalar
    above: float
    below: float
    quiet: Positive
    still: Positive
    tolerance: NotNegative


When = tuple[Condition, ...]


def _named(item: Any) -> Variables:
    return item if isinstance(item, Mapping) else {"name": item}


def _action(item: Any) -> Variables:
    return {"state": "up", **_named(item)}


class ReadyTopic(TypedDict, total=False):
    """What the graph has to show of a topic: options of the module ros_ready."""

    name: Required[GraphName]
    """The topic; a relative name is resolved in the app's ROS namespace."""
    type: Annotated[str, FORMS["ros-type"]]
    """Its message type."""
    publishers: Count
    """At least so many publishers."""
    subscribers: Count
    """At least so many subscribers."""
    connected: bool
    """Every subscriber is connected, seen from the publishers."""
    min_rate: Positive
    """At least so many messages per second."""


class ReadyService(TypedDict, total=False):
    """A service that has to answer."""

    name: Required[GraphName]


class ReadyAction(TypedDict, total=False):
    """An action server that has to be there."""

    name: Required[GraphName]
    state: Literal["up", "idle"]


class ReadyHttp(TypedDict, total=False):
    """What the pod has to answer with a status from 200 to 399."""

    port: Required[Annotated[int, PORT]]
    """A port of the container."""
    path: MountPath
    """The path that is asked for; without it C(/)."""


@dataclass(frozen=True)
class Readiness:
    """When an app is ready."""

    http: ReadyHttp | None = None
    """What the container has to answer over HTTP, in place of O(ros_apps[].readiness.command)."""
    command: Annotated[
        str | tuple[str, ...] | None,
        either("a command as text, or as a list of texts", Filled, Annotated[tuple[str, ...], FILLED]),
        lambda said: tuple(said) if isinstance(said, list) else said,
    ] = None
    """What the container has to say to being ready, with exit status 0; a path, a shell command or a list."""
    nodes: bool = True
    """Whether the app's own ROS node has to be up."""
    topics: tuple[ReadyTopic, ...] = ()
    """Topics that the graph has to show."""
    services: tuple[Annotated[ReadyService, either(NAMED, GraphName, ReadyService), _named], ...] = ()
    """Services that have to answer a probe, as names or as mappings with the key C(name)."""
    actions: tuple[Annotated[ReadyAction, either(NAMED, GraphName, ReadyAction), _action], ...] = ()
    """Action servers, as names or as mappings with the keys C(name) and C(state) (C(up) or C(idle))."""
    absent: tuple[GraphName, ...] = ()
    """ROS nodes that have to be gone."""
    timeout: Positive = 60.0
    """Seconds until all of it has to be true."""
    interval: Positive = 0.5
    """Seconds between two looks at the graph."""
    consecutive: Annotated[int, whole(1, 1000)] = 1
    """How often in a row it has to be true."""


USUAL = Readiness()


@dataclass(frozen=True)
class Volume:
    """An item of persistent_storage.volumes. Its keys, `mountPath` among them, are those of the dissertation."""

    name: VolumeName
    """The volume's name; the claim is C(<name>-pvc)."""
    mountPath: Annotated[MountPath, Follows(lambda said: default_mount_path(str(said["name"])))]  # noqa: N815 - a key
    """Where apps find it; without it C(/mnt/data/<name>)."""
    size: Annotated[str | float, SIZE] = "1Gi"
    """Size as a Kubernetes quantity."""
    storage_class: Annotated[str | None, FORMS["dns-name"]] = None
    """The storage class; without it the cluster's default, C(local-path) on k3s."""
    access_mode: Literal["ReadWriteOnce", "ReadOnlyMany", "ReadWriteMany", "ReadWriteOncePod"] = "ReadWriteOnce"
    """How nodes may mount it."""


@dataclass(frozen=True)
class Mount:
    """A volume in an app's container. Where `mount_path` is empty, the robot's volumes say it (context.py)."""

    name: VolumeName
    """The volume's name."""
    mount_path: MountPath = ""
    """Where to mount it; without it the volume's own C(mountPath)."""
    read_only: bool = False
    """Mount it read-only."""
    shared: bool = False
    """Several pods of the app may write to it at once, as each has files of its own. Else a version that writes to a
    volume comes when the one before has gone, unless the volume is V(ReadWriteMany)."""

    def alone(self, volume: Volume) -> str:
        """Why two pods cannot both mount the volume so, wherever they are; nothing where they can."""
        if volume.access_mode == "ReadWriteOncePod":
            return f"{volume.name} is {volume.access_mode}: one pod's only"
        careful = self.read_only or self.shared or volume.access_mode == "ReadWriteMany"
        return "" if careful else f"both would write to {volume.name}"


@dataclass(frozen=True)
class HostPath:
    """A path of the host in an app's container; a host's files are not ours, so writing to them has to be asked for."""

    path: Annotated[str, FORMS["host-path"]]
    """The path on the host."""
    mount_path: Annotated[MountPath, Follows(lambda said: said["path"])]
    """Where to mount it; without it the same path."""
    read_only: bool = True
    """Mount it read-only."""


@dataclass(frozen=True)
class File:
    """A file in an app's container: this text, or what somebody's Secret, of which only the name is known, has."""

    path: MountPath
    """Where the container finds it."""
    content: Annotated[str, FORMS["unicode"]] = ""
    """Its text, at most 900000 bytes for all files of an app."""
    secret: Annotated[str, FORMS["dns-name"]] = ""
    """The Secret of the app's namespace that has the text instead; it is yours. A changed one is noticed when the pod
    starts, so give it another name."""
    key: Annotated[
        str, FORMS["secret-key"], Follows(lambda said: said["path"].rpartition("/")[2] if said.get("secret") else "")
    ] = ""
    """What the Secret calls the file; without it the last part of O(ros_apps[].files[].path)."""
    mode: Annotated[str, FORMS["file-mode"]] = "0644"
    """Its permissions, four octal digits in quotes."""


@dataclass(frozen=True)
class Port:
    """A port of an app's container, and which one of the robot's host or of all hosts of the cluster leads there."""

    name: Annotated[str, FORMS["port-name"]]
    """Its name, at most 15 lower-case letters, digits and dashes. By it the Service finds the port of each version."""
    port: Annotated[int, PORT]
    """The port that the app listens at."""
    protocol: Literal["TCP", "UDP"] = "TCP"
    """TCP or UDP."""
    host_port: Annotated[int | None, PORT] = None
    """The port of the robot's host that leads there, for apps with O(ros_apps[].placement=local). One pod's only."""
    node_port: Annotated[int | None, NODE_PORT] = None
    """The port of every host of the cluster that leads there, 30000 to 32767."""


@dataclass(frozen=True)
class Launch:
    """A launch file, or several. `replace` and `overlap` are nodes of it, with or without their namespaces."""

    file: Annotated[
        tuple[str, ...],
        either("a launch file's name, or a list of them", LaunchFile, Annotated[tuple[LaunchFile, ...], FILLED]),
        lambda said: said if isinstance(said, list) else [said],
    ]
    """Its name, or its whole path in the container, where no package is given; or a list of them."""
    package: Annotated[str, FORMS["package-name"]] = ""
    """The ROS package that it is in."""
    args: Mapping[Annotated[str, FORMS["launch-arg"]], Scalar] = field(default_factory=dict)
    """Its C(<arg>)s, name and value."""
    replace: tuple[NodePath, ...] = ()
    """Nodes of which there must not be two, as they have a device, serve an action or move the robot. While the others
    overlap these begin when those of the version before have ended."""
    overlap: tuple[NodePath, ...] = ()
    """Nodes of which there may be two, although they look on the graph as if there must not."""

    @property
    def words(self) -> list[str]:
        """What `_pod/launch.py` and roslaunch understand (wiki.ros.org/roslaunch/Commandline Tools)."""
        return [*self.file, *(f"{name}:={env_value(value)}" for name, value in sorted(self.args.items()))]


@dataclass(frozen=True)
class UpdateSettings:
    """How an app is updated. The last three are what an update is meant to change."""

    group: Annotated[str | None, FORMS["app-name"]] = None
    """Apps of one group are updated together, as one step."""
    idle: tuple[GraphName, ...] = ()
    """Actions, this app's or others', that have to be idle before it is updated."""
    on_busy: Literal["wait", "defer", "force"] | None = None
    """What to do when they are not, instead of what the run says; in a group the most careful of these counts."""
    when: When = ()
    """What messages, or HTTP servers, must say before it is updated, besides C(update_when) of the role C(update).
    Items are as the option C(values) of the module M(rosops.fleet.ros_ready) takes them. A relative topic stands in the
    app's ROS namespace.

    What they do not say is waited for, deferred or forced like a busy action."""
    ignore: tuple[GraphPattern, ...] = ()
    """Topics, services and actions that may be missing after an update, or be of another type. C(*) stands for
    anything, as in V(/debug/*); V(*) leaves the app's node itself.

    Within an O(ros_apps[].update.group) types may change without this."""
    renamed: Mapping[GraphName, GraphName] = field(default_factory=dict)
    """Topics, services and actions that have another name after an update, as V({/old: /new})."""
    rates: Mapping[GraphPattern, NotNegative] = field(default_factory=dict)
    """Messages per second that a topic has to carry after an update, whatever it carried before, as V({/scan: 10}).
    With V(0) its rate is not looked at. C(*) stands for anything."""


class Resources(TypedDict, total=False):
    """As Kubernetes has them."""

    requests: Quantities
    """What is set aside for it."""
    limits: Quantities
    """What it may not exceed."""


def _no_resources() -> Resources:
    return {}


class SecretKey(TypedDict):
    """What a Secret of the app's namespace has under a key."""

    secret: Annotated[str, FORMS["dns-name"]]
    key: Annotated[str, FORMS["secret-key"]]


ENV_VALUES = either("a text, a number, true, false, or a mapping with secret and key", Scalar, SecretKey)
EnvValue = Annotated[str | Mapping[str, str], ENV_VALUES, env_value]


@dataclass(frozen=True, kw_only=True)
class App:
    """An item of ros_apps. Times are in seconds."""

    name: AppName
    """Name of the app and of its Deployment, a DNS label of at most 40 characters."""
    image: Annotated[str, FORMS["image"]]
    """The container image."""
    command: Annotated[tuple[str, ...], FILLED] = ()
    """The command, instead of the image's entry point."""
    args: tuple[str, ...] = ()
    """Its arguments; ROS remappings and the node's name are added."""
    launch: Launch | None = None
    """The launch file that is the app, instead of O(ros_apps[].args); all nodes that it starts are the app, and are
    found by the pod's address. They are replaced together, or, with the O(ros_apps[].pattern) V(pubsub) or V(service),
    overlap, each under a name of its version, but for those in O(ros_apps[].launch.replace).

    Where its text is in O(ros_apps[].files), its nodes and arguments are checked before any host is touched; a node
    that is known to be one of which there must not be two has to be in C(replace) or C(overlap) then."""
    env: Mapping[Annotated[str, FORMS["env-name"]], EnvValue] = field(default_factory=dict)
    """Environment variables. A value is a text, or C({secret, key}) for what a Secret of the app's namespace has under
    a key."""
    params: Mapping[ParamName, Any] = field(default_factory=dict)
    """Parameters on the ROS parameter server, name and value, a mapping being a namespace of them. They are set before
    the app starts; a changed one is another revision, which is proven and taken back as an image is.

    A name is private to the app's node, as in a C(<node>) of a launch file, and goes with it. One that begins with a
    slash is read by all, stays, and cannot be had with the handoff V(overlap), as the version before would read it,
    too."""
    keep_params: tuple[ParamName, ...] = ()
    """Names of parameters whose values a new version takes over from the version at work, as they are on the parameter
    server by then. They win over O(ros_apps[].params); where there is none yet, that counts. A mapping against a value
    that is none, or a text against a number, is not taken over, and the container's log says so.

    With another handoff than V(overlap) a version that ends leaves what it names itself, so it has to name them
    already.

    The name of a mapping is all below it. A name may be one that only the node sets itself."""
    files: tuple[File, ...] = ()
    """Files in the container, read-only. A changed one is another revision, which is proven and taken back as an image
    is."""
    ports: tuple[Port, ...] = ()
    """Ports of the container. A Service of the app's name leads to them, but for other robots, as
    C(<app>.robot-<robot>:<port>)."""
    placement: Annotated[
        Literal["local", "remote"], Follows(lambda said: "local" if said.get("devices") else "remote")
    ] = "remote"
    """V(local) on the robot itself, V(remote) on an edge host. Without it V(local) with O(ros_apps[].devices), else
    V(remote)."""
    scope: Literal["robot", "fleet"] = "robot"
    """One instance per robot, or one for the fleet (needs a shared or an external master)."""
    pattern: Literal["pubsub", "service", "action"] | None = None
    """What the app does on the graph; it decides how an update hands over."""
    handoff: Annotated[
        Literal["overlap", "drain", "replace"], Follows(lambda said: HANDOFF_BY_PATTERN[said.get("pattern")])
    ]
    """How a new revision takes over. Without it V(overlap) for the patterns V(pubsub) and V(service), V(drain) for
    V(action), and V(replace) where no pattern is given.

    What two pods cannot have at once makes V(replace) of it, and V(overlap) an error. These are devices, the host's
    network or ports, resources of a device plugin (GPUs), and a volume that both would write to."""
    node_name: Annotated[str, FORMS["node-name"], Follows(lambda said: ros_name(str(said["name"])))]
    """The ROS node's name, without a slash; without it the app's name with C(_) for C(-)."""
    private_names: tuple[Annotated[str, FORMS["private-name"], lambda said: str(said).lstrip("~/")], ...] = ()
    """Private names that stay below the stable node name when the handoff is V(overlap)."""
    volumes: tuple[Mount, ...] = ()
    """Volumes of V(persistent_storage) to mount."""
    readiness: Readiness = USUAL
    """What has to be seen before the app counts as ready."""
    hooks: Literal["gate", "app", "sidecar", "none"] = "app"
    """Where it is seen that a pod is wholly connected, and by whom it is stopped cleanly.

    V(gate): from outside, by the keeper, which sets a readiness gate of the pod. Nothing of the collection is
    in the pod, whatever its image has. It is the default where that suffices: for the pattern V(pubsub) with
    O(ros_apps[].handoff) V(overlap), and neither O(ros_apps[].launch), O(ros_apps[].params), O(ros_apps[].keep_params)
    nor services and actions in O(ros_apps[].readiness). Not for the scope V(fleet) with an external ROS master: no
    keeper looks after these. Calls of its services that are under way when a version ends are not waited for.

    V(app), elsewhere the default: by a probe and a stop hook in the app's own container, the image of which needs
    C(python3) 3.8 or newer.

    V(sidecar): by those in a container of C(ros_master_image) beside it, for any image (Kubernetes 1.29 or newer; not
    with C(host_network)). An image without such a C(python3) needs it.

    V(none): O(ros_apps[].readiness.command) alone decides, asked every second until it has agreed, then every ten, and
    an update is Kubernetes' own."""
    depends_on: Annotated[tuple[AppName, ...], dict.fromkeys] = ()
    """Apps of the same robot that are updated before this one."""
    update: UpdateSettings = UpdateSettings()
    """How the app is updated."""
    drain_deadline: Count = 30
    """Seconds that goals and service calls under way may take to end before their pod is stopped."""
    termination_grace_period: Annotated[int, whole(1)] = 45
    """Seconds between the begin of the stop and the kill; at least 5 more than O(ros_apps[].drain_deadline)."""
    liveness_timeout: Liveness = LIVENESS_TIMEOUT
    """Seconds for which a ROS node of the app may leave the slave API unanswered while its process lives. Then its pod
    is begun anew by the robot's keeper (not during a goal, nor while an update is under way, and three times an hour at
    most).

    V(0) is never. Beside an external master it is so, too."""
    resources: Resources = field(default_factory=_no_resources)
    """The container's resources."""
    devices: tuple[Annotated[str, FORMS["device"]], ...] = ()
    """Device nodes of the robot that the app drives, such as C(/dev/ttyUSB0). They need a privileged container, and a
    version gets them when the one before has gone."""
    host_network: bool = False
    """Use the host's network, for drivers."""
    host_paths: tuple[HostPath, ...] = ()
    """Directories of the host to mount."""
    overrides: Variables = field(default_factory=dict)
    """Merged last into the Deployment, whose container is C(ros-app), recursively, lists of named entries by name; a
    null removes a key."""

    @property
    def on_demand(self) -> bool:
        """Whether it subscribes and publishes as its clients ask, known by its command."""
        launched = (self.launch.package, *self.launch.file) if self.launch else ()
        return any(_ON_DEMAND.search(word) for word in (*self.command, *self.args, *launched))

    @property
    def stop_deadline(self) -> float:
        """Seconds that the stop hook has. Where nobody asked for draining, the grace period may be shorter."""
        grace = self.termination_grace_period
        return min(self.drain_deadline, max(grace - STOP_MARGIN, grace / 2))

    def alone(self) -> list[str]:
        """Why two pods of it cannot be up at once, volumes aside."""
        # a launch file may say which of its nodes has the device: that one is never there twice
        devices = () if self.launch and self.launch.replace else self.devices
        found = [f"{device} is one device, and the two would both drive it" for device in devices]
        ports = [{"hostPort": port.host_port} for port in self.ports]
        for path, value in _leaves([{"host_network": self.host_network}, self.resources, self.overrides, ports]):
            if path[-1] == "hostPort" and value:
                found.append(f"host port {value} can be one pod's only")
            elif path[-1] in ("host_network", "hostNetwork") and value is True:
                found.append(f"{path[-1]} gives both the same ports of one host")
            # of a device plugin, such as nvidia.com/gpu
            elif path[-2:-1] in (("requests",), ("limits",)) and "/" in str(path[-1]) and str(value) != "0":
                found.append(f"{path[-1]} is given to one of them, and the other is never placed")
        return list(dict.fromkeys(found))


def _leaves(value: Any, path: tuple[Any, ...] = ()) -> Iterator[tuple[tuple[Any, ...], Any]]:
    """Path and value of everything in mappings and lists of any shape; what null removes is not there."""
    if isinstance(value, (Mapping, list, tuple)):
        for key, item in value.items() if isinstance(value, Mapping) else enumerate(value):
            yield from _leaves(item, (*path, key))
    elif path and value is not None:
        yield path, value
