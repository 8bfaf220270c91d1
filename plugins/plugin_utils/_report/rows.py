# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""What stands, as plain rows, from raw Kubernetes objects and the graphs that ros_graph_info returns. Pure.

A part that is missing (a robot that is off, a cluster that does not answer) leaves its section short.
"""

from __future__ import annotations

from typing import Any, Dict, Iterable, Mapping, Sequence

from ansible_collections.rosops.fleet.plugins.plugin_utils._kube.pods import (
    condition,
    is_ready,
    is_terminating,
    meta,
    name_of,
    why_not_ready,
)
from ansible_collections.rosops.fleet.plugins.plugin_utils._model import names
from ansible_collections.rosops.fleet.plugins.plugin_utils._report.outcomes import outcome_rows, read_reports, step_rows

Row = Dict[str, Any]

# Labels that Kubernetes and k3s put on every node; what is left is what somebody chose.
BUILT_IN_LABELS = ("kubernetes.io", "k8s.io", "k3s.io", "k3s.cattle.io", "node.kubernetes.io")
ROLE_LABEL = "node-role.kubernetes.io/"
PLUMBING_TOPICS = frozenset({"/rosout", "/rosout_agg", "/clock"})
SHARED = "(shared)"


def _labels(obj: Mapping[str, Any]) -> dict[str, str]:
    return dict(meta(obj).get("labels") or {})


def _robot(obj: Mapping[str, Any]) -> str:
    """The robot that an object belongs to; the fleet's own namespace belongs to all."""
    return str(_labels(obj).get(names.LABEL_ROBOT) or SHARED)


def _chosen_labels(obj: Mapping[str, Any]) -> dict[str, str]:
    own = {names.LABEL_PLACEMENT, names.LABEL_ROBOT}
    return {
        key: value
        for key, value in sorted(_labels(obj).items())
        if key not in own and not any(key.partition("/")[0].endswith(one) for one in BUILT_IN_LABELS)
    }


def nodes_off(nodes: Iterable[Mapping[str, Any]]) -> list[str]:
    """Names of the nodes that are not ready, or have never said so: their hosts are off, away or broken."""
    return [name_of(node) for node in nodes if condition(node, "Ready").get("status") != "True"]


def node_rows(nodes: Iterable[Mapping[str, Any]]) -> list[Row]:
    rows = []
    for node in nodes:
        labels, status = _labels(node), node.get("status") or {}
        ready = condition(node, "Ready")
        addresses = [one.get("address") for one in status.get("addresses") or [] if one.get("type") == "InternalIP"]
        cordoned = bool((node.get("spec") or {}).get("unschedulable"))
        rows.append(
            {
                "name": name_of(node),
                "ready": ready.get("status") == "True",
                "reason": ("cordoned" if cordoned else "")
                if ready.get("status") == "True"
                else str(ready.get("reason") or "unknown"),
                "version": (status.get("nodeInfo") or {}).get("kubeletVersion", ""),
                "address": addresses[0] if addresses else "",
                "roles": sorted(key[len(ROLE_LABEL) :] for key in labels if key.startswith(ROLE_LABEL)),
                "placement": labels.get(names.LABEL_PLACEMENT, ""),
                "robot": labels.get(names.LABEL_ROBOT, ""),
                "labels": _chosen_labels(node),
            }
        )
    return sorted(rows, key=lambda row: str(row["name"]))


def _pods_of(deployment: Mapping[str, Any], pods: Iterable[Mapping[str, Any]]) -> list[Mapping[str, Any]]:
    key = (meta(deployment).get("namespace"), _labels(deployment).get(names.LABEL_APP) or name_of(deployment))
    return [pod for pod in pods if (meta(pod).get("namespace"), _labels(pod).get(names.LABEL_APP)) == key]


def _restarts(pods: Iterable[Mapping[str, Any]]) -> int:
    statuses = [one for pod in pods for one in (pod.get("status") or {}).get("containerStatuses") or []]
    return sum(int(one.get("restartCount") or 0) for one in statuses)


def _workload_row(deployment: Mapping[str, Any], pods: Sequence[Mapping[str, Any]]) -> Row:
    spec, status = deployment.get("spec") or {}, deployment.get("status") or {}
    pod_spec = (spec.get("template") or {}).get("spec") or {}
    live = [pod for pod in pods if not is_terminating(pod)]
    open_pods = [pod for pod in live if not is_ready(pod)]
    wanted = spec.get("replicas", 1)
    why = why_not_ready(open_pods[0]) if open_pods else ""
    return {
        "name": name_of(deployment),
        "namespace": meta(deployment).get("namespace", ""),
        "robot": _robot(deployment),
        "placement": "local" if names.LABEL_ROBOT in (pod_spec.get("nodeSelector") or {}) else "remote",
        "ready": int(status.get("readyReplicas") or 0),
        "wanted": int(1 if wanted is None else wanted),
        "nodes": sorted({str((pod.get("spec") or {}).get("nodeName") or "?") for pod in live}),
        "images": [str(one.get("image", "")) for one in pod_spec.get("containers") or []],
        "restarts": _restarts(pods),
        "note": why.partition(": ")[2] or why,  # the row itself says whose pod it is
    }


