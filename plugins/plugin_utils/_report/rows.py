# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""How the fleet stands, as plain rows: from Kubernetes objects, the graphs that ros_graph_info returns, and the JSON
files that the callback fleet_report has written. Pure.

A part that is missing (a robot that is off, a cluster that does not answer) leaves its section short. Of reports there
may be none, several (one per playbook or kept by hand), and spoilt ones; each host's newest run counts.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sequence
from datetime import datetime
from itertools import chain
from types import MappingProxyType
from typing import Any

from ansible_collections.rosops.fleet.plugins.module_utils._common.poll import PASS
from ansible_collections.rosops.fleet.plugins.module_utils._ros.graph import Graph
from ansible_collections.rosops.fleet.plugins.module_utils._step.objects import (
    Object,
    is_ready,
    is_terminating,
    name_of,
)
from ansible_collections.rosops.fleet.plugins.module_utils._step.update_record import ways_back
from ansible_collections.rosops.fleet.plugins.plugin_utils._kube.cache import Ref, View
from ansible_collections.rosops.fleet.plugins.plugin_utils._kube.pods import condition, last_end, meta, why_not_ready
from ansible_collections.rosops.fleet.plugins.plugin_utils._kube.running import TODO, Outdated
from ansible_collections.rosops.fleet.plugins.plugin_utils._kube.verdicts import judge
from ansible_collections.rosops.fleet.plugins.plugin_utils._model import names
from ansible_collections.rosops.fleet.plugins.plugin_utils._objects.exporter import NAME as EXPORTER_NAME
from ansible_collections.rosops.fleet.plugins.plugin_utils._report.launched import SHARED, launched_rows, logs_of
from ansible_collections.rosops.fleet.plugins.plugin_utils._report.ros_graph import PLUMBING_TOPICS, Places, links
from ansible_collections.rosops.fleet.plugins.plugin_utils._report.run import note_of

Row = dict[str, Any]

# Labels that Kubernetes and k3s put on every node; what is left is what somebody chose.
BUILT_IN_LABELS = ("kubernetes.io", "k8s.io", "k3s.io", "k3s.cattle.io", "node.kubernetes.io")
ROLE_LABEL = "node-role.kubernetes.io/"
BACK = ("from", "to", "at", "reason")  # of what a keeper took back
_OF_CLUSTERS = ("hosts", "nodes", "placement", "masters", "helpers", "apps", "went_back", "claims")
HELPERS = frozenset({names.KEEPER_NAME, EXPORTER_NAME})  # beside each master; nobody has written them into an inventory
LATELY = 600.0  # s, in which the end of a container that was started again is news
# Runs that only look. Whoever looks twice still wants to know what became of the last change.
LOOKING = frozenset({"status.yml", "validate.yml"})


def _labels(obj: Object) -> dict[str, str]:
    return dict(meta(obj).get("labels") or {})


def _robot(obj: Object) -> str:
    """The robot that an object belongs to; the fleet's own namespace belongs to all."""
    return str(_labels(obj).get(names.LABEL_ROBOT) or SHARED)


def _chosen_labels(obj: Object) -> dict[str, str]:
    own = {names.LABEL_PLACEMENT, names.LABEL_ROBOT}
    return {
        key: value
        for key, value in sorted(_labels(obj).items())
        if key not in own and not any(key.partition("/")[0].endswith(one) for one in BUILT_IN_LABELS)
    }


def nodes_off(nodes: Iterable[Object]) -> list[str]:
    """Names of the nodes that are not ready, or have never said so: their hosts are off, away or broken."""
    return [name_of(node) for node in nodes if condition(node, "Ready").get("status") != "True"]


def node_rows(nodes: Iterable[Object]) -> list[Row]:
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
                "since": "" if ready.get("status") == "True" else str(ready.get("lastTransitionTime") or ""),
                "version": (status.get("nodeInfo") or {}).get("kubeletVersion", ""),
                "address": addresses[0] if addresses else "",
                "roles": sorted(key[len(ROLE_LABEL) :] for key in labels if key.startswith(ROLE_LABEL)),
                "placement": labels.get(names.LABEL_PLACEMENT, ""),
                "robot": labels.get(names.LABEL_ROBOT, ""),
                "labels": _chosen_labels(node),
            }
        )
    return sorted(rows, key=lambda row: str(row["name"]))


