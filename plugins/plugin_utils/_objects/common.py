# SPDX-License-Identifier: GPL-3.0-or-later
"""What every object of the collection has in common: labels, hashes, the frame of a Deployment, its rights. Pure."""

from __future__ import annotations

import hashlib
import json
from base64 import b64encode
from collections.abc import Mapping, Sequence
from typing import Any

from ...module_utils._common.documents import Variables
from ...module_utils._step.objects import Object
from .._model import names

Files = Mapping[str, str | bytes]  # name -> content
REVISION_HISTORY = 3
PROGRESS_DEADLINE = 300  # seconds
RECREATE_STRATEGY = {"type": "Recreate"}
FOR_EVER = 1_000_000  # failures of a startup probe: what is not ready yet is no reason to kill its container
SELECTOR = ("app.kubernetes.io/name", names.LABEL_APP)

# The PriorityClass of what a robot's work hangs on. Where memory or disk is short the kubelet ends pods of a lower
# priority first: an app that fills them goes, and not the ROS master of all others.
PRIORITY = "rosops-fleet"

# glibc gives each thread a heap of its own otherwise, which never shrinks
ONE_HEAP = {"name": "MALLOC_ARENA_MAX", "value": "1"}


def owner_labels(robot: str | None) -> dict[str, str]:
    """Labels of what belongs to a robot; without one it is the whole fleet's."""
    labels = {"app.kubernetes.io/managed-by": names.MANAGER}
    return labels if robot is None else {**labels, names.LABEL_ROBOT: robot}


def object_labels(name: str, robot: str | None) -> dict[str, str]:
    """Labels of the objects of a workload, and of its pods."""
    return {"app.kubernetes.io/name": name, names.LABEL_APP: name, **owner_labels(robot)}


def pod_selector(name: str) -> dict[str, str]:
    """The labels by which a workload and its Service find its pods."""
    return dict.fromkeys(SELECTOR, name)


def made(
    api: str, kind: str, name: str, namespace: str = "", labels: Mapping[str, str] | None = None, **body: Any
) -> Object:
    """An object; one without a namespace is the whole cluster's."""
    metadata: Object = {"name": name, **({"namespace": namespace} if namespace else {})}
    if labels is not None:
        metadata["labels"] = dict(labels)
    return {"apiVersion": api, "kind": kind, "metadata": metadata, **body}


def config_map(name: str, namespace: str, labels: Mapping[str, str], files: Files) -> Object:
    """A ConfigMap of files, in order."""
    data = {key: text for key, text in sorted(files.items()) if isinstance(text, str)}
    packed = {key: b64encode(held).decode() for key, held in sorted(files.items()) if isinstance(held, bytes)}
    return made("v1", "ConfigMap", name, namespace, labels, data=data, **({"binaryData": packed} if packed else {}))


def cluster_service(of: Object, port: int, address: str | None) -> Object:
    """The Service in front of a workload's XML-RPC port. One with an address that pods know has it for ever.

    A pod that is not ready stays in it: the kubelet takes for not ready whatever it probes while k3s starts again
    (Kubernetes before 1.35, KEP-4781), and the cluster whatever it lost sight of for 40 s. The robot's nodes work with
    it all the same, and have no other way to it.
    """
    spec = {
        "type": "ClusterIP",
        **({"clusterIP": address} if address else {}),
        "publishNotReadyAddresses": True,
        "selector": pod_selector(of["metadata"]["name"]),
        "ports": [{"name": "xmlrpc", "port": port, "targetPort": port, "protocol": "TCP"}],
    }
    return made("v1", "Service", **of["metadata"], spec=spec)