def workload_rows(
    deployments: Iterable[Mapping[str, Any]], pods: Iterable[Mapping[str, Any]]
) -> tuple[list[Row], list[Row]]:
    """Masters, and apps. Only what this collection manages."""
    all_pods = list(pods)
    masters: list[Row] = []
    apps: list[Row] = []
    for one in deployments:
        if _labels(one).get("app.kubernetes.io/managed-by") != names.MANAGER:
            continue
        row = _workload_row(one, _pods_of(one, all_pods))
        (masters if row["name"] == names.MASTER_NAME else apps).append(row)
    return _sorted(masters), _sorted(apps)


def _sorted(rows: list[Row]) -> list[Row]:
    return sorted(rows, key=lambda row: (str(row["robot"]), str(row["name"])))


def placement_rows(nodes: Iterable[Row], workloads: Iterable[Row]) -> list[Row]:
    """What runs on each node."""
    placed = list(workloads)
    rows = []
    for node in nodes:
        here = [f"{one['robot']}/{one['name']}" for one in placed if node["name"] in one["nodes"]]
        rows.append({"node": node["name"], "placement": node["placement"], "runs": sorted(here)})
    return rows


def claim_rows(claims: Iterable[Mapping[str, Any]], usage: Mapping[str, int]) -> list[Row]:
    """`usage`: bytes used, by `<namespace>/<claim>`."""
    rows = []
    for claim in claims:
        spec, status = claim.get("spec") or {}, claim.get("status") or {}
        namespace = str(meta(claim).get("namespace", ""))
        asked = ((spec.get("resources") or {}).get("requests") or {}).get("storage", "")
        rows.append(
            {
                "name": name_of(claim),
                "namespace": namespace,
                "robot": _robot(claim),
                "bound": status.get("phase") == "Bound",
                "phase": str(status.get("phase") or "Pending"),
                "storage_class": spec.get("storageClassName") or "",
                "size": (status.get("capacity") or {}).get("storage") or asked,
                "used_bytes": usage.get(f"{namespace}/{name_of(claim)}"),
            }
        )
    return _sorted(rows)


def graph_rows(graphs: Mapping[str, Mapping[str, Any]]) -> tuple[list[Row], list[Row]]:
    """ROS nodes, and topics; of each robot, as ros_graph_info returns its graph."""
    nodes, topics = [], []
    for robot, graph in sorted(graphs.items()):
        for name, node in sorted((graph.get("nodes") or {}).items()):
            nodes.append(
                {
                    "robot": robot,
                    "name": name,
                    "reachable": bool(node.get("reachable")),
                    "error": node.get("error") or "",
                    "publications": len(node.get("publications") or []),
                    "subscriptions": len(node.get("subscriptions") or []),
                    "services": list(node.get("services") or []),
                }
            )
        for name, topic in sorted((graph.get("topics") or {}).items()):
            if name in PLUMBING_TOPICS:
                continue
            topics.append(
                {
                    "robot": robot,
                    "name": name,
                    "type": topic.get("type") or "",
                    "publishers": len(topic.get("publishers") or []),
                    "subscribers": len(topic.get("subscribers") or []),
                    "connections": len(topic.get("connections") or []),
                    "rate": topic.get("rate"),
                    "note": topic.get("rate_error") or "",
                }
            )
    return nodes, topics


def fleet_status(sources: Mapping[str, Any]) -> dict[str, list[Row]]:
    """Rows of everything. Every source may be missing; hosts are rows already."""
    nodes = node_rows(sources.get("nodes") or [])
    masters, apps = workload_rows(sources.get("deployments") or [], sources.get("pods") or [])
    ros_nodes, topics = graph_rows(sources.get("graphs") or {})
    reports, unreadable = read_reports(sources.get("reports") or {})
    return {
        "problems": [*(dict(row) for row in sources.get("problems") or []), *unreadable],
        "hosts": [dict(host) for host in sources.get("hosts") or []],
        "nodes": nodes,
        "placement": placement_rows(nodes, [*masters, *apps]),
        "masters": masters,
        "apps": apps,
        "ros_nodes": ros_nodes,
        "topics": topics,
        "claims": claim_rows(sources.get("claims") or [], sources.get("usage") or {}),
        "outcomes": outcome_rows(reports),
        "steps": step_rows(reports),
    }
