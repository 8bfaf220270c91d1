# SPDX-License-Identifier: GPL-3.0-or-later
"""What a keeper's pod has for the metrics of its graph: the record of updates, claims, who is to find it. Pure."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any, NamedTuple

from ...module_utils._exporter.exporter import PATH
from ...module_utils._step.objects import Object
from ...module_utils._step.update_record import NAME as UPDATES
from .._model import context, names
from .._model.context import Robot
from .._model.formats import quantity_value
from .common import mount

UPDATES_DIR = "/etc/rosops-fleet/updates"
STORAGE = "/var/lib/rancher/k3s/storage"  # where k3s' class local-path has its volumes
CLAIMS_DIR = "/var/lib/rosops-fleet/claims"
# Only with claims, mounted read-only: apps' directories may be closed to others. Not DAC_READ_SEARCH, which sounds like
# less but opens files by handle, those outside of the mount, too.
SEE_ALL = "DAC_OVERRIDE"
CLOSED = ("baseline", "restricted")  # levels that allow no directory of the host


class Share(NamedTuple):
    """The metrics' share of a pod."""

    words: list[str]  # of its command
    volumes: list[Object]
    mounts: list[Object]
    security: Mapping[str, Any]  # its container's securityContext
    annotations: Mapping[str, str]


def metrics_share(robot: Robot) -> Share:
    """Of the robot's keeper. That of a shared master is the same whichever robot it comes from, and sees no claims."""
    # the map is made by the first update
    volumes: list[Object] = [{"name": "updates", "configMap": {"name": UPDATES, "optional": True}}]
    mounts, words = [mount("updates", UPDATES_DIR, read_only=True)], list[str]()
    capacities = _capacities(robot)
    if capacities:
        # as the storage class itself would make it, should there be no claim on this host yet
        volumes.append({"name": "claims", "hostPath": {"path": STORAGE, "type": "DirectoryOrCreate"}})
        mounts.append(mount("claims", CLAIMS_DIR, read_only=True))
        words = ["--claims", CLAIMS_DIR, "--namespace", robot.namespace, "--capacities", json.dumps(capacities)]
    shared = context.master_owner(robot) is None
    found = {"scrape": "true", "port": str(names.KEEPER_PORT), "path": PATH}
    return Share(
        words,
        volumes,
        mounts,
        {"securityContext": {"capabilities": {"add": [SEE_ALL]}}} if capacities else {},
        {f"prometheus.io/{key}": value for key, value in found.items()}
        if shared or robot.observability.ros_metrics
        else {},
    )


def _capacities(robot: Robot) -> dict[str, int]:
    """Bytes that each claim asks for, of those that are looked at."""
    if context.master_owner(robot) is None or robot.pod_security in CLOSED or not robot.observability.sees_graph:
        return {}
    sizes = {names.claim_name(claim.name): quantity_value(str(claim.size)) for claim in robot.volumes}
    return {name: int(size) for name, size in sorted(sizes.items()) if size is not None}
