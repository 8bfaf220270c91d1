# SPDX-License-Identifier: GPL-3.0-or-later
"""Where pods go, and what of a host they may have there. How the API server judges: tests/update/test_9_rights.py."""

from __future__ import annotations

from typing import Any

import pytest
from ansible_collections.rosops.fleet.plugins.plugin_utils._objects import placement
from ansible_collections.rosops.fleet.plugins.plugin_utils._objects.namespace import namespace_objects
from ansible_collections.rosops.fleet.plugins.plugin_utils._objects.parts import PARTS, images, workload_objects
from ansible_collections.rosops.fleet.plugins.plugin_utils._objects.placement import of_other_host, pod_policy
from ansible_collections.rosops.fleet.tests.unit.robots import robot

OWN = {"node-restriction.kubernetes.io/rosops-robot": "robot1"}
OTHER = {"node-restriction.kubernetes.io/rosops-robot": "robot2"}
EDGE = {"node-restriction.kubernetes.io/rosops-placement": "remote"}
PRIVILEGED = {"securityContext": {"privileged": True}}
STORAGE = {"name": "v", "hostPath": {"path": placement.STORAGE}}


def pod(chosen: dict[str, str], container: dict[str, Any], **more: Any) -> dict[str, Any]:
    return {"nodeSelector": chosen, "containers": [{"name": "c", "image": "i", **container}], **more}


def mounts(read_only: bool) -> dict[str, Any]:
    return {"volumeMounts": [{"name": "v", "mountPath": "/v", "readOnly": read_only}]}


def adds(capability: str) -> dict[str, Any]:
    return {"securityContext": {"capabilities": {"add": [capability]}}}


@pytest.mark.parametrize(
    ("refused", "spec"),
    [
        ([], pod(OWN, PRIVILEGED, hostNetwork=True, hostPID=True, hostIPC=True)),
        ([], pod({"rosops.fleet/robot": "robot1"}, PRIVILEGED)),  # of 1.0
        *((["privileged (container c)"], pod(chosen, PRIVILEGED)) for chosen in (EDGE, OTHER, {})),
        (["privileged (container i)"], pod(EDGE, {}, initContainers=[{"name": "i", **PRIVILEGED}])),
        (["hostNetwork", "hostPID", "hostIPC"], pod(EDGE, {}, hostNetwork=True, hostPID=True, hostIPC=True)),
        (["hostPath (volume v)"], pod(EDGE, mounts(True), volumes=[{"name": "v", "hostPath": {"path": "/"}}])),
        ([], pod(EDGE, mounts(True), volumes=[STORAGE])),
        (["hostPath (volume v)"], pod(EDGE, mounts(False), volumes=[STORAGE])),
        (["capability SYS_ADMIN (container c)"], pod(EDGE, adds("SYS_ADMIN"))),
        ([], pod(EDGE, adds("DAC_OVERRIDE"))),
        ([], pod(EDGE, {"ports": [{"hostPort": 80}], "securityContext": {"seccompProfile": {"type": "Unconfined"}}})),
    ],
)
def test_what_a_pod_has_of_another_host(refused: list[str], spec: dict[str, Any]) -> None:
    assert of_other_host(spec, "robot-robot1") == refused


def test_of_the_fleet_s_namespace_no_node_is_the_own_one() -> None:
    assert of_other_host(pod({"node-restriction.kubernetes.io/rosops-robot": ""}, PRIVILEGED), "fleet")


@pytest.mark.parametrize("mode", ["robot", "shared", "external", "none"])
@pytest.mark.parametrize("where", ["local", "remote"])
def test_nothing_of_ours_needs_another_host(mode: str, where: str) -> None:
    """Also a keeper on the edge, which looks at what claims hold."""
    volumes = [{"name": "data", "size": "1Gi"}]
    app = {"name": "driver", "image": "a:1", "placement": where, "volumes": [{"name": "data"}]}
    app |= {"devices": ["/dev/ttyS0"], "host_network": True} if where == "local" else {}
    master = {"mode": mode, "uri": "http://h:11311" if mode == "external" else ""}
    master |= {} if mode == "shared" else {"placement": where}
    made = workload_objects(robot(app, volumes=volumes, master=master, observability={"enabled": True}), PARTS)
    for one in (one for one in made if one["kind"] == "Deployment"):
        assert of_other_host(one["spec"]["template"]["spec"], one["metadata"]["namespace"]) == []


def test_the_policy_says_which_rule_it_is_and_how_to_open_it() -> None:
    policy, binding = pod_policy()
    assert policy["spec"]["failurePolicy"] == "Fail" and binding["spec"]["validationActions"] == ["Deny"]
    *of_hosts, of_nodes = policy["spec"]["validations"]
    assert of_nodes["message"] == "a node makes no pods here"
    for rule in of_hosts:
        assert rule["message"].startswith("only a pod on its robot's own node (nodeSelector node-restriction.kubern")
        assert "robot_namespace_edge_host_access=true (the label rosops.fleet/edge-host-access" in rule["message"]


def test_a_robot_s_namespace_is_opened_by_name() -> None:
    def labels(**said: Any) -> list[str]:
        made = namespace_objects(robot(master={"mode": "shared"}, **said))
        found = [one["metadata"]["labels"] for one in made if one["kind"] == "Namespace"]
        return [one.get("rosops.fleet/edge-host-access", "") for one in found]

    assert labels() == labels(edge_host_access="no") == ["", ""]
    assert labels(edge_host_access=True) == labels(edge_host_access="True") == ["true", "true"]


def test_a_node_s_images_are_those_of_its_pods_by_whichever_label() -> None:
    chosen = {"node-restriction.kubernetes.io/rosops-robot": None, "rosops.fleet/robot": "robot1"}
    old = {"spec": {"template": {"spec": {"nodeSelector": chosen}}}}
    apps = [{"name": "a", "image": "a:1", "placement": "local"}, {"name": "b", "image": "b:1", "placement": "local"}]
    made = robot(apps[0], {**apps[1], "overrides": old}, {"name": "c", "image": "c:1", "placement": "remote"})
    assert images(made, "local") == ["a:1", "b:1", "ros:noetic-ros-core"]
    assert images(made, "remote") == ["c:1"]
