# SPDX-License-Identifier: GPL-3.0-or-later
"""What Deployments, pods and Leases say of themselves, as the API shows them. Pure."""

from __future__ import annotations

from typing import Any, Dict, Iterable, Iterator, Mapping, Sequence

from .._ros.graph import host_of
from .words import APP, HANDOFF, HASH, LEASE_SECONDS, NODE, OWNER, READINESS, REVISION

STOPPED = (0, 137, 143)  # exit codes of who was done, or was told to end by somebody else
IDENTITIES = ("name", "mountPath", "containerPort", "key")  # by which the API server knows the entries of a list
LOST = "Unknown"  # the kubelet's reason for a container that is not there any more: its host was rebooted

Object = Dict[str, Any]  # of Kubernetes, or a part of one


def name_of(item: Object) -> str:
    return str((item.get("metadata") or {}).get("name", ""))


def is_terminating(item: Object) -> bool:
    return bool((item.get("metadata") or {}).get("deletionTimestamp"))


def annotations_of(item: Object | None) -> Mapping[str, str]:
    return ((item or {}).get("metadata") or {}).get("annotations") or {}


def labels_of(item: Object | None) -> Mapping[str, str]:
    return ((item or {}).get("metadata") or {}).get("labels") or {}


def app_of(item: Object) -> str:
    return str(labels_of(item).get(APP, ""))


# ---- Deployments


def hash_of(deployment: Object | None) -> str:
    """Of what was applied: the same where the same was applied."""
    return annotations_of(deployment).get(HASH, "")


def revision_of(deployment: Object) -> str:
    """The first digits of the pod template's hash."""
    return revision_of_pod(deployment["spec"]["template"])


def node_of(deployment: Object) -> str:
    """The ROS node of a Deployment's pods; empty where it has none that is known, as the master has."""
    return annotations_of(deployment["spec"]["template"]).get(NODE, "")


def handoff_of(deployment: Object) -> str:
    return annotations_of(deployment["spec"]["template"]).get(HANDOFF, "replace")


def suffix_of(deployment: Object) -> str:
    """What is behind the names of its nodes, where versions overlap."""
    return f"_{revision_of(deployment)}" if handoff_of(deployment) == "overlap" else ""


def rolled_out(deployment: Object) -> bool:
    """Whether the controller has seen this very Deployment, and all pods are of its template, and Ready."""
    status, wanted = deployment.get("status") or {}, deployment["spec"].get("replicas", 1)
    seen = int(status.get("observedGeneration") or 0) >= int(deployment["metadata"].get("generation") or 0)
    counts = {status.get(key) or 0 for key in ("replicas", "updatedReplicas", "readyReplicas")}
    return seen and counts == {wanted}


# ---- pods


def revision_of_pod(pod: Object) -> str:
    return str(labels_of(pod).get(REVISION) or annotations_of(pod).get(HASH, "")[:8])


def address_of(pod: Object) -> str:
    return str((pod.get("status") or {}).get("podIP") or "")


def has_node(pod: Object, node: str, uri: str) -> bool:
    """Whether a node is in a pod: by its address, or where that is its host's, and so everybody's there, by the name
    that the pod is known by."""
    if (pod.get("spec") or {}).get("hostNetwork"):
        return annotations_of(pod).get(NODE) == node
    return address_of(pod) == host_of(uri) != ""


def is_ready(pod: Object) -> bool:
    """The kubelet's own verdict, which counts readiness gates in; container states alone do not."""
    conditions = (pod.get("status") or {}).get("conditions") or []
    ready = any(one.get("type") == "Ready" and one.get("status") == "True" for one in conditions)
    return ready and not is_terminating(pod)


def has_gate(item: Object) -> bool:
    """Whether a pod, or those of a Deployment, have our readiness gate."""
    spec = item.get("spec") or {}
    pod = (spec.get("template") or {}).get("spec") or spec
    return any(one.get("conditionType") == READINESS for one in pod.get("readinessGates") or ())


def gate_of(pod: Object) -> Object | None:
    """The condition by which our readiness gate lets the pod be Ready, empty as long as nobody has looked at it.

    None: the pod has no such gate.
    """
    said = (pod.get("status") or {}).get("conditions") or ()
    return next((one for one in said if one.get("type") == READINESS), {}) if has_gate(pod) else None


