# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""The ROS master's Deployment and Service, and those of the keeper beside it."""

from __future__ import annotations

from typing import Any, Mapping

from ansible_collections.rosops.fleet.plugins.plugin_utils._model import names
from ansible_collections.rosops.fleet.plugins.plugin_utils._model.merge import deep_merge
from ansible_collections.rosops.fleet.plugins.plugin_utils._objects.app import (
    PROGRESS_DEADLINE,
    RECREATE_STRATEGY,
    REVISION_HISTORY,
    canonical_hash,
    exec_probe,
    node_selector,
    object_labels,
)
from ansible_collections.rosops.fleet.plugins.plugin_utils._objects.keeper import annotate, keeper_objects

# roscore hands -t (socket time-out of the master's calls to nodes, s) and -w (worker threads) on to rosmaster: three
# hung subscribers then delay a new publisher by 0.4 s instead of 12 s. Both flags: `roscore --help` of ros_comm 1.15.
ROSCORE = ["roscore", "-p", str(names.MASTER_PORT), "-t", "2", "-w", "16"]

ENDPOINT_SECONDS = 2  # kube-proxy gathers changes for a second

# Ready means that the master answers its own API, not that its port is open. Standard library only, so that any ROS
# image will do. getSystemState takes the lock that registrations take: a master that is stuck does not pass.
PROBE = (
    """
import socket, sys, xmlrpc.client
socket.setdefaulttimeout(2)
master = xmlrpc.client.ServerProxy("http://127.0.0.1:%d")
sys.exit(0 if master.getPid("/rosops_probe")[0] == 1 and master.getSystemState("/rosops_probe")[0] == 1 else 1)
""".strip()
    % names.MASTER_PORT
)


def master_objects(ctx: Mapping[str, Any]) -> list[dict[str, Any]]:
    """The robot's master, or the fleet's, and its keeper; nothing for an external one. ctx is complete.

    The overrides are the master's alone.
    """
    if ctx["master"]["mode"] == "external":
        return []
    plain = plain_master(ctx)
    service = {
        "apiVersion": "v1",
        "kind": "Service",
        "metadata": plain["metadata"],
        "spec": {
            "type": "ClusterIP",
            "selector": plain["spec"]["selector"]["matchLabels"],
            "ports": [
                {"name": "xmlrpc", "port": names.MASTER_PORT, "targetPort": names.MASTER_PORT, "protocol": "TCP"}
            ],
        },
    }
    deployment = deep_merge(plain, ctx["master"]["overrides"])
    template = deployment["spec"]["template"]
    annotate(template, canonical_hash(template))
    annotate(deployment, canonical_hash(deployment))
    return [deployment, service, *keeper_objects(ctx)]


def plain_master(ctx: Mapping[str, Any]) -> dict[str, Any]:
    """The Deployment before the overrides; ctx is complete."""
    shared = ctx["master"]["mode"] == "shared"
    labels = object_labels(names.MASTER_NAME, None if shared else ctx["robot"])
    selector = {key: labels[key] for key in ("app.kubernetes.io/name", names.LABEL_APP)}
    return {
        "apiVersion": "apps/v1",
        "kind": "Deployment",
        "metadata": {
            "name": names.MASTER_NAME,
            "namespace": names.FLEET_NAMESPACE if shared else ctx["namespace"],
            "labels": labels,
        },
        "spec": {
            "replicas": 1,
            "revisionHistoryLimit": REVISION_HISTORY,
            "progressDeadlineSeconds": PROGRESS_DEADLINE,
            "selector": {"matchLabels": selector},
            "strategy": RECREATE_STRATEGY,  # two masters at once would split the graph
            "template": {"metadata": {"labels": labels}, "spec": _pod_spec(ctx)},
        },
    }


def _pod_spec(ctx: Mapping[str, Any]) -> dict[str, Any]:
    spec: dict[str, Any] = {
        "terminationGracePeriodSeconds": 30,
        "nodeSelector": node_selector(ctx["master"]["placement"], ctx["robot"]),
        "automountServiceAccountToken": False,
        "enableServiceLinks": False,
        "containers": [
            {
                "name": names.MASTER_CONTAINER,
                "image": ctx["master"]["image"],
                "imagePullPolicy": "IfNotPresent",
                "args": ROSCORE,
                # no ROS_MASTER_URI: roscore's own rosout would wait for a Service that waits for this pod to be ready
                "env": [{"name": "ROS_IP", "valueFrom": {"fieldRef": {"fieldPath": "status.podIP"}}}],
                "ports": [{"name": "xmlrpc", "containerPort": names.MASTER_PORT, "protocol": "TCP"}],
                # Stay until kube-proxy on every host has taken the pod out of the Service. A connection opened to an
                # address that has just gone hangs for two minutes: its retries go to the same dead pod.
                "lifecycle": {"preStop": {"sleep": {"seconds": ENDPOINT_SECONDS}}},
                # No liveness probe: a restart loses every registration, which is worse than a slow answer.
                "readinessProbe": exec_probe(["python3", "-c", PROBE]),
            }
        ],
    }
    if ctx["pull_secrets"]:
        spec["imagePullSecrets"] = [{"name": secret["name"]} for secret in ctx["pull_secrets"]]
    return spec
