# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""What a cluster says of a node that is to be changed, asked of an API server in this process."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest
from ansible_collections.rosops.fleet.plugins.module_utils._common.errors import NotReadyError
from ansible_collections.rosops.fleet.plugins.plugin_utils._kube.client import Kube
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.cluster import KubeCluster
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.kube_nodes import (
    robots_on,
    server_versions,
    servers_down,
)
from ansible_collections.rosops.fleet.tests.unit.plugins.plugin_utils._kube.kube_server import Server
from ansible_collections.rosops.fleet.tests.unit.robots import robot

NODE = {"apiVersion": "v1", "kind": "Node", "metadata": {"name": "edge1"}}


def node(name: str, server: bool, ready: str = "True") -> dict[str, Any]:
    labels = {"node-role.kubernetes.io/control-plane": "true"} if server else {}
    conditions = [{"type": "Ready", "status": ready, "message": "kubelet stopped"}]
    status = {"nodeInfo": {"kubeletVersion": "v1.34.2+k3s1"}, "conditions": conditions}
    return {"metadata": {"name": name, "labels": labels, "uid": name}, "status": status}


@pytest.fixture
def cluster(server: Server) -> Iterator[KubeCluster]:
    with Kube({"host": server.url, "api_key": "t"}) as kube:
        yield KubeCluster(kube, lambda _text: None, "us")


def test_when_a_kubelet_was_heard_of(server: Server, cluster: KubeCluster) -> None:
    assert cluster.beat("edge1") == ""
    lease = {"metadata": {"name": "edge1"}, "spec": {"renewTime": "2026-11-22T07:00:00.000000Z"}}
    server.lists["/apis/coordination.k8s.io/v1/namespaces/kube-node-lease/leases"] = [lease]
    assert cluster.beat("edge1") == "2026-11-22T07:00:00.000000Z"


def test_robots_with_pods_on_a_node(server: Server, cluster: KubeCluster) -> None:
    server.lists["/api/v1/pods"] = [{"metadata": {"name": "a", "namespace": "robot-robot2"}}]
    found = robots_on(cluster._kube, "edge1", [robot(name="robot1"), robot(name="robot2")])
    assert [one.name for one in found] == ["robot2"]
    assert ("/api/v1/pods", {"fieldSelector": "spec.nodeName=edge1"}) in asked(server)


def test_robots_that_need_what_is_the_whole_fleets(server: Server, cluster: KubeCluster) -> None:
    """A shared master and apps of the fleet have their pods beside all robots' namespaces."""
    fleet = {"name": "map", "scope": "fleet", "placement": "remote", "image": "x.org/map:1"}
    robots = [
        robot(name="robot1"),
        robot(name="robot2", master={"mode": "shared"}),
        robot(fleet, name="robot3"),
        robot(fleet, name="robot4", mode="standalone"),
    ]
    server.lists["/api/v1/pods"] = [{"metadata": {"name": "ros-master-1", "namespace": "fleet"}}]
    assert [one.name for one in robots_on(cluster._kube, "edge1", robots)] == ["robot2", "robot3"]


def asked(server: Server) -> list[tuple[str, dict[str, str]]]:
    found = []
    while not server.requests.empty():
        path, query, _headers = server.requests.get()
        found.append((path, query))
    return found


def test_a_node_is_waited_for_until_it_is_ready(server: Server, cluster: KubeCluster) -> None:
    server.lists["/api/v1/nodes"] = [node("edge1", True)]
    cluster.wait([NODE], 5.0)
    server.lists["/api/v1/nodes"] = [node("edge1", True, "Unknown")]
    with pytest.raises(NotReadyError, match="edge1"):
        cluster.wait([NODE], 0.2)


def test_servers_and_who_of_them_is_away() -> None:
    nodes = [node("edge1", True, "False"), node("edge2", True), node("robot1", False, "False")]
    assert server_versions(nodes) == {"edge1": "v1.34.2+k3s1", "edge2": "v1.34.2+k3s1"}
    assert servers_down(nodes, "edge2") == ["edge1"]
    assert servers_down(nodes, "edge1") == []