def workload(  # noqa: PLR0913 - the parts of a Deployment in which ours differ
    name: str,
    namespace: str,
    robot: str | None,
    pod: Object,
    notes: Variables,
    strategy: Object,
    kind: str = "Deployment",
) -> Object:
    """The Deployment (or DaemonSet) of one pod, without hashes; `notes` are the pod's annotations."""
    labels, noted = object_labels(name, robot), {"annotations": {**notes}} if notes else {}
    spec: Object = {"revisionHistoryLimit": REVISION_HISTORY, "selector": {"matchLabels": pod_selector(name)}}
    if kind == "Deployment":
        spec |= {"replicas": 1, "progressDeadlineSeconds": PROGRESS_DEADLINE, "strategy": {**strategy}}
    else:
        spec["updateStrategy"] = {**strategy}
    spec["template"] = {"metadata": {"labels": labels, **noted}, "spec": pod}
    return made("apps/v1", kind, name, namespace, labels, spec=spec)


def annotate(item: Object) -> Object:
    """Write the hash of an object, or of a pod template, into its annotations; what is changed is given back."""
    digest = canonical_hash(item)
    metadata = item["metadata"]
    metadata["annotations"] = {**(metadata.get("annotations") or {}), names.ANNOTATION_HASH: digest}
    return item


def pod_spec(
    containers: Sequence[Object], volumes: Sequence[Object] = (), pull_secrets: Sequence[str] = (), **more: Any
) -> Object:
    """A pod without access to the API, unless `more` says so, and not told the addresses of all Services."""
    token = more.pop("automountServiceAccountToken", False)
    spec: Object = {**more, "automountServiceAccountToken": token, "enableServiceLinks": False}
    spec["containers"] = list(containers)
    if volumes:
        spec["volumes"] = list(volumes)
    if pull_secrets:
        spec["imagePullSecrets"] = [{"name": name} for name in pull_secrets]
    return spec


def mount(name: str, path: str, read_only: bool = False) -> Object:
    return {"name": name, "mountPath": path, **({"readOnly": True} if read_only else {})}


def variable(name: str, value: str) -> Object:
    return {"name": name, "value": value}


def field_variable(name: str, path: str) -> Object:
    """An environment variable that Kubernetes fills from the pod's own fields."""
    return {"name": name, "valueFrom": {"fieldRef": {"fieldPath": path}}}


def canonical_hash(value: Any) -> str:
    """SHA-256 of the value as JSON with sorted keys and no blanks."""
    text = json.dumps(value, sort_keys=True, separators=(",", ":"), ensure_ascii=True)
    return hashlib.sha256(text.encode()).hexdigest()


# ---- what a container may do on its host

ALL = ("ALL",)
# Nobody: no file of an image belongs to it, which all may read. A user of a container has no capabilities.
NOBODY = {"runAsNonRoot": True, "runAsUser": 65532, "runAsGroup": 65532}
# Of an app, whose image is not ours and mostly runs as root: what a ROS node has no use for. Raw sockets let a pod
# speak in another one's name on the pods' network. What entrypoints and drivers do use (files of other users, changing
# the user) stays.
APPS = ("AUDIT_WRITE", "MKNOD", "NET_RAW", "SETFCAP", "SETPCAP", "SYS_CHROOT")
# For a privileged container the API refuses to have escalation forbidden.
_MIGHTY = frozenset({"SYS_ADMIN", "CAP_SYS_ADMIN"})


def harden(container: Object, drop: Sequence[str], pod: Object | None = None) -> None:
    """Fill in what its own securityContext, overrides included, leaves open; a privileged one is left as it is.

    With its `pod` it is NOBODY, unless either says a user, or has something of its host, which mostly is root's.
    """
    given: Object = dict(container.get("securityContext") or {})
    asked = given.get("capabilities") or {}
    added = {*(asked.get("add") or ())}
    # container runtimes add first and drop then, but for ALL, which they drop before: what is asked for by name is kept
    capabilities = {"drop": [one for one in drop if one not in added and "ALL" not in added], **asked}
    if given.get("privileged") or _MIGHTY & added:
        return
    said = {**((pod or {}).get("securityContext") or {}), **given}
    of_host = added or any("hostPath" in one for one in (pod or {}).get("volumes") or ())
    free = pod is not None and not of_host and not any(key in said for key in NOBODY)
    container["securityContext"] = {
        **(NOBODY if free else {}),
        "allowPrivilegeEscalation": False,
        "seccompProfile": {"type": "RuntimeDefault"},
        **given,
        "capabilities": capabilities,
    }