def _pods_of(deployment: Object, pods: Iterable[Object]) -> list[Object]:
    key = (meta(deployment).get("namespace"), _labels(deployment).get(names.LABEL_APP) or name_of(deployment))
    return [pod for pod in pods if (meta(pod).get("namespace"), _labels(pod).get(names.LABEL_APP)) == key]


def _restarts(pods: Iterable[Object]) -> int:
    statuses = [one for pod in pods for one in (pod.get("status") or {}).get("containerStatuses") or []]
    return sum(int(one.get("restartCount") or 0) for one in statuses)


def _unready_since(deployment: Object, open_pods: Sequence[Object]) -> str:
    """The Deployment's own word outlives its pods, so it comes first. Empty where nobody says."""
    known = [condition(deployment, "Available"), *(condition(pod, "Ready") for pod in open_pods)]
    times = (str(one.get("lastTransitionTime") or "") for one in known if one.get("status") not in (None, "True"))
    return next((time for time in times if time), "")


def _lately(pods: Iterable[Object], now: float) -> tuple[str, str]:
    """When and how a container ended that was started again since. By the clock of its host, which may be ahead."""
    at, how = max((end for pod in pods if (end := last_end(pod))), default=("", ""))
    return (at, how) if at and now - datetime.fromisoformat(at).timestamp() < LATELY else ("", "")


def _workload_row(deployment: Object, pods: Sequence[Object], now: float) -> Row:
    spec, status = deployment.get("spec") or {}, deployment.get("status") or {}
    pod_spec = (spec.get("template") or {}).get("spec") or {}
    live = [pod for pod in pods if not is_terminating(pod)]
    open_pods = [pod for pod in live if not is_ready(pod)]
    wanted = spec.get("replicas", 1)
    why = why_not_ready(open_pods[0]) if open_pods else ""
    ended_at, ended = _lately(live, now)
    return {
        "name": name_of(deployment),
        "namespace": meta(deployment).get("namespace", ""),
        "robot": _robot(deployment),
        "placement": "local" if names.LABEL_ROBOT in (pod_spec.get("nodeSelector") or {}) else "remote",
        "ready": int(status.get("readyReplicas") or 0),
        "wanted": int(1 if wanted is None else wanted),
        "nodes": sorted({str((pod.get("spec") or {}).get("nodeName") or "?") for pod in live}),
        "addresses": sorted({str(address) for pod in live if (address := (pod.get("status") or {}).get("podIP"))}),
        "images": [str(one.get("image", "")) for one in pod_spec.get("containers") or []],
        "restarts": _restarts(pods),
        "ended": ended,
        "ended_at": ended_at,
        "since": _unready_since(deployment, open_pods),
        "note": why.partition(": ")[2] or why,  # the row itself says whose pod it is
    }


def workload_rows(deployments: Iterable[Object], pods: Iterable[Object], now: float) -> dict[str, list[Row]]:
    """Masters, what helps them, and apps. Only what this collection manages."""
    all_pods = list(pods)
    found: dict[str, list[Row]] = {"masters": [], "helpers": [], "apps": []}
    for one in deployments:
        if _labels(one).get("app.kubernetes.io/managed-by") != names.MANAGER:
            continue
        row = _workload_row(one, _pods_of(one, all_pods), now)
        section = "masters" if row["name"] == names.MASTER_NAME else "helpers" if row["name"] in HELPERS else "apps"
        found[section].append(row)
    return {section: _sorted(rows) for section, rows in found.items()}


def ending_rows(workloads: Iterable[Row]) -> list[Row]:
    """Problems: what is ready, and is so again and again. Of what is not ready its own row says it."""
    return [
        {
            "where": f"{row['name']} of {row['robot']}",
            "what": row["ended"],
            "since": row["ended_at"],
            "todo": logs_of(row["robot"], row["name"], " --previous"),
        }
        for row in workloads
        if row["ended"] and row["ready"] >= row["wanted"]
    ]


def went_back_rows(deployments: Iterable[Object]) -> list[Row]:
    """What the keeper took back, as nobody else did; it stands there until the next step."""
    return _sorted(
        [
            {
                "name": app,
                "namespace": meta(one).get("namespace", ""),
                "robot": _robot(one),
                **{key: told[key] for key in BACK},
            }
            for one in deployments
            for app, told in ways_back([one]).items()
        ]
    )


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


def outdated_rows(found: Iterable[Outdated]) -> list[Row]:
    """Problems: apps whose pods keep an image that its name does not mean any more."""
    return [
        {
            "where": f"{one.app} in {one.namespace}",
            "what": one.what,
            "todo": TODO,
        }
        for one in dict.fromkeys(found)
    ]


