# SPDX-License-Identifier: GPL-3.0-or-later
"""One app of one robot -> its Deployment. Pure: the same robot gives the same bytes on every run."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from typing import Any

from ...module_utils._step import words
from ...module_utils._step.objects import Object
from .._model import context, names
from .._model.app import App
from .._model.context import Robot
from .._model.merge import deep_merge
from . import pod_code as hooks
from .belongings import container_ports, file_volumes, owner_of
from .common import (
    ALL,
    APPS,
    RECREATE_STRATEGY,
    annotate,
    field_variable,
    harden,
    mount,
    pod_spec,
    variable,
    workload,
)
from .placement import node_selector
from .pod_settings import app_settings, gate_settings

REVISION_LENGTH = 8
_REFERENCE = re.compile(r"\$\(([-._a-zA-Z0-9]+)\)")  # kubernetes.io, "Define Dependent Environment Variables"
# Under `overlap` the new pod comes beside the old one, under a ROS node name of its own; else the old one goes first.
OVERLAP_STRATEGY = {"type": "RollingUpdate", "rollingUpdate": {"maxSurge": 1, "maxUnavailable": 0}}
REVISION = field_variable(names.REVISION_ENV, f"metadata.labels['{names.LABEL_REVISION}']")


def app_objects(robot: Robot) -> list[Object]:
    """One Deployment per app, in the order of ros_apps."""
    return [app_deployment(app, robot) for app in robot.apps]


def app_deployment(app: App, robot: Robot) -> Object:
    """The Deployment of an app.

    The overrides come last, then the ROS node name: it carries the revision, which is the hash of the template with the
    overrides in it, and where versions overlap the hash that Kubernetes has of all of it. So whatever changes the pod,
    and whoever does, also gives it a name of its own. The annotation has the name of the revision: the other hash is
    known in the pod alone (`_ros/names.py`).
    """
    deployment = deep_merge(plain_deployment(app, robot), app.overrides)
    template = deployment["spec"]["template"]
    container = next(one for one in template["spec"]["containers"] if one["name"] == names.APP_CONTAINER)
    harden(container, APPS)
    beside = [one for one in template["spec"].get("initContainers") or [] if one["name"] == names.SIDECAR]
    for one in beside:
        harden(one, ALL)
    metadata = annotate(template)["metadata"]
    revision = metadata["annotations"][names.ANNOTATION_HASH][:REVISION_LENGTH]
    # Two revisions that overlap need two ROS names, else the master makes them evict each other. So do two pod
    # templates of one revision: `kubectl rollout restart` makes another one.
    suffix = f"_{revision}" if app.handoff == "overlap" else ""
    in_pod = app.node_name + (f"{suffix}_$({names.TEMPLATE_ENV})" if suffix else "")
    if args := [*(container.get("args") or []), *_naming_args(app, robot, in_pod)]:
        container["args"] = args
    nameless = app.launch or robot.master.mode == "none"  # whose nodes have names of their own, or that is no node
    told = [] if nameless or app.hooks == "gate" else [variable(names.NODE_NAME_ENV, in_pod)]
    for one in [container, *beside]:
        one["env"] = [*(one.get("env") or []), *told]
    metadata["labels"] = {**(metadata.get("labels") or {}), names.LABEL_REVISION: revision}
    if not nameless:
        metadata["annotations"][names.ANNOTATION_NODE] = context.graph_node(app, robot, suffix)
    return annotate(deployment)


def plain_deployment(app: App, robot: Robot) -> Object:
    """The Deployment before the overrides and without the ROS node name."""
    notes, pod = {words.HANDOFF: str(app.handoff)}, dict[str, Any]()
    if app.liveness_timeout != words.LIVENESS_TIMEOUT:
        notes[words.LIVENESS] = str(app.liveness_timeout)
    if app.host_network:  # then the Service name ros-master resolves only when it is asked for
        pod = {"hostNetwork": True, "dnsPolicy": "ClusterFirstWithHostNet"}
    if app.hooks == "sidecar":
        pod["initContainers"] = [hooks.sidecar(app, robot, _for_hooks(app, robot))]
    if app.hooks == "gate":  # who looks at its pods from outside is told what is to be seen of them
        pod["readinessGates"] = [{"conditionType": words.READINESS}]
        notes[words.SETTINGS] = json.dumps(gate_settings(app, robot), sort_keys=True)
    code = [hooks.code_volume(app)] if app.hooks in hooks.IN_POD else []
    spec = pod_spec(
        [_container(app, robot)],
        [*(source for source, _mount in _volumes(app)), *code],
        robot.pull_secrets,
        terminationGracePeriodSeconds=app.termination_grace_period,
        nodeSelector=node_selector(app.placement, robot.name, app.name in robot.old_labels),
        **pod,
    )
    strategy = OVERLAP_STRATEGY if app.handoff == "overlap" else RECREATE_STRATEGY
    namespace, owner = context.namespace_of(app, robot), owner_of(app, robot)
    return workload(app.name, namespace, owner, spec, notes, strategy)


def _container(app: App, robot: Robot) -> Object:
    container: Object = {
        "name": names.APP_CONTAINER,
        "image": app.image,
        "imagePullPolicy": "IfNotPresent",
        "env": _environment(app, robot),
    }
    if app.command:
        container["command"] = list(app.command)
    if app.args or app.launch:
        container["args"] = hooks.launch_args(app.launch, app.handoff) if app.launch else list(app.args)
    if app.ports:
        container["ports"] = container_ports(app)
    if app.resources:
        container["resources"] = dict(app.resources)
    code = [hooks.CODE_MOUNT] if app.hooks == "app" or app.launch else []
    mounts = [*(target for _source, target in _volumes(app)), *code]
    if mounts:
        container["volumeMounts"] = mounts
    if app.devices:
        # Kubernetes gives a device node to a container only through a device plugin or to a privileged one.
        container["securityContext"] = {"privileged": True}
    container.update(hooks.probes(app))
    if app.hooks == "app" and app.command:  # without one only the image knows what it starts
        container["command"] = [*hooks.code_command("exec"), *hooks.begin_after(app, robot), *app.command]
    return container


def _environment(app: App, robot: Robot) -> list[Object]:
    """The collection's variables first; what the app sets itself wins over them, except for the node's name."""
    found = _ros_environment(app, robot) if app.hooks == "sidecar" else _for_hooks(app, robot)
    if app.hooks == "sidecar" and app.launch:
        found.append(REVISION)
    for key in _in_order(app.env):
        said = app.env[key]
        secret = None if isinstance(said, str) else {"secretKeyRef": {"name": said["secret"], "key": said["key"]}}
        found.append({"name": key, "valueFrom": secret} if secret else variable(key, str(said)))
    return list({item["name"]: item for item in found}.values())


def _ros_environment(app: App, robot: Robot) -> list[Object]:
    """Where the master is, and where the app is itself."""
    if robot.master.mode == "none":
        return []
    found = [
        variable("ROS_MASTER_URI", context.master_uri(robot)),
        field_variable("ROS_IP", "status.hostIP" if app.host_network else "status.podIP"),
    ]
    namespace = context.graph_namespace(app, robot)
    if namespace != "/":
        found.append(variable("ROS_NAMESPACE", namespace))
    if app.handoff == "overlap":
        found.append(field_variable(names.TEMPLATE_ENV, f"metadata.labels['{words.TEMPLATE_HASH}']"))
    return found


def _for_hooks(app: App, robot: Robot) -> list[Object]:
    """The same, with what the hooks have to know, where there are any."""
    found = _ros_environment(app, robot)
    if app.hooks in hooks.IN_POD:
        settings = json.dumps(app_settings(app, robot), sort_keys=True)
        found += [variable(names.SETTINGS_ENV, hooks.literal(settings)), REVISION]
    return found


def _in_order(env: Mapping[str, object]) -> list[str]:
    """By name, each after those that it refers to as $(NAME).

    The order in the inventory tells nothing: what AWX has imported comes sorted, and no pod is made anew for that.
    """
    found: list[str] = []

    def add(name: str, above: frozenset[str]) -> None:
        if name in env and name not in found and name not in above:
            for other in _REFERENCE.findall(str(env[name])):
                add(other, above | {name})
            found.append(name)

    for name in sorted(env):
        add(name, frozenset())
    return found


def _volumes(app: App) -> list[tuple[Object, Object]]:
    """Pairs of a pod's volume and the container's mount of it: claims, files, devices, host paths."""
    pairs: list[tuple[Object, Object]] = []
    for volume in app.volumes:
        source = {"persistentVolumeClaim": {"claimName": names.claim_name(volume.name)}}
        pairs.append(({"name": volume.name, **source}, mount(volume.name, volume.mount_path, volume.read_only)))
    pairs += file_volumes(app)
    for number, device in enumerate(app.devices):
        name, path = f"device-{number}", device.rstrip("/")
        kind = "Directory" if device.endswith("/") else "CharDevice"
        pairs.append(({"name": name, "hostPath": {"path": path, "type": kind}}, mount(name, path)))
    for number, item in enumerate(app.host_paths):
        name = f"host-path-{number}"
        pairs.append(({"name": name, "hostPath": {"path": item.path}}, mount(name, item.mount_path, item.read_only)))
    return pairs


def _naming_args(app: App, robot: Robot, in_pod: str) -> list[str]:
    """ROS remapping arguments: the node's name and, under overlap, its private names kept where others expect them.

    None for an app that names its nodes itself: without any, its image runs what it runs by itself.
    """
    overlaps = app.handoff == "overlap"
    if app.launch or robot.master.mode == "none" or not (overlaps or app.readiness.nodes):
        return []
    stable = context.graph_node(app, robot)
    private = [f"~{name}:={stable}/{name}" for name in app.private_names] if overlaps else []
    return [*private, f"__name:={in_pod}"]
