# SPDX-License-Identifier: GPL-3.0-or-later
"""The ROS exporter's ConfigMap and Deployment: one beside each ROS master, of the master's own image. Pure."""

from __future__ import annotations

import json
from collections.abc import Mapping

from ...module_utils._exporter.server import HEALTHY, PATH, PORT, READY
from ...module_utils._step.objects import Object
from .._model import context, names
from .._model.context import Robot
from .._model.formats import quantity_value
from .common import canonical_hash, config_map, hashed, mount, object_labels
from .master import master_environment, with_the_master

NAME = "ros-exporter"
CODE_DIR = "/opt/rosops-fleet/exporter"
UPDATES_MAP, UPDATES_DIR = "robot-updates", "/etc/rosops-fleet/updates"
STORAGE = "/var/lib/rancher/k3s/storage"  # where k3s' class local-path has its volumes
CLAIMS_DIR = "/var/lib/rosops-fleet/claims"
# Only with claims, mounted read-only: apps' directories may be closed to others. Not DAC_READ_SEARCH, which sounds like
# less but opens files by handle, those outside of the mount, too.
SEE_ALL = "DAC_OVERRIDE"
ANNOTATION_CODE = "rosops.fleet/code-hash"
# Measured with 20 nodes: 0.2 % of a core and 19 MB (benchmarks/bench_exporter.py); the limit leaves room for many more.
RESOURCES = {"requests": {"cpu": "20m", "memory": "32Mi"}, "limits": {"memory": "96Mi"}}
INTERVAL, TIMEOUT = 10, 2  # seconds: between two looks at the graph, and for a node's answers


def exporter_objects(robot: Robot, code: Mapping[str, str], *, claims: bool = False) -> list[Object]:
    """ConfigMap and Deployment. `code` is file name -> content; `claims`: what the robot's volumes hold is looked at.

    Those of a shared master are the same whichever robot they come from. An external master is looked at from each of
    its robots, as it has no namespace of its own.
    """
    namespace, owner = context.master_namespace(robot), context.master_owner(robot)
    config = config_map(NAME, namespace, object_labels(NAME, owner), code)
    annotations = {
        "prometheus.io/scrape": "true",
        "prometheus.io/port": str(PORT),
        "prometheus.io/path": PATH,
        # unlike an app, it is restarted for newer code: nobody waits for it
        ANNOTATION_CODE: canonical_hash(config["data"]),
    }
    volumes: list[Object] = [
        {"name": "code", "configMap": {"name": NAME}},
        # made by the first update
        {"name": "updates", "configMap": {"name": UPDATES_MAP, "optional": True}},
    ]
    capacities = _capacities(robot) if claims and owner is not None else {}
    if capacities:
        # as the storage class itself would make it, should there be no claim on this host yet
        volumes.append({"name": "claims", "hostPath": {"path": STORAGE, "type": "DirectoryOrCreate"}})
    container = _container(robot, capacities)
    return [config, hashed(with_the_master(robot, NAME, container, volumes, grace=5, annotations=annotations))]


def _capacities(robot: Robot) -> dict[str, int]:
    """Bytes that each claim asks for."""
    sizes = {names.claim_name(claim.name): quantity_value(str(claim.size)) for claim in robot.volumes}
    return {name: int(size) for name, size in sorted(sizes.items()) if size is not None}


def _container(robot: Robot, capacities: Mapping[str, int]) -> Object:
    words = ["--interval", str(INTERVAL), "--timeout", str(TIMEOUT)]
    mounts = [mount("code", CODE_DIR, read_only=True), mount("updates", UPDATES_DIR, read_only=True)]
    if capacities:
        words += ["--claims", CLAIMS_DIR, "--namespace", context.master_namespace(robot)]
        words += ["--capacities", json.dumps(capacities)]
        mounts.append(mount("claims", CLAIMS_DIR, read_only=True))
    return {
        "name": NAME,
        "image": robot.master.image,
        "imagePullPolicy": "IfNotPresent",
        # isolated: neither the image's Python variables nor its site packages matter to it
        "command": ["python3", "-I", "-S", f"{CODE_DIR}/run.py", "exporter"],
        "args": words,
        "env": master_environment(robot),
        "ports": [{"name": "metrics", "containerPort": PORT, "protocol": "TCP"}],
        "resources": RESOURCES,
        "securityContext": {
            "allowPrivilegeEscalation": False,
            "seccompProfile": {"type": "RuntimeDefault"},
            "readOnlyRootFilesystem": True,
            "capabilities": {"drop": ["ALL"], **({"add": [SEE_ALL]} if capacities else {})},
        },
        "volumeMounts": mounts,
        "startupProbe": {**_probe(READY), "periodSeconds": 1, "failureThreshold": 60},
        "readinessProbe": {**_probe(READY), "periodSeconds": 10, "failureThreshold": 3},
        "livenessProbe": {**_probe(HEALTHY), "periodSeconds": 60, "failureThreshold": 3},
    }


def _probe(path: str) -> Object:
    return {"httpGet": {"path": path, "port": PORT}, "timeoutSeconds": 5}
