# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""One app of one robot -> its Deployment. Pure: the same ctx gives the same bytes on every run."""

from __future__ import annotations

import hashlib
import json
from typing import Any, Mapping

from ansible_collections.rosops.fleet.plugins.module_utils._common.errors import SpecError
from ansible_collections.rosops.fleet.plugins.plugin_utils._model import context, names
from ansible_collections.rosops.fleet.plugins.plugin_utils._model.merge import deep_merge
from ansible_collections.rosops.fleet.plugins.plugin_utils._objects.pod_hooks import (
    app_probes,
    hook_command,
    hook_mount,
    hook_volume,
)

REVISION_LENGTH = 8
PROGRESS_DEADLINE = 300
REVISION_HISTORY = 3
# Characters that only a shell gives a meaning: a readiness command with one of them is a script, else a path.
SHELL_CHARACTERS = frozenset(" \t\n;&|<>()$`\"'*?[]{}~#!\\")
# An update replaces pods one by one under a ROS name of their own, or makes room first: see design decision 1.
OVERLAP_STRATEGY = {"type": "RollingUpdate", "rollingUpdate": {"maxSurge": 1, "maxUnavailable": 0}}
RECREATE_STRATEGY = {"type": "Recreate"}


def app_deployment(app: Mapping[str, Any], ctx: Mapping[str, Any]) -> dict[str, Any]:
    """The Deployment of a completed app (see _context.complete_app).

    The overrides come last, then the ROS node name: it carries the revision, which is the hash of the template with the
    overrides in it, so that whatever changes the pod also gives it a name of its own.
    """
    deployment = deep_merge(plain_deployment(app, ctx), app["overrides"])
    template = _template(deployment, app)
    template_hash = canonical_hash(template)
    revision = template_hash[:REVISION_LENGTH]
    container = _app_container(template, app)
    container["args"] = [*(container.get("args") or []), *naming_args(app, ctx, revision)]
    container["env"] = [
        *(container.get("env") or []),
        {"name": names.NODE_NAME_ENV, "value": app["node_name"] + name_suffix(app, revision)},
    ]
    metadata = template["metadata"]
    metadata["labels"] = {**(metadata.get("labels") or {}), names.LABEL_REVISION: revision}
    metadata["annotations"] = {
        **(metadata.get("annotations") or {}),
        names.ANNOTATION_HASH: template_hash,
        names.ANNOTATION_NODE: context.graph_node(app, ctx, name_suffix(app, revision)),
    }
    own = deployment["metadata"]
    own["annotations"] = {**(own.get("annotations") or {}), names.ANNOTATION_HASH: canonical_hash(deployment)}
    return deployment


def plain_deployment(app: Mapping[str, Any], ctx: Mapping[str, Any]) -> dict[str, Any]:
    """The Deployment before the overrides and without the ROS node name."""
    labels = object_labels(app["name"], None if app["scope"] == "fleet" else ctx["robot"])
    selector = {key: labels[key] for key in ("app.kubernetes.io/name", names.LABEL_APP)}
    return {
        "apiVersion": "apps/v1",
        "kind": "Deployment",
        "metadata": {"name": app["name"], "namespace": context.namespace_of(app, ctx), "labels": labels},
        "spec": {
            "replicas": 1,
            "revisionHistoryLimit": REVISION_HISTORY,
            "progressDeadlineSeconds": PROGRESS_DEADLINE,
            "selector": {"matchLabels": selector},
            "strategy": OVERLAP_STRATEGY if app["handoff"] == "overlap" else RECREATE_STRATEGY,
            "template": {
                "metadata": {"labels": labels, "annotations": {names.ANNOTATION_HANDOFF: app["handoff"]}},
                "spec": _pod_spec(app, ctx),
            },
        },
    }


def _pod_spec(app: Mapping[str, Any], ctx: Mapping[str, Any]) -> dict[str, Any]:
    spec: dict[str, Any] = {
        "terminationGracePeriodSeconds": app["termination_grace_period"],
        "nodeSelector": node_selector(app["placement"], ctx["robot"]),
        "automountServiceAccountToken": False,
        "enableServiceLinks": False,  # else every Service of the namespace becomes environment variables
        "containers": [_container(app, ctx)],
    }
    if app["host_network"]:
        spec["hostNetwork"] = True
        spec["dnsPolicy"] = "ClusterFirstWithHostNet"  # else the Service name ros-master does not resolve
    volumes = [source for source, _mount in _volumes(app)]
    if volumes:
        spec["volumes"] = volumes
    if ctx["pull_secrets"]:
        spec["imagePullSecrets"] = [{"name": secret["name"]} for secret in ctx["pull_secrets"]]
    return spec


def _container(app: Mapping[str, Any], ctx: Mapping[str, Any]) -> dict[str, Any]:
    container: dict[str, Any] = {
        "name": names.APP_CONTAINER,
        "image": app["image"],
        "imagePullPolicy": "IfNotPresent",
        "env": _environment(app, ctx),
    }
    for key in ("command", "args", "resources"):
        if app[key]:
            container[key] = app[key]
    mounts = [mount for _source, mount in _volumes(app)]
    if mounts:
        container["volumeMounts"] = mounts
    if app["devices"]:
        # Kubernetes gives a device node to a container only through a device plugin or to a privileged one.
        container["securityContext"] = {"privileged": True}
    if app["hooks"]:
        container.update(app_probes())
        if app["command"]:  # without one only the image knows what it starts
            container["command"] = [*hook_command("exec"), *app["command"]]
    elif app["readiness"]["command"]:
        container["readinessProbe"] = exec_probe(probe_command(app["readiness"]["command"]))
    return container


