# SPDX-License-Identifier: GPL-3.0-or-later
"""Kubernetes objects as the API shows them, in the few fields that matter to the tests."""

from __future__ import annotations

from typing import Any

from ansible_collections.rosops.fleet.plugins.module_utils._step.objects import Object
from ansible_collections.rosops.fleet.plugins.plugin_utils._kube.cache import Ref, View

NS = "robot-robot1"
NOON = "2026-01-01T12:00:00Z"
LATER = "2026-01-01T12:10:00Z"


def ref(kind: str, name: str = "talker", api_version: str = "") -> Ref:
    return Ref(kind, name, "" if kind == "Node" else NS, api_version)


def obj(kind: str, name: str, spec: Object | None = None, status: Object | None = None, **metadata: Any) -> Object:
    meta = {"name": name, "namespace": NS, "uid": f"uid-{name}", **metadata}
    if kind in ("Node", "StorageClass"):
        del meta["namespace"]
    return {"kind": kind, "metadata": meta, "spec": spec or {}, "status": status or {}}


def owner(kind: str, name: str, uid: str = "") -> list[Object]:
    return [{"kind": kind, "name": name, "uid": uid or f"uid-{name}", "controller": True}]


def conditions(**states: str) -> list[Object]:
    return [{"type": kind, "status": state} for kind, state in states.items()]


def container(name: str = "ros-app", ready: bool = False, **state: Object) -> Object:
    return {"name": name, "ready": ready, "image": "lab/apps:1.0", "restartCount": 0, "state": state}


def waiting(reason: str, message: str = "", **more: Any) -> Object:
    return {**container(waiting={"reason": reason, "message": message}), **more}


def pod(name: str, owners: list[Object], containers: list[Object] | None = None, **more: Any) -> Object:
    """A running pod, Ready unless containers are given."""
    ready = containers is None
    status = {
        "phase": "Running",
        "conditions": conditions(PodScheduled="True", Ready="True" if ready else "False"),
        "containerStatuses": containers if containers is not None else [container(ready=True, running={})],
    }
    metadata = {"ownerReferences": owners, "creationTimestamp": NOON, **more.pop("metadata", {})}
    made = obj("Pod", name, {"nodeName": "robot1"}, {**status, **more.pop("status", {})}, **metadata)
    made["spec"].update(more.pop("spec", {}))
    return made


def gone_soon(made: Object, grace: int = 0) -> Object:
    going = {"deletionTimestamp": LATER, "deletionGracePeriodSeconds": grace}
    return {**made, "metadata": {**made["metadata"], **going}}


def unscheduled(name: str, owners: list[Object], message: str) -> Object:
    status = {
        "phase": "Pending",
        "conditions": [{"type": "PodScheduled", "status": "False", "reason": "Unschedulable", "message": message}],
    }
    made = pod(name, owners, [], status=status)
    del made["spec"]["nodeName"]
    return made


# --- Deployment -----------------------------------------------------------------------------------------------------


def deployment(replicas: int = 1, status: Object | None = None, revision: str = "2", **spec: Any) -> Object:
    """Generation 2, seen; rolled out unless the status says otherwise."""
    counts = dict.fromkeys(("replicas", "updatedReplicas", "readyReplicas", "availableReplicas"), replicas)
    shown = {"observedGeneration": 2, **counts, **(status or {})}
    notes = {"deployment.kubernetes.io/revision": revision}
    return obj("Deployment", "talker", {"replicas": replicas, **spec}, shown, generation=2, annotations=notes)


def replica_set(name: str, revision: str) -> Object:
    notes = {"deployment.kubernetes.io/revision": revision}
    return obj("ReplicaSet", name, ownerReferences=owner("Deployment", "talker"), annotations=notes)


NEW, OLD = owner("ReplicaSet", "talker-new"), owner("ReplicaSet", "talker-old")


def rolled(*pods: Object, **changes: Any) -> View:
    """A Deployment with an old and a new replica set and these pods."""
    return View([deployment(**changes), replica_set("talker-old", "1"), replica_set("talker-new", "2"), *pods])


# --- DaemonSet ------------------------------------------------------------------------------------------------------


def set_pod(name: str, revision: str, containers: list[Object] | None = None) -> Object:
    owners = owner("DaemonSet", "talker")
    return pod(name, owners, containers, metadata={"labels": {"controller-revision-hash": revision}})


def daemon_set(desired: int = 2, status: Object | None = None, **spec: Any) -> Object:
    kinds = ("desiredNumberScheduled", "updatedNumberScheduled", "numberReady", "numberAvailable")
    shown = {"observedGeneration": 2, **dict.fromkeys(kinds, desired), **(status or {})}
    return obj("DaemonSet", "talker", spec, shown, generation=2)


def controller_revision(revision: str, number: int) -> Object:
    owners, labels = owner("DaemonSet", "talker"), {"controller-revision-hash": revision}
    made = obj("ControllerRevision", f"talker-{revision}", ownerReferences=owners, labels=labels)
    return {**made, "revision": number}


REVISIONS = [controller_revision("old", 1), controller_revision("new", 2)]
