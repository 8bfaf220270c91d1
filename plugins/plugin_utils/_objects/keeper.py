# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""The keeper's Deployment and Service: beside each ROS master that is ours, what outlives it. Pure."""

from __future__ import annotations

from typing import Any, Mapping

from ansible_collections.rosops.fleet.plugins.plugin_utils._model import context, names
from ansible_collections.rosops.fleet.plugins.plugin_utils._objects.app import (
    PROGRESS_DEADLINE,
    RECREATE_STRATEGY,
    REVISION_HISTORY,
    canonical_hash,
    node_selector,
    object_labels,
)
from ansible_collections.rosops.fleet.plugins.plugin_utils._objects.pod_hooks import (
    hook_command,
    hook_mount,
    hook_volume,
)

CONTAINER = "ros-keeper"
RECORD_VOLUME = "record"
RECORD_DIR = "/var/lib/rosops-fleet"
RECORD_SIZE = "64Mi"
# Measured with 20 nodes: well under 1 % of a core and 20 MB; the limits leave room for a hundred and for held goals.
RESOURCES = {"requests": {"cpu": "10m", "memory": "32Mi"}, "limits": {"memory": "128Mi"}}


def keeper_objects(ctx: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Deployment and Service of the keeper; nothing for an external master. ctx is complete."""
    master = ctx["master"]
    if master["mode"] == "external":
        return []
    shared = master["mode"] == "shared"
    labels = object_labels(names.KEEPER_NAME, None if shared else ctx["robot"])
    metadata = {
        "name": names.KEEPER_NAME,
        "namespace": names.FLEET_NAMESPACE if shared else ctx["namespace"],
        "labels": labels,
    }
    selector = {key: labels[key] for key in ("app.kubernetes.io/name", names.LABEL_APP)}
    template: dict[str, Any] = {"metadata": {"labels": dict(labels)}, "spec": _pod_spec(ctx)}
    annotate(template, canonical_hash(template))
    deployment: dict[str, Any] = {
        "apiVersion": "apps/v1",
        "kind": "Deployment",
        "metadata": metadata,
        "spec": {
            "replicas": 1,
            "revisionHistoryLimit": REVISION_HISTORY,
            "progressDeadlineSeconds": PROGRESS_DEADLINE,
            "selector": {"matchLabels": selector},
            "strategy": RECREATE_STRATEGY,  # two keepers would each forward the goals that they hold
            "template": template,
        },
    }
    service = {
        "apiVersion": "v1",
        "kind": "Service",
        "metadata": {**metadata, "labels": dict(labels)},
        "spec": {
            "type": "ClusterIP",
            "selector": dict(selector),
            "ports": [
                {"name": "xmlrpc", "port": names.KEEPER_PORT, "targetPort": names.KEEPER_PORT, "protocol": "TCP"}
            ],
        },
    }
    deployment["metadata"] = {**metadata, "labels": dict(labels)}
    annotate(deployment, canonical_hash(deployment))
    return [deployment, service]


def _pod_spec(ctx: Mapping[str, Any]) -> dict[str, Any]:
    spec: dict[str, Any] = {
        "terminationGracePeriodSeconds": 10,
        "nodeSelector": node_selector(ctx["master"]["placement"], ctx["robot"]),
        "automountServiceAccountToken": False,
        "enableServiceLinks": False,
        "containers": [_container(ctx)],
        # outlives the container and the host's reboots, and goes with the pod, as do the addresses that it knows
        "volumes": [hook_volume(), {"name": RECORD_VOLUME, "emptyDir": {"sizeLimit": RECORD_SIZE}}],
    }
    if ctx["pull_secrets"]:
        spec["imagePullSecrets"] = [{"name": secret["name"]} for secret in ctx["pull_secrets"]]
    return spec


def _container(ctx: Mapping[str, Any]) -> dict[str, Any]:
    # asked of its XML-RPC server, which answers while its look at the master goes on: no process, next to no CPU
    probe = {"httpGet": {"path": "/ready", "port": names.KEEPER_PORT}, "timeoutSeconds": 5}
    return {
        "name": CONTAINER,
        "image": ctx["master"]["image"],
        "imagePullPolicy": "IfNotPresent",
        "command": [*hook_command("keeper"), "--record", RECORD_DIR],
        "env": [
            {"name": "ROS_MASTER_URI", "value": context.master_uri(ctx)},
            {"name": "ROS_IP", "valueFrom": {"fieldRef": {"fieldPath": "status.podIP"}}},
        ],
        "ports": [{"name": "xmlrpc", "containerPort": names.KEEPER_PORT, "protocol": "TCP"}],
        "resources": RESOURCES,
        "volumeMounts": [hook_mount(), {"name": RECORD_VOLUME, "mountPath": RECORD_DIR}],
        "startupProbe": {**probe, "periodSeconds": 1, "failureThreshold": 60},
        "readinessProbe": {**probe, "periodSeconds": 10, "failureThreshold": 3},
    }


def annotate(item: dict[str, Any], digest: str) -> None:
    """Write the hash of an object, or of a pod template, into its annotations."""
    metadata = item["metadata"]
    metadata["annotations"] = {**(metadata.get("annotations") or {}), names.ANNOTATION_HASH: digest}
