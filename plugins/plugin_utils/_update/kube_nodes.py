# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""A cluster of which one node is to be changed: what its nodes say, and which robots work there."""

from __future__ import annotations

from collections.abc import Iterable

from ...module_utils._step.objects import Object
from .._kube.client import Kube
from .._kube.pods import condition
from .._model import names
from .._model.context import Robot
from .._objects.namespace import needs_fleet_namespace

SERVER_LABELS = ("node-role.kubernetes.io/control-plane", "node-role.kubernetes.io/master")


def robots_on(kube: Kube, node: str, robots: Iterable[Robot]) -> list[Robot]:
    """Those of which a pod is on the node, and those that need one of the whole fleet's which is; KubeError."""
    pods = kube.objects("Pod", fields=f"spec.nodeName={node}")
    namespaces = {str(pod["metadata"]["namespace"]) for pod in pods}
    return [robot for robot in robots if namespaces & _needed(robot)]


def _needed(robot: Robot) -> set[str]:
    """Where pods of this cluster are that the robot works with. A standalone one's fleet namespace is in its own."""
    shared = needs_fleet_namespace(robot) and robot.mode != "standalone"
    return {robot.namespace, *([names.FLEET_NAMESPACE] if shared else [])}


def server_versions(nodes: Iterable[Object]) -> dict[str, str]:
    """Node of each server -> the version of its kubelet, which is that of its k3s."""
    return {
        str(node["metadata"]["name"]): str(((node.get("status") or {}).get("nodeInfo") or {}).get("kubeletVersion"))
        for node in nodes
        if is_server(node)
    }


def servers_down(nodes: Iterable[Object], but: str) -> list[str]:
    """Servers other than `but` that are not Ready: with one more away the cluster may have no majority."""
    return sorted(
        str(node["metadata"]["name"])
        for node in nodes
        if is_server(node) and node["metadata"]["name"] != but and condition(node, "Ready").get("status") != "True"
    )


def is_server(node: Object) -> bool:
    """Whether the node runs the API."""
    return any(label in (node["metadata"].get("labels") or {}) for label in SERVER_LABELS)
