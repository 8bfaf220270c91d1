# SPDX-License-Identifier: GPL-3.0-or-later
"""What a step leaves in a cluster when its run has gone, as the API shows it."""

from __future__ import annotations

import json
from typing import Any

from ansible_collections.rosops.fleet.plugins.module_utils._robot.way_back import Member, member_of
from ansible_collections.rosops.fleet.plugins.module_utils._step.record import record_of

NAMESPACE = "robot-r1"
UPDATING, WENT_BACK = "rosops.fleet/updating", "rosops.fleet/went-back"


def version(app: str, number: int, namespace: str = NAMESPACE, node: str | None = None) -> dict[str, Any]:
    """A Deployment as it is applied."""
    notes = {} if node == "" else {"rosops.fleet/ros-node": node or f"/{app}_{number}"}
    template = {
        "metadata": {"labels": {"rosops.fleet/revision": f"rev{number}"}, "annotations": notes},
        "spec": {"containers": [{"name": "ros-app", "image": f"x/{app}:{number}"}]},
    }
    return {
        "apiVersion": "apps/v1",
        "kind": "Deployment",
        "metadata": {
            "name": app,
            "namespace": namespace,
            "labels": {"rosops.fleet/app": app, "app.kubernetes.io/managed-by": "rosops.fleet"},
            "annotations": {"rosops.fleet/spec-hash": f"hash of {app} {number}"},
        },
        "spec": {"replicas": 1, "template": template},
    }


def live(
    deployment: dict[str, Any], *, marked: bool = True, ready: bool = False, generation: int = 2
) -> dict[str, Any]:
    """The same as the API shows it."""
    metadata = deployment["metadata"]
    notes = {**metadata["annotations"], **({UPDATING: "1000"} if marked else {})}
    counts = {"replicas": 1, "updatedReplicas": 1, "readyReplicas": int(ready)}
    return {
        **deployment,
        "metadata": {**metadata, "annotations": notes, "generation": generation},
        "status": {"observedGeneration": generation, **counts},
    }


def left(*before: dict[str, Any], **contract: Any) -> dict[str, Any]:
    """The ConfigMap of an app: earlier versions, the last one first, and the contract."""
    history = [
        {"revision": one["spec"]["template"]["metadata"]["labels"]["rosops.fleet/revision"], "deployment": one}
        for one in before
    ]
    said = {"revision": "rev2", **contract}
    return {"data": {"history.json": json.dumps(history), "contract.json": json.dumps(said)}}


def member(deployment: dict[str, Any], beside: Any, pods: Any = (), **others: Any) -> Member:
    """The keeper's view of a Deployment and the ConfigMap beside it; `others` are those of the step's other apps."""
    maps = {deployment["metadata"]["name"]: beside, **others}
    return member_of(deployment, {app: record_of(item) for app, item in maps.items()}, pods)


def pod(
    app: str, number: int, address: str = "10.42.0.9", *, crashes: bool = False, ended: dict[str, Any] | None = None
) -> dict[str, Any]:
    """A pod of a version; `crashes`: it is waited before its container is started once more; `ended`: how it did."""
    state = {"waiting": {"reason": "CrashLoopBackOff"}} if crashes else {"running": {}}
    last = {"terminated": ended} if ended else {}
    return {
        "metadata": {"labels": {"rosops.fleet/app": app, "rosops.fleet/revision": f"rev{number}"}},
        "spec": {},
        "status": {"podIP": address, "containerStatuses": [{"name": "ros-app", "state": state, "lastState": last}]},
    }


def lease(holder: str, number: int = 1, seconds: int = 15) -> dict[str, Any]:
    spec = {"holderIdentity": holder, "leaseDurationSeconds": seconds, "leaseTransitions": 3, "acquireTime": "before"}
    return {"metadata": {"name": "robot-update", "resourceVersion": str(number)}, "spec": spec}