def claim_rows(objects: Mapping[str, Sequence[Object]], usage: Mapping[str, int]) -> list[Row]:
    """Of one cluster's objects by kind. `usage`: bytes used, by `<namespace>/<claim>`."""
    view, rows = View(), []
    for kind in ("PersistentVolumeClaim", "StorageClass", "Deployment"):
        view.replace(kind, "", objects.get(kind, ()))
    workloads = [Ref("Deployment", name_of(one), str(meta(one).get("namespace"))) for one in view.all("Deployment")]
    for claim in view.all("PersistentVolumeClaim"):
        spec, status = claim.get("spec") or {}, claim.get("status") or {}
        namespace = str(meta(claim).get("namespace", ""))
        asked = ((spec.get("resources") or {}).get("requests") or {}).get("storage", "")
        bound = status.get("phase") == "Bound"
        verdict = judge(Ref("PersistentVolumeClaim", name_of(claim), namespace), view, workloads)
        rows.append(
            {
                "name": name_of(claim),
                "namespace": namespace,
                "robot": _robot(claim),
                "bound": bound,
                "unused": not bound and verdict.verdict == PASS,
                "since": "" if bound else str(meta(claim).get("creationTimestamp") or ""),
                "phase": str(status.get("phase") or "Pending"),
                "storage_class": spec.get("storageClassName") or "",
                "size": (status.get("capacity") or {}).get("storage") or asked,
                "used_bytes": usage.get(f"{namespace}/{name_of(claim)}"),
                "note": "" if bound else verdict.reason,
            }
        )
    return rows


def graph_rows(
    graphs: Mapping[str, Graph], places: Places, promised: Mapping[str, Mapping[str, Row]]
) -> tuple[list[Row], list[Row]]:
    """ROS nodes, and topics; of each robot's graph, with what `promised_rates` says of it."""
    nodes, topics = [], []
    for robot, graph in sorted(graphs.items()):
        promises = promised.get(robot, {})
        for node in (node for name in graph.names for node in graph.named(name)):
            nodes.append(
                {
                    "robot": robot,
                    "name": node.name,
                    **places.of(robot, node.uri),
                    "reachable": node.reachable,
                    "error": node.error,
                    "publications": len(node.publications),
                    "subscriptions": len(node.subscriptions),
                    "services": list(node.services),
                }
            )
        for name in sorted({*promises, *graph.topics} - PLUMBING_TOPICS):
            topic = graph.topic(name)
            topics.append(
                {
                    "robot": robot,
                    "name": name,
                    "type": topic.type,
                    "publishers": len(topic.publishers),
                    "subscribers": len(topic.subscribers),
                    "connections": len(topic.connections),
                    "rate": topic.rate,
                    "promised": promises.get(name),
                    "note": topic.rate_error,
                }
            )
    return nodes, topics


def read_reports(texts: Mapping[str, str]) -> tuple[list[Row], list[Row]]:
    """Reports of runs that may have changed something, the oldest first, and what cannot be read. By file name."""
    found: list[Row] = []
    problems: list[Row] = []
    for name, text in sorted(texts.items()):
        try:
            report = json.loads(text)
            hosts = [dict(host) for host in report["hosts"]]
            looking = report["check_mode"] or report["playbook"] in LOOKING
            kept = {"playbook": str(report["playbook"]), "started": str(report["started"]), "hosts": hosts}
            _rows = outcome_rows([kept]), step_rows([kept])  # one that cannot be shown must not keep the others from it
        except (ValueError, KeyError, TypeError, AttributeError) as error:
            problems.append(
                {
                    "where": name,
                    "what": f"not a report of fleet_report ({type(error).__name__})",
                    "todo": "take the file away from the reports",
                }
            )
            continue
        if not looking:
            found.append(kept)
    return _by_time(found), problems


def _by_time(reports: Iterable[Row]) -> list[Row]:
    return sorted(reports, key=lambda report: str(report["started"]))


def outcome_rows(reports: Iterable[Mapping[str, Any]]) -> list[Row]:
    """What the newest run that had the host made of it."""
    rows: dict[str, Row] = {}
    for report in reports:
        for host in report["hosts"]:
            name = str(host.get("host", ""))
            rows[name] = {
                "host": name,
                "outcome": str(host.get("outcome", "")),
                "playbook": report["playbook"],
                "started": report["started"],
                "changed": _count(host.get("changed")),
                "note": note_of(host),
            }
    return [rows[name] for name in sorted(rows)]