def _environment(app: Mapping[str, Any], ctx: Mapping[str, Any]) -> list[dict[str, Any]]:
    """The collection's variables first; what the app sets itself wins over them, except for the node's name."""
    address = "status.hostIP" if app["host_network"] else "status.podIP"
    env: dict[str, dict[str, Any]] = {
        "ROS_MASTER_URI": {"value": context.master_uri(ctx)},
        "ROS_IP": {"valueFrom": {"fieldRef": {"fieldPath": address}}},
    }
    namespace = context.graph_namespace(app, ctx)
    if namespace != "/":
        env["ROS_NAMESPACE"] = {"value": namespace}
    if app["hooks"]:
        env[names.APP_ENV] = {"value": app["name"]}
        label = f"metadata.labels['{names.LABEL_REVISION}']"
        env[names.REVISION_ENV] = {"valueFrom": {"fieldRef": {"fieldPath": label}}}
    env.update({key: {"value": value} for key, value in app["env"].items()})
    return [{"name": key, **value} for key, value in env.items()]


def _volumes(app: Mapping[str, Any]) -> list[tuple[dict[str, Any], dict[str, Any]]]:
    """Pairs of a pod's volume and the container's mount of it: claims, devices, host paths, the hooks' code."""
    pairs: list[tuple[dict[str, Any], dict[str, Any]]] = []
    for volume in app["volumes"]:
        source = {"persistentVolumeClaim": {"claimName": names.claim_name(volume["name"])}}
        pairs.append(_volume(volume["name"], source, volume["mount_path"], volume["read_only"]))
    for number, device in enumerate(app["devices"]):
        kind = "Directory" if device.endswith("/") else "CharDevice"
        path = device.rstrip("/")
        pairs.append(_volume(f"device-{number}", {"hostPath": {"path": path, "type": kind}}, path, False))
    for number, item in enumerate(app["host_paths"]):
        source = {"hostPath": {"path": item["path"]}}
        pairs.append(_volume(f"host-path-{number}", source, item["mount_path"], item["read_only"]))
    if app["hooks"]:
        pairs.append((hook_volume(app), hook_mount()))
    return pairs


def _volume(name: str, source: Mapping[str, Any], path: str, read_only: bool) -> tuple[dict[str, Any], dict[str, Any]]:
    mount: dict[str, Any] = {"name": name, "mountPath": path}
    if read_only:
        mount["readOnly"] = True
    return {"name": name, **source}, mount


def node_selector(placement: str, robot: str) -> dict[str, str]:
    """`local` is the robot itself, `remote` any edge host (the seed's label)."""
    return {names.LABEL_ROBOT: robot} if placement == "local" else {names.LABEL_PLACEMENT: "remote"}


def object_labels(name: str, robot: str | None) -> dict[str, str]:
    """Labels of every object of ours; those of the whole fleet belong to no robot."""
    labels = {
        "app.kubernetes.io/name": name,
        "app.kubernetes.io/managed-by": names.MANAGER,
        names.LABEL_APP: name,
    }
    if robot is not None:
        labels[names.LABEL_ROBOT] = robot
    return labels


def probe_command(command: Any) -> list[str]:
    """readiness.command as an exec command: a list as it is, a path as the seed has it, a script through a shell.

    >>> probe_command("/usr/local/bin/readiness_probe.sh")
    ['/usr/local/bin/readiness_probe.sh']
    >>> probe_command("test -f /tmp/ready")
    ['/bin/sh', '-c', 'test -f /tmp/ready']
    """
    if isinstance(command, str):
        return ["/bin/sh", "-c", command] if SHELL_CHARACTERS & set(command) else [command]
    return [str(word) for word in command]


def exec_probe(command: list[str]) -> dict[str, Any]:
    """A readiness probe; Kubernetes' default time-out of 1 s is too short for a python3 start on a loaded robot."""
    return {"exec": {"command": command}, "periodSeconds": 2, "timeoutSeconds": 5, "failureThreshold": 3}


def naming_args(app: Mapping[str, Any], ctx: Mapping[str, Any], revision: str) -> list[str]:
    """ROS remapping arguments: the node's name and, under overlap, its private names kept where others expect them."""
    args = []
    if app["handoff"] == "overlap":
        stable = context.graph_node(app, ctx)
        args = [f"~{private}:={stable}/{private}" for private in app["private_names"]]
    return [*args, f"__name:={app['node_name']}{name_suffix(app, revision)}"]


def name_suffix(app: Mapping[str, Any], revision: str) -> str:
    """Two revisions that overlap need two ROS names, else the master makes them evict each other."""
    return f"_{revision}" if app["handoff"] == "overlap" else ""


def canonical_hash(value: Any) -> str:
    """SHA-256 of the value as JSON with sorted keys and no blanks."""
    text = json.dumps(value, sort_keys=True, separators=(",", ":"), ensure_ascii=True)
    return hashlib.sha256(text.encode()).hexdigest()


def _template(deployment: Mapping[str, Any], app: Mapping[str, Any]) -> dict[str, Any]:
    try:
        template: dict[str, Any] = deployment["spec"]["template"]
        template["spec"]["containers"]
        template["metadata"]
        deployment["metadata"]
    except (KeyError, TypeError):
        raise SpecError(f"the overrides of app {app['name']} remove its pod template") from None
    return template


def _app_container(template: Mapping[str, Any], app: Mapping[str, Any]) -> dict[str, Any]:
    for container in template["spec"]["containers"]:
        if isinstance(container, dict) and container.get("name") == names.APP_CONTAINER:
            return container
    raise SpecError(f"the overrides of app {app['name']} remove its container {names.APP_CONTAINER}")
