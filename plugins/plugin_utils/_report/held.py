# SPDX-License-Identifier: GPL-3.0-or-later
"""What the clusters hold, as rows: from Kubernetes objects. Pure.

A part that is missing (a robot that is off, a cluster that does not answer) leaves its section short.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from datetime import datetime
from itertools import chain
from operator import attrgetter

from ...module_utils._common.poll import PASS
from ...module_utils._step.objects import (
    Object,
    address_of,
    app_of,
    ends_of,
    is_ready,
    is_terminating,
    labels_of,
    name_of,
)
from ...module_utils._step.update_record import ways_back
from .._kube.cache import Ref, View
from .._kube.pods import condition, last_end, meta, verdict_on
from .._kube.running import TODO, Outdated
from .._kube.verdicts import judge
from .._model import names
from .._objects.placement import is_placed
from . import rows
from .kept import last_runs, last_steps
from .rows import HELPERS, SHARED, Status, Trouble, logs_of

# Labels that Kubernetes and k3s put on every node; what is left is what somebody chose.
BUILT_IN_LABELS = ("kubernetes.io", "k8s.io", "k3s.io", "k3s.cattle.io", "node.kubernetes.io")
ROLE_LABEL = "node-role.kubernetes.io/"
LATELY = 600.0  # s, in which the end of a container that was started again is news

Objects = Mapping[str, Sequence[Object]]  # of one cluster, by kind

_place = attrgetter("robot", "name")  # by which rows are sorted


def cluster_rows(clusters: Sequence[Objects], usage: Mapping[str, int], now: float) -> Status:
    """The sections of what the clusters hold. `usage`: bytes used, by `<namespace>/<claim>`; `now` is a time in seconds
    since 1970."""

    def all_of(kind: str) -> list[Object]:
        return [*chain(*(objects.get(kind, ()) for objects in clusters))]

    nodes = sorted(map(_node, all_of("Node")), key=attrgetter("name"))
    deployments, maps = all_of("Deployment"), all_of("ConfigMap")
    pods: dict[tuple[str, str], list[Object]] = {}
    for pod in all_of("Pod"):
        pods.setdefault((_namespace(pod), app_of(pod)), []).append(pod)
    ours = [one for one in deployments if labels_of(one).get("app.kubernetes.io/managed-by") == names.MANAGER]
    workloads = sorted((_workload(one, pods, now) for one in ours), key=_place)
    return Status(
        nodes=tuple(nodes),
        masters=tuple(one for one in workloads if one.is_master),
        helpers=tuple(one for one in workloads if one.name in HELPERS),
        apps=tuple(one for one in workloads if not one.is_master and one.name not in HELPERS),
        went_back=tuple(sorted(chain(*map(_went_back, deployments)), key=_place)),
        claims=tuple(sorted(chain(*(_claims(objects, usage) for objects in clusters)), key=_place)),
        outcomes=tuple(last_runs(maps)),
        steps=tuple(last_steps(maps)),
    )


def nodes_off(nodes: Iterable[Object]) -> list[str]:
    """Names of the nodes that are not ready, or have never said so: their hosts are off, away or broken."""
    return [name_of(node) for node in nodes if condition(node, "Ready").get("status") != "True"]


def ending_rows(workloads: Iterable[rows.Workload]) -> list[Trouble]:
    """What is ready, and is so again and again. Of what is not ready its own row says it."""
    return [
        Trouble(f"{row.name} of {row.robot}", row.ended, logs_of(row.robot, row.name, " --previous"), row.ended_at)
        for row in workloads
        if row.ended and row.ready >= row.wanted
    ]


def outdated_rows(found: Iterable[Outdated]) -> list[Trouble]:
    """Apps whose pods keep an image that its name does not mean any more."""
    return [Trouble(f"{one.app} in {one.namespace}", one.what, TODO) for one in dict.fromkeys(found)]


def _robot(item: Object) -> str:
    """The robot that an object belongs to; the fleet's own namespace belongs to all."""
    return labels_of(item).get(names.LABEL_ROBOT) or SHARED


def _namespace(item: Object) -> str:
    return str(meta(item).get("namespace", ""))


