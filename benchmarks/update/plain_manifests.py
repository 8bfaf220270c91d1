# SPDX-License-Identifier: GPL-3.0-or-later
"""The plain arm's manifests: what a careful user of Kubernetes writes by hand for ROS. Pure.

RollingUpdate with maxSurge 1 and maxUnavailable 0, and the dissertation's file /tmp/ready as the readiness probe, asked
every second to give it its best. The master has the same image and flags as the fleet arm's.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from .scenario import ENTRY, PROBE, PROGRAMS, REQUESTED, App

NAMESPACE = "plain"
MASTER = "ros-master"
MASTER_URI = f"http://{MASTER}:11311"
NAMES = ("same", "unique")
Object = dict[str, Any]


def node_name(app: App, names: str) -> str:
    """The ROS node's name: always the same one, as people have it, or one of its own per version."""
    if names == "same":
        return app.node
    version = "_".join([app.tag.replace(".", "_"), *(app.env[key] for key in ("OPERATION",) if key in app.env)])
    return f"{app.node}_{version}"


def selector(placement: str, robot: str) -> Mapping[str, str]:
    """Where a pod goes."""
    return {"kubernetes.io/hostname": robot} if placement == "local" else {"deploymentType": "remote"}


def base(robot: str, like: Mapping[str, Any]) -> list[Object]:
    """Namespace, claims and ROS master; `like` are image, args and probes of a master's container."""
    claims = [_claim(name) for name in ("robot-logs", "edge-logs")]
    container = {
        "name": "master",
        **like,
        "env": [_address()],
        "ports": [{"containerPort": 11311}],
        "resources": {"requests": REQUESTED},
    }
    master = _deployment(MASTER, {"type": "Recreate"}, selector("local", robot), container, [])
    service = {
        "apiVersion": "v1",
        "kind": "Service",
        "metadata": {"name": MASTER, "namespace": NAMESPACE},
        "spec": {"selector": {"app": MASTER}, "ports": [{"port": 11311}]},
    }
    return [{"apiVersion": "v1", "kind": "Namespace", "metadata": {"name": NAMESPACE}}, *claims, service, master]


def app_deployment(app: App, robot: str, names: str) -> Object:
    """One app."""
    container = {
        "name": "app",
        "image": app.image,
        "command": [ENTRY, f"{PROGRAMS}/{app.program}"],
        "args": [*app.remaps, f"__name:={node_name(app, names)}"],
        "env": [
            {"name": "ROS_MASTER_URI", "value": MASTER_URI},
            _address(),
            {"name": "LOG_DIR", "value": app.log_dir},
            *({"name": key, "value": value} for key, value in sorted(app.env.items())),
        ],
        "readinessProbe": {"exec": {"command": [PROBE]}, "periodSeconds": 1, "timeoutSeconds": 5},
        "volumeMounts": [{"name": app.volume, "mountPath": f"/mnt/data/{app.volume}"}],
        "resources": {"requests": REQUESTED},
    }
    volumes = [{"name": app.volume, "persistentVolumeClaim": {"claimName": app.volume}}]
    rolling = {"type": "RollingUpdate", "rollingUpdate": {"maxSurge": 1, "maxUnavailable": 0}}
    return _deployment(app.name, rolling, selector(app.placement, robot), container, volumes)


def as_list(objects: Iterable[Object]) -> Object:
    """One document for `kubectl apply -f -`."""
    return {"apiVersion": "v1", "kind": "List", "items": list(objects)}


def _address() -> Object:
    return {"name": "ROS_IP", "valueFrom": {"fieldRef": {"fieldPath": "status.podIP"}}}


def _claim(name: str) -> Object:
    spec = {"accessModes": ["ReadWriteOnce"], "resources": {"requests": {"storage": "1Gi"}}}
    metadata = {"name": name, "namespace": NAMESPACE}
    return {"apiVersion": "v1", "kind": "PersistentVolumeClaim", "metadata": metadata, "spec": spec}


def _deployment(
    name: str, strategy: Object, where: Mapping[str, str], container: Object, volumes: list[Object]
) -> Object:
    pod: Object = {"nodeSelector": dict(where), "enableServiceLinks": False, "containers": [container]}
    if volumes:
        pod["volumes"] = volumes
    return {
        "apiVersion": "apps/v1",
        "kind": "Deployment",
        "metadata": {"name": name, "namespace": NAMESPACE, "labels": {"app": name}},
        "spec": {
            "replicas": 1,
            "selector": {"matchLabels": {"app": name}},
            "strategy": strategy,
            "template": {"metadata": {"labels": {"app": name}}, "spec": pod},
        },
    }
