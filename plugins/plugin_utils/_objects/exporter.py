# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""The ROS exporter's ConfigMap and Deployment: one beside each ROS master, of the master's own image. Pure."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from ...module_utils._exporter.server import HEALTHY, PATH, PORT, READY
from ...module_utils._step.objects import Object
from .._model import context, names
from .._model.app import Volume
from .._model.context import Robot
from .._model.formats import quantity_value
from .common import (
    ONE_HEAP,
    canonical_hash,
    config_map,
    field_variable,
    hashed,
    mount,
    node_selector,
    object_labels,
    pod_spec,
    variable,
    workload,
)

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


@dataclass(frozen=True)
class ExporterOptions:
    """What an operator may choose."""

    interval: float = 10.0
    timeout: float = 2.0
    statistics: bool = False
    claims_path: str = ""  # the storage class' directory on the robot; without one, claims are not looked at


def exporter_objects(robot: Robot, code: Mapping[str, str], options: ExporterOptions) -> list[Object]:
    """ConfigMap and Deployment. `code` is file name -> content.

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
    pod = _pod_spec(robot, options, namespace, () if owner is None else robot.volumes)
    # two would show every series twice: one goes before the next comes
    return [config, hashed(workload(NAME, namespace, owner, pod, annotations=annotations))]


def _pod_spec(robot: Robot, options: ExporterOptions, namespace: str, claims: Sequence[Volume]) -> Object:
    looks = bool(options.claims_path and claims)
    volumes: list[Object] = [
        {"name": "code", "configMap": {"name": NAME}},
        # made by the first update
        {"name": "updates", "configMap": {"name": UPDATES_MAP, "optional": True}},
    ]
    if looks:
        # as the storage class itself would make it, should there be no claim on this host yet
        source = {"path": options.claims_path, "type": "DirectoryOrCreate"}
        volumes.append({"name": "claims", "hostPath": source})
    return pod_spec(
        [_container(robot, options, namespace, _capacities(claims) if looks else None)],
        volumes,
        robot.pull_secrets,
        terminationGracePeriodSeconds=5,
        nodeSelector=node_selector(robot.master.placement, robot.name),
    )


def _capacities(claims: Sequence[Volume]) -> dict[str, int]:
    """Bytes that each claim asks for."""
    sizes = {names.claim_name(claim.name): quantity_value(str(claim.size)) for claim in claims}
    return {name: int(size) for name, size in sorted(sizes.items()) if size is not None}


def _container(robot: Robot, options: ExporterOptions, namespace: str, capacities: dict[str, int] | None) -> Object:
    words = ["--interval", f"{options.interval:g}", "--timeout", f"{options.timeout:g}"]
    mounts = [mount("code", CODE_DIR, read_only=True), mount("updates", UPDATES_DIR, read_only=True)]
    if options.statistics:
        words += ["--statistics", "on"]
    if capacities is not None:
        words += ["--claims", CLAIMS_DIR, "--namespace", namespace, "--capacities", json.dumps(capacities)]
        mounts.append(mount("claims", CLAIMS_DIR, read_only=True))
    return {
        "name": NAME,
        "image": robot.master.image,
        "imagePullPolicy": "IfNotPresent",
        # isolated: neither the image's Python variables nor its site packages matter to it
        "command": ["python3", "-I", "-S", f"{CODE_DIR}/run.py", "exporter"],
        "args": words,
        "env": [
            variable("ROS_MASTER_URI", context.master_uri(robot)),
            field_variable("ROS_IP", "status.podIP"),
            ONE_HEAP,
        ],
        "ports": [{"name": "metrics", "containerPort": PORT, "protocol": "TCP"}],
        "resources": RESOURCES,
        "securityContext": {
            "allowPrivilegeEscalation": False,
            "seccompProfile": {"type": "RuntimeDefault"},
            "readOnlyRootFilesystem": True,
            "capabilities": {"drop": ["ALL"], **({} if capacities is None else {"add": [SEE_ALL]})},
        },
        "volumeMounts": mounts,
        "startupProbe": {**_probe(READY), "periodSeconds": 1, "failureThreshold": 60},
        "readinessProbe": {**_probe(READY), "periodSeconds": 10, "failureThreshold": 3},
        "livenessProbe": {**_probe(HEALTHY), "periodSeconds": 60, "failureThreshold": 3},
    }


def _probe(path: str) -> Object:
    return {"httpGet": {"path": path, "port": PORT}, "timeoutSeconds": 5}