def _node(node: Object) -> rows.Node:
    labels, status, ready = labels_of(node), node.get("status") or {}, condition(node, "Ready")
    addresses = [one.get("address") for one in status.get("addresses") or [] if one.get("type") == "InternalIP"]
    on = ready.get("status") == "True"
    cordoned = bool((node.get("spec") or {}).get("unschedulable"))
    chosen = [item for item in sorted(labels.items()) if item[0] not in (names.LABEL_PLACEMENT, names.LABEL_ROBOT)]
    return rows.Node(
        name=name_of(node),
        ready=on,
        reason=("cordoned" if cordoned else "") if on else str(ready.get("reason") or "unknown"),
        since="" if on else str(ready.get("lastTransitionTime") or ""),
        version=(status.get("nodeInfo") or {}).get("kubeletVersion", ""),
        address=addresses[0] if addresses else "",
        roles=tuple(sorted(key[len(ROLE_LABEL) :] for key in labels if key.startswith(ROLE_LABEL))),
        placement=labels.get(names.LABEL_PLACEMENT, ""),
        robot=labels.get(names.LABEL_ROBOT, ""),
        labels={key: value for key, value in chosen if not key.partition("/")[0].endswith(BUILT_IN_LABELS)},
    )


def _workload(deployment: Object, all_pods: Mapping[tuple[str, str], list[Object]], now: float) -> rows.Workload:
    """`all_pods` by their namespace and app."""
    pods = all_pods.get((_namespace(deployment), app_of(deployment) or name_of(deployment)), [])
    spec, status = deployment.get("spec") or {}, deployment.get("status") or {}
    pod_spec = (spec.get("template") or {}).get("spec") or {}
    live = [pod for pod in pods if not is_terminating(pod)]
    unready = [pod for pod in live if not is_ready(pod)]
    wanted = spec.get("replicas", 1)
    why = verdict_on(unready[0]).reason if unready else ""
    ended_at, ended = _lately(live, now)
    return rows.Workload(
        name=name_of(deployment),
        namespace=_namespace(deployment),
        robot=_robot(deployment),
        placement="local" if is_placed(pod_spec, "local") else "remote",
        ready=int(status.get("readyReplicas") or 0),
        wanted=int(1 if wanted is None else wanted),
        nodes=tuple(sorted({str((pod.get("spec") or {}).get("nodeName") or "?") for pod in live})),
        addresses=tuple(sorted(filter(None, map(address_of, live)))),
        images=tuple(str(one.get("image", "")) for one in pod_spec.get("containers") or []),
        restarts=ends_of(pods),
        ended=ended,
        ended_at=ended_at,
        since=_unready_since(deployment, unready),
        note=why.partition(": ")[2] or why,  # the row itself says whose pod it is
    )


def _unready_since(deployment: Object, unready: Iterable[Object]) -> str:
    """The Deployment's own word outlives its pods, so it comes first. Empty where nobody says."""
    known = [condition(deployment, "Available"), *(condition(pod, "Ready") for pod in unready)]
    times = (str(one.get("lastTransitionTime") or "") for one in known if one.get("status") not in (None, "True"))
    return next(filter(None, times), "")


def _lately(pods: Iterable[Object], now: float) -> tuple[str, str]:
    """When and how a container ended that was started again since. By the clock of its host, which may be ahead."""
    at, how = max((end for pod in pods if (end := last_end(pod))), default=("", ""))
    return (at, how) if at and now - datetime.fromisoformat(at).timestamp() < LATELY else ("", "")


def _went_back(deployment: Object) -> list[rows.WentBack]:
    """What the keeper took back, as nobody else did; it stands there until the next step."""
    return [
        rows.WentBack(_robot(deployment), app, told["from"], told["to"], told["at"], told["reason"])
        for app, told in ways_back([deployment]).items()
    ]


def _claims(objects: Objects, usage: Mapping[str, int]) -> list[rows.Claim]:
    """Of one cluster."""
    view = View()
    for kind in ("PersistentVolumeClaim", "StorageClass", "Deployment"):
        view.replace(kind, "", objects.get(kind, ()))
    workloads = [Ref("Deployment", name_of(one), _namespace(one)) for one in view.all("Deployment")]
    return [_claim(claim, view, workloads, usage) for claim in view.all("PersistentVolumeClaim")]


def _claim(claim: Object, view: View, workloads: Sequence[Ref], usage: Mapping[str, int]) -> rows.Claim:
    spec, status = claim.get("spec") or {}, claim.get("status") or {}
    name, namespace, bound = name_of(claim), _namespace(claim), status.get("phase") == "Bound"
    asked = ((spec.get("resources") or {}).get("requests") or {}).get("storage", "")
    verdict = judge(Ref("PersistentVolumeClaim", name, namespace), view, workloads)
    return rows.Claim(
        name=name,
        namespace=namespace,
        robot=_robot(claim),
        bound=bound,
        unused=not bound and verdict.verdict == PASS,
        since="" if bound else str(meta(claim).get("creationTimestamp") or ""),
        phase=str(status.get("phase") or "Pending"),
        storage_class=spec.get("storageClassName") or "",
        size=(status.get("capacity") or {}).get("storage") or asked,
        used_bytes=usage.get(f"{namespace}/{name}"),
        note="" if bound else verdict.reason,
    )
