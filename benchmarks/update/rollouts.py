# SPDX-License-Identifier: GPL-3.0-or-later
"""When plain Kubernetes has rolled an app out, and its old pod is gone. Pure."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

Object = Mapping[str, Any]


def unfinished(deployments: Iterable[Object], pods: Iterable[Object], names: Iterable[str]) -> str:
    """What is still open of these Deployments; empty when each has exactly its one new, ready pod."""
    by_name = {item["metadata"]["name"]: item for item in deployments}
    every = list(pods)
    open_ones = [f"{name}: {why}" for name in names if (why := _open(by_name.get(name), every))]
    return ", ".join(open_ones)


def _open(deployment: Object | None, pods: list[Object]) -> str:
    if deployment is None:
        return "no Deployment"
    status, spec = deployment.get("status") or {}, deployment["spec"]
    wanted = spec.get("replicas", 1)
    if status.get("observedGeneration", 0) < deployment["metadata"].get("generation", 0):
        return "not seen yet"
    for key in ("updatedReplicas", "readyReplicas", "availableReplicas"):
        if (status.get(key) or 0) != wanted:
            return f"{key} is {status.get(key) or 0}"
    labels = spec["selector"]["matchLabels"]
    own = [pod for pod in pods if labels.items() <= (pod["metadata"].get("labels") or {}).items()]
    return f"{len(own)} pods" if len(own) != wanted else ""


def restarts(pods: Iterable[Object]) -> dict[str, int]:
    """Pods whose containers were started again, and how often."""
    counted = {
        pod["metadata"]["name"]: sum(
            status.get("restartCount", 0) for status in (pod.get("status") or {}).get("containerStatuses") or []
        )
        for pod in pods
    }
    return {name: number for name, number in counted.items() if number}
