# SPDX-License-Identifier: GPL-3.0-or-later
"""A fleet's Kubernetes objects and its graph, and how it stands by them."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from ansible_collections.rosops.fleet.plugins.plugin_utils._model.keys import read
from ansible_collections.rosops.fleet.plugins.plugin_utils._report.held import cluster_rows
from ansible_collections.rosops.fleet.plugins.plugin_utils._report.look import status_of
from ansible_collections.rosops.fleet.plugins.plugin_utils._report.ros_graph import Reading
from ansible_collections.rosops.fleet.plugins.plugin_utils._report.rows import Host, Status
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.world import Object

NOW = 1_795_536_750.0  # 2026-11-24T16:12:30Z

# Rows of hosts and apps, as mappings; `status` makes sections of these.
UP = {"name": "robot1", "group": "robots", "role": "agent", "cluster": "edge", "reachable": True}
OFF = {**UP, "name": "robot2", "reachable": False, "reason": "timed out"}
EDGE_OFF = {"name": "edge1", "group": "edge", "role": "server", "cluster": "edge", "reachable": False}


def app(robot: str, ready: int = 0, **more: Any) -> dict[str, Any]:
    row = {"name": "sensor", "namespace": f"robot-{robot}", "robot": robot, "ready": ready, "nodes": [robot]}
    return {**row, **more}


def status(**sections: Any) -> Status:
    return read(Status, sections)


def node(name: str, ready: str = "True", **labels: str) -> Object:
    own = {"rosops.fleet/robot": name, "deploymentType": "local"} if name.startswith("robot") else {}
    place = {"placement": "local", "robot": name} if own else {"placement": "remote"}
    built_in = {f"node-restriction.kubernetes.io/rosops-{key}": value for key, value in place.items()}
    built_in |= {"kubernetes.io/hostname": name, "beta.kubernetes.io/os": "linux", "node.k3s.io/instance-type": "k3s"}
    condition = {"type": "Ready", "status": ready, "reason": "KubeletReady" if ready == "True" else "NoKubelet"}
    addresses = [{"type": "Hostname", "address": name}, {"type": "InternalIP", "address": "10.0.0.11"}]
    status = {"addresses": addresses, "nodeInfo": {"kubeletVersion": "v1.34.2+k3s1"}}
    return {
        "metadata": {"name": name, "labels": {**built_in, "deploymentType": "remote", **own, **labels}},
        "spec": {},
        "status": {"conditions": [condition], **status},
    }


def workload(name: str, ready: int = 1, remote: bool = False, manager: str = "rosops.fleet") -> Object:
    robot = "robot1"
    place = {"placement": "remote"} if remote else {"robot": robot}
    where = {f"node-restriction.kubernetes.io/rosops-{key}": value for key, value in place.items()}
    own = {"app.kubernetes.io/managed-by": manager, "rosops.fleet/app": name, "rosops.fleet/robot": robot}
    pod_spec = {"nodeSelector": where, "containers": [{"name": "ros-app", "image": "lab/apps:1.0"}]}
    return {
        "metadata": {"name": name, "namespace": f"robot-{robot}", "labels": own},
        "spec": {"replicas": 1, "template": {"spec": pod_spec}},
        "status": {"readyReplicas": ready},
    }


def pod(app: str, node_name: str, robot: str = "robot1", ready: bool = True, restarts: int = 0) -> Object:
    waiting = {"waiting": {"reason": "ImagePullBackOff", "message": "no such image"}}
    container = {"name": "ros-app", "image": "lab/apps:1.0", "restartCount": restarts}
    return {
        "metadata": {"name": f"{app}-1", "namespace": f"robot-{robot}", "labels": {"rosops.fleet/app": app}},
        "spec": {"nodeName": node_name},
        "status": {
            **({"podIP": "10.42.0.7"} if ready else {}),
            "conditions": [{"type": "Ready", "status": "True" if ready else "False"}],
            "containerStatuses": [{**container, "state": {"running": {}} if ready else waiting}],
        },
    }


def claim(phase: str = "Bound") -> Object:
    return {
        "metadata": {"name": "logs-pvc", "namespace": "robot-robot1", "labels": {"rosops.fleet/robot": "robot1"}},
        "spec": {"storageClassName": "local-path", "resources": {"requests": {"storage": "100Mi"}}},
        "status": {"phase": phase, "capacity": {"storage": "1Gi"}} if phase == "Bound" else {},
    }


SAMPLES = {"type": "demo/Sample", "publishers": ["/sensor"], "subscribers": ["/stats"], "rate": 499.83}
SENSOR = {"pid": 1, "publications": ["/temperature", "/rosout"], "services": ["/s"]}
GRAPH = {
    "nodes": {"/sensor": SENSOR, "/ghost": {"error": "connection refused"}},
    "topics": {
        "/temperature": {**SAMPLES, "connections": [{"publisher": "/sensor", "subscriber": "/stats"}]},
        "/rosout": {"type": "rosgraph_msgs/Log"},
        "/idle": {"type": "std_msgs/String", "rate": None, "rate_error": "no publisher answers"},
    },
}
HOSTS = (
    Host("edge1", "edge", "10.0.0.11", "server", "edge"),
    Host("robot2", "robots", "", "agent", "edge", reachable=False, reason="timed out"),
)
OBJECTS: dict[str, list[Object]] = {
    "Node": [
        node("robot1", "Unknown"),
        node("edge1", **{"node-role.kubernetes.io/control-plane": "true", "zone": "a"}),
    ],
    "Deployment": [
        *(workload("temperature-sensor"), workload("stats", remote=True, ready=0), workload("ros-master")),
        workload("not-ours", manager="helm"),
    ],
    "Pod": [
        pod("temperature-sensor", "robot1", restarts=2),
        pod("stats", "edge1", ready=False),
        pod("ros-master", "robot1"),
        pod("stats", "edge9", robot="robot9"),
    ],
    "PersistentVolumeClaim": [claim()],
}
USAGE = {"robot-robot1/logs-pvc": 5_345_678}
SOURCES: dict[str, Any] = {**OBJECTS, "hosts": HOSTS, "graphs": {"robot1": GRAPH}, "usage": USAGE}


def fleet_status(sources: dict[str, Any]) -> Status:
    """By objects of each kind and what is known beside them."""
    held = replace(cluster_rows([sources], sources.get("usage", {}), NOW), hosts=sources.get("hosts", ()))
    promised = sources.get("promised", {})
    graphs = {robot: Reading.from_dict(one, promised) for robot, one in sources.get("graphs", {}).items()}
    return status_of(held, graphs)
