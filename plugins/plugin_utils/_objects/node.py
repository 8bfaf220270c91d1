# SPDX-License-Identifier: GPL-3.0-or-later
"""Labels and taints of a node. Pure."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sequence
from hashlib import sha256

from ...module_utils._common.documents import json_of
from ...module_utils._step.objects import Object
from .._model import names
from .common import made

# spec.taints is one atomic list that Kubernetes writes to as well (not-ready, unreachable, pressure), so it cannot be
# applied as a whole. An annotation says which of the taints are ours, and a label that no kubelet can set that this is
# our word: a kubelet may annotate its own node, and would so have taints of others taken off.
TAINTS_ANNOTATION = "rosops.fleet/taints"


def node_object(name: str, placement: str, robot: str, labels: Mapping[str, str]) -> Object:
    """What is applied to a node: its placement, its robot (empty: an edge host's node) and further labels."""
    old = {names.LABEL_PLACEMENT: placement, **({names.LABEL_ROBOT: robot} if robot else {})}
    own = {names.NODE_PLACEMENT: placement, **({names.NODE_ROBOT: robot} if robot else {})}
    return made("v1", "Node", name, labels={**old, **labels, **own})


def taints_patch(node: Object, taints: Sequence[Object]) -> Object | None:
    """The merge patch that gives a node, as the API shows it, exactly these taints beside those of others.

    None if it has them. A taint of ours that is no longer wanted goes; one of others stays, unless one is wanted that
    Kubernetes takes for the same (key and effect). The patch holds for this version of the node only.
    """
    wanted = [{key: value for key, value in taint.items() if value not in ("", None)} for taint in taints]
    there = list((node.get("spec") or {}).get("taints") or [])
    same = [*map(_whole, wanted)]
    said = (node["metadata"].get("annotations") or {}).get(TAINTS_ANNOTATION, "")
    proof = (node["metadata"].get("labels") or {}).get(names.NODE_TAINTS, "")
    recorded = json_of(said or "[]") if proof == _proof(said) else None
    ours = [*map(_whole, recorded or ())]
    others = {*map(_whole, there)} - {*ours}
    free = {one for one in others if one[::2] not in [place[::2] for place in same]}  # by key and effect
    kept = [taint for taint in there if _whole(taint) in {*same, *free}]
    has = [*map(_whole, kept)]
    after = [*kept, *(taint for taint in wanted if _whole(taint) not in has)]
    if after == there and recorded == wanted:
        return None
    text = json.dumps(wanted) if wanted else ""
    notes, labels = {TAINTS_ANNOTATION: text or None}, {names.NODE_TAINTS: _proof(text) or None}
    version = node["metadata"]["resourceVersion"]
    return {
        "metadata": {"resourceVersion": version, "annotations": notes, "labels": labels},
        "spec": {"taints": after or None},
    }


def _proof(text: str) -> str:
    """Of an annotation that we wrote, as a label's value has room for it."""
    return sha256(text.encode()).hexdigest()[:32] if text else ""


def evicting(node: Object, taints: Sequence[Object]) -> list[Object]:
    """Of the taints that are wanted those that end pods and are not on the node yet."""
    there = [_whole(taint) for taint in (node.get("spec") or {}).get("taints") or []]
    return [taint for taint in taints if taint["effect"] == "NoExecute" and _whole(taint) not in there]


def evicted(pods: Iterable[Object], taints: Sequence[Object]) -> list[str]:
    """`namespace/name` of the pods that do not tolerate all of these taints for as long as they run."""
    return sorted(
        _name(pod)
        for pod in pods
        if not all(any(_tolerates(one, taint) for one in pod["spec"].get("tolerations") or ()) for taint in taints)
    )


def unplaced(pods: Iterable[Object], before: Mapping[str, str], after: Mapping[str, str]) -> list[str]:
    """`namespace/name` of the pods that select nodes by a label which this one had and has no more."""
    gone = {name: value for name, value in before.items() if after.get(name) != value}
    return sorted(
        _name(pod)
        for pod in pods
        if any(gone.get(name) == value for name, value in (pod["spec"].get("nodeSelector") or {}).items())
    )


def _tolerates(toleration: Object, taint: Object) -> bool:
    """Whether a pod with it stays, as Kubernetes decides it."""
    if toleration.get("effect") not in (None, "", taint["effect"]) or toleration.get("tolerationSeconds") is not None:
        return False
    if toleration.get("operator") == "Exists":
        return toleration.get("key") in (None, "", taint["key"])
    same = (str(taint["key"]), str(taint.get("value") or ""))
    return (str(toleration.get("key") or ""), str(toleration.get("value") or "")) == same


def _name(pod: Object) -> str:
    return f"{pod['metadata']['namespace']}/{pod['metadata']['name']}"


def _whole(taint: Object) -> tuple[str, str, str]:
    return (str(taint["key"]), str(taint.get("value") or ""), str(taint["effect"]))