def _count(changed: Any) -> int:
    """A report has the names of tasks, a cluster how many they were."""
    return changed if isinstance(changed, int) else len(changed or [])


def step_rows(reports: Iterable[Mapping[str, Any]]) -> list[Row]:
    """The steps of each robot's newest run that had any, in their order."""
    newest: dict[str, list[Row]] = {}
    for report in reports:
        for host in report["hosts"]:
            steps = [_step(str(host.get("host", "")), step) for step in host.get("steps") or []]
            if steps:
                newest[steps[0]["robot"]] = steps
    return [step for robot in sorted(newest) for step in newest[robot]]


def _step(robot: str, step: Mapping[str, Any]) -> Row:
    phases = {str(name): float(seconds) for name, seconds in (step.get("phases") or {}).items()}
    return {
        "robot": robot,
        "id": str(step.get("id") or ""),
        "name": str(step.get("name", "")),
        "handoff": str(step.get("handoff", "")),
        "outcome": str(step.get("outcome", "")),
        "from": _versions(step.get("from")),
        "to": _versions(step.get("to")),
        "seconds": round(sum(phases.values()), 3),
        "busy_wait": float(step.get("busy_wait") or 0),
        "phases": phases,
        "note": str(step.get("reason") or ""),
    }


def _versions(apps: Any) -> list[str]:
    """`image (revision)` of each app of the step."""
    versions = [version for version in (apps or {}).values() if isinstance(version, Mapping)]
    return [f"{version.get('image', '')} ({version.get('revision', '')})" for version in versions]


def cluster_rows(
    clusters: Sequence[Mapping[str, Sequence[Object]]], usage: Mapping[str, int], now: float
) -> dict[str, list[Row]]:
    """What the clusters hold, from the objects of each by kind. `usage`: bytes used, by `<namespace>/<claim>`; `now` is
    a time in seconds since 1970."""

    def all_of(kind: str) -> list[Object]:
        return [*chain(*(objects.get(kind, ()) for objects in clusters))]

    nodes = node_rows(all_of("Node"))
    workloads = workload_rows(all_of("Deployment"), all_of("Pod"), now)
    return {
        "nodes": nodes,
        "placement": placement_rows(nodes, chain(*workloads.values())),
        **workloads,
        "went_back": went_back_rows(all_of("Deployment")),
        "claims": _sorted([row for objects in clusters for row in claim_rows(objects, usage)]),
    }


def status_rows(
    fleet: Mapping[str, Iterable[Row]],
    graphs: Mapping[str, Mapping[str, Any]],
    reports: Mapping[str, str],
    promised: Mapping[str, Mapping[str, Row]] = MappingProxyType({}),
) -> dict[str, list[Row]]:
    """All sections: hosts, problems and what the clusters hold (`fleet`), texts of reports.

    `graphs` are those of ros_graph_info, by robot.
    `promised` are the rates of topics, by robot, of apps that may not be there yet.
    Outcomes are those that the clusters keep (`runs`, `updates`) and those of reports: the newer one of each host.
    """
    workloads = [*chain(*(fleet.get(section, ()) for section in ("masters", "helpers", "apps")))]
    places = Places(workloads, fleet.get("nodes", ()))
    there = {(row["robot"], row["name"]) for row in workloads}
    kept = {
        graph: {topic: one for topic, one in topics.items() if (one["robot"], one["app"]) in there}
        for graph, topics in promised.items()
    }
    known = {robot: Graph.from_dict(graph) for robot, graph in graphs.items()}
    ros_nodes, topics = graph_rows(known, places, kept)
    crashes, ended = launched_rows(fleet.get("apps", ()), graphs)
    found, unreadable = read_reports(reports)
    return {
        "problems": [*fleet.get("problems", ()), *ending_rows(workloads), *crashes, *unreadable],
        **{key: list(fleet.get(key, ())) for key in _OF_CLUSTERS},
        "ended": ended,
        "ros_nodes": ros_nodes,
        "topics": topics,
        "links": [link for robot, graph in sorted(known.items()) for link in links(robot, graph)],
        "outcomes": outcome_rows(_by_time([*found, *fleet.get("runs", ())])),
        "steps": step_rows(_by_time([*fleet.get("updates", ()), *found])),
    }