def crashes(pod: Object) -> bool:
    """Whether the kubelet waits before it starts a container of the pod once more, because it ended again and again."""
    return any((state.get("waiting") or {}).get("reason") == "CrashLoopBackOff" for state in _states(pod))


def error_of(pod: Object) -> str:
    """The exit code of a container of the pod that ended by an error of its own; empty: none did."""
    ends = [state["terminated"] for state in _states(pod) if state.get("terminated")]
    codes = [end.get("exitCode", 0) for end in ends if LOST not in str(end.get("reason"))]
    return next((str(code) for code in codes if code not in STOPPED), "")


def was_out_of_memory(pod: Object) -> bool:
    """Whether the kernel ended a container of the pod because it took more memory than it may."""
    return any((state.get("terminated") or {}).get("reason") == "OOMKilled" for state in _states(pod))


def ends_of(pods: Iterable[Object]) -> int:
    """How many lives of their containers have ended, and others begun."""
    return sum(ends_by_container(pods).values())


def ends_by_container(pods: Iterable[Object], with_host: bool = False) -> dict[str, int]:
    """The same of each; `with_host`: of those alone whose last life ended with their host, which nobody saw end."""
    return {
        f"{name_of(pod)}/{one.get('name', '')}": int(one.get("restartCount") or 0)
        for pod in pods
        for one in _containers(pod)
        if not with_host or LOST in str(((one.get("lastState") or {}).get("terminated") or {}).get("reason"))
    }


def _states(pod: Object) -> Iterator[Object]:
    """Of its containers now, and before they were started anew."""
    return (one.get(key) or {} for one in _containers(pod) for key in ("state", "lastState"))


def _containers(pod: Object) -> Sequence[Object]:
    return (pod.get("status") or {}).get("containerStatuses") or ()


# ---- whether an object still says what was applied


def is_in(wanted: Any, there: Any) -> bool:
    """Whether all that is wanted is there; what is there besides are defaults, or somebody else's."""
    if wanted == there:  # most parts are: nothing below them has to be looked at one by one
        return True
    if isinstance(wanted, dict):
        found = there if isinstance(there, dict) else {}
        return all(is_in(value, found.get(key)) for key, value in wanted.items())
    if isinstance(wanted, (list, tuple)):
        return _are_in(list(wanted), list(there or ()))
    return bool((there or None) == (wanted or None))  # what is empty is left out by the API server


def _are_in(wanted: list[Any], there: list[Any]) -> bool:
    known = next((key for key in IDENTITIES if all(isinstance(one, dict) and key in one for one in wanted)), "")
    if not (wanted and known):
        return len(wanted) == len(there) and all(map(is_in, wanted, there))
    found = {one.get(known): one for one in there}
    return all(is_in(one, found.get(one[known])) for one in wanted)


# ---- the Lease of a robot: who changes it now. Runs and the keeper write it alike, as Kubernetes' electors do


def version_of(lease: Object | None) -> str:
    return str(((lease or {}).get("metadata") or {}).get("resourceVersion") or "")


def holder_of(lease: Object | None) -> str:
    return str(((lease or {}).get("spec") or {}).get("holderIdentity") or "")


def owner_of(lease: Object | None) -> str:
    """The name of an owner that is neither a run nor the keeper; empty: none of them has it."""
    holder = holder_of(lease)
    return holder[len(OWNER) :] if holder.startswith(OWNER) else ""


def duration_of(lease: Object | None) -> float:
    """Seconds from its last renewal to its end."""
    return float(((lease or {}).get("spec") or {}).get("leaseDurationSeconds") or LEASE_SECONDS)


def lease_with(holder: str, found: Object, me: str, seconds: int, at: str) -> Object:
    """The Lease to write, with this holder: `me`, or empty for nobody.

    `found` is what was read, or has metadata alone. The API refuses the write if somebody else made one since.
    """
    spec, ours = found.get("spec") or {}, holder_of(found) == me
    return {
        "apiVersion": "coordination.k8s.io/v1",
        "kind": "Lease",
        "metadata": found["metadata"],
        "spec": {
            **spec,
            "holderIdentity": holder,
            "leaseDurationSeconds": seconds,
            "renewTime": at,
            "acquireTime": spec.get("acquireTime", at) if ours else at,
            "leaseTransitions": int(spec.get("leaseTransitions") or 0) + (bool(spec) and not ours),
        },
    }
