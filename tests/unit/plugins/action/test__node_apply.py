# SPDX-License-Identifier: GPL-3.0-or-later
"""The action: a node gets its labels and taints."""

from __future__ import annotations

from typing import Any

import pytest
from ansible_collections.rosops.fleet.plugins.action import _node_apply
from ansible_collections.rosops.fleet.tests.unit.plugins.action.actions import run
from ansible_collections.rosops.fleet.tests.unit.plugins.plugin_utils._kube.kube_objects import conditions, obj
from ansible_collections.rosops.fleet.tests.unit.plugins.plugin_utils._kube.kube_server import Server
from ansible_collections.rosops.fleet.tests.unit.robots import fleet_of, robot

PATH = "/api/v1/nodes/robot1"
PLACE = {"placement": "local", "robot": "robot1"}
TAINT = {"key": "gripper", "value": "", "effect": "NoSchedule"}


def apply(api: dict[str, Any], check_mode: bool = False, **options: Any) -> dict[str, Any]:
    given = {**api, "name": "robot1", **PLACE, **options}
    return run(_node_apply, given, fleet_of(robot()), check_mode)


def ready(server: Server, says: str = "True") -> None:
    server.put(PATH, obj("Node", "robot1", status={"conditions": conditions(Ready=says)}))


def test_labels_and_taints_once(server: Server, api: dict[str, Any]) -> None:
    ready(server)
    assert apply(api, labels={"a": "b"}, taints=[TAINT])["changed"]
    node = server.find(PATH)
    new = {f"node-restriction.kubernetes.io/rosops-{key}": value for key, value in PLACE.items()}
    labels = {**node["metadata"]["labels"]}
    assert labels.pop("node-restriction.kubernetes.io/rosops-taints")  # that what is said of the taints is our word
    assert labels == {"deploymentType": "local", "rosops.fleet/robot": "robot1", **new, "a": "b"}
    assert node["spec"]["taints"] == [{"key": "gripper", "effect": "NoSchedule"}]
    assert not apply(api, labels={"a": "b"}, taints=[TAINT])["changed"]
    assert apply(api)["changed"]
    node = server.find(PATH)
    assert "a" not in node["metadata"]["labels"]
    assert not node["spec"].get("taints")


def test_one_that_was_revoked_is_not_waited_for(server: Server, api: dict[str, Any]) -> None:
    """Its Node will not come, and whoever comes under its name may be a thief."""
    binding = "/apis/admissionregistration.k8s.io/v1/validatingadmissionpolicybindings/rosops-fleet-revoked-robot1"
    server.put(binding, {"metadata": {}})
    for check_mode in (True, False):
        refused = apply(api, check_mode)
        assert refused["failed"]
        assert "the node robot1 is revoked (rosops.fleet.revoke); k3s_enrol takes it" in refused["msg"]
    assert not server.writes


def runs(server: Server, **spec: Any) -> None:
    """A pod of ours runs on the node."""
    server.lists["/api/v1/pods"] = [{"metadata": {"name": "arm-1", "namespace": "robot-robot1"}, "spec": spec}]


def test_a_taint_that_would_end_what_works_there_is_refused(server: Server, api: dict[str, Any]) -> None:
    ready(server)
    runs(server)
    ends = {**TAINT, "effect": "NoExecute"}
    for check_mode in (True, False):
        refused = apply(api, check_mode, taints=[ends])
        assert refused["failed"] and "with NoExecute would end robot-robot1/arm-1 at once" in refused["msg"]
    assert not server.writes
    runs(server, tolerations=[{"key": "gripper", "operator": "Exists"}])
    assert apply(api, taints=[ends])["changed"]
    runs(server)
    assert not apply(api, taints=[ends])["changed"]  # it is there: whoever came since is Kubernetes' matter


def test_pods_that_lose_their_node_by_a_label_are_told(
    server: Server, api: dict[str, Any], capsys: pytest.CaptureFixture[str]
) -> None:
    ready(server)
    apply(api)
    runs(server, nodeSelector={"deploymentType": "local"})
    apply(api, labels={"a": "b"})
    assert "works on" not in capsys.readouterr().out
    assert apply(api, placement="remote")["changed"]
    assert "robot-robot1/arm-1 works on, and is not started again on robot1" in capsys.readouterr().out


def test_what_changes_meanwhile_is_looked_at_again(server: Server, api: dict[str, Any]) -> None:
    ready(server)
    apply(api)
    server.write_refusals += [(200, ""), (409, "the object has been modified")]
    result = apply(api, taints=[TAINT])
    assert result["changed"]
    assert [write for write in server.writes if PATH in write][-3:] == [f"PATCH {PATH}"] * 3


def test_a_node_that_does_not_come_fails(server: Server, api: dict[str, Any]) -> None:
    ready(server, "False")
    failed = apply(api, timeout=0.01)
    assert failed["failed"] and "Node robot1" in failed["msg"]
    assert not server.writes


def test_check_mode_foresees_a_node_that_has_not_joined(server: Server, api: dict[str, Any]) -> None:
    for access in (api, {"kubeconfig": "/nowhere/edge.yaml"}):
        result = apply(access, check_mode=True)
        assert result["changed"] and "node robot1 has not joined yet" in result["msg"]
    assert not server.writes
