# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
from __future__ import annotations

from typing import Any

import pytest
from ansible_collections.rosops.fleet.plugins.plugin_utils._objects.keeper import keeper_objects
from ansible_collections.rosops.fleet.plugins.plugin_utils._objects.keeper_access import keeper_access
from ansible_collections.rosops.fleet.plugins.plugin_utils._objects.namespace import namespace_objects
from ansible_collections.rosops.fleet.tests.unit.robots import robot

GO_BACK = {
    ("apps", "deployments"): {"get", "list", "patch"},
    ("", "pods"): {"list"},
    ("", "configmaps"): {"get", "patch"},
    ("coordination.k8s.io", "leases"): {"get", "create", "update"},
    ("", "pods/eviction"): {"create"},  # of what hangs
    ("", "events"): {"create"},
}


def of(mode: str) -> list[dict[str, Any]]:
    return keeper_access(robot(name="r1", master={"mode": mode}))


def allowed(role: dict[str, Any]) -> dict[tuple[str, str], set[str]]:
    found: dict[tuple[str, str], set[str]] = {}
    for rule in role["rules"]:
        for group in rule["apiGroups"]:
            for kind in rule["resources"]:
                what = " ".join([kind, *rule.get("resourceNames", [])])
                found.setdefault((group, what), set()).update(rule["verbs"])
    return found


def places(objects: list[dict[str, Any]]) -> list[tuple[str, str, str]]:
    return [(one["kind"], one["metadata"].get("namespace", ""), one["metadata"]["name"]) for one in objects]


def test_a_robots_keeper_may_go_back_in_the_robots_namespace_and_do_nothing_else() -> None:
    account, role, binding = of("robot")
    assert places([account, role, binding]) == [
        ("ServiceAccount", "robot-r1", "ros-keeper"),
        ("Role", "robot-r1", "ros-keeper"),
        ("RoleBinding", "robot-r1", "ros-keeper"),
    ]
    assert allowed(role) == GO_BACK
    assert binding["roleRef"] == {"apiGroup": "rbac.authorization.k8s.io", "kind": "Role", "name": "ros-keeper"}
    assert binding["subjects"] == [{"kind": "ServiceAccount", "name": "ros-keeper", "namespace": "robot-r1"}]


def test_a_shared_masters_keeper_may_do_so_for_each_robot_that_told_it() -> None:
    objects = of("shared")
    assert places(objects) == [
        ("ServiceAccount", "fleet", "ros-keeper"),
        ("Role", "robot-r1", "ros-keeper"),
        ("RoleBinding", "robot-r1", "ros-keeper"),
        ("Role", "fleet", "ros-keeper"),
        ("RoleBinding", "fleet", "ros-keeper"),
        ("ClusterRole", "", "ros-keeper"),
        ("ClusterRoleBinding", "", "ros-keeper"),
        ("ConfigMap", "fleet", "robot-r1"),
    ]
    assert allowed(objects[1]) == GO_BACK
    assert allowed(objects[3]) == {**GO_BACK, ("", "configmaps"): {"get", "list", "patch"}}
    for binding in (objects[2], objects[4], objects[6]):
        assert binding["subjects"] == [{"kind": "ServiceAccount", "name": "ros-keeper", "namespace": "fleet"}]
    assert allowed(objects[5]) == {("coordination.k8s.io", "leases"): {"list"}}
    assert objects[6]["roleRef"]["kind"] == "ClusterRole"
    assert objects[7]["metadata"]["labels"]["rosops.fleet/kept"] == "true"


def test_nobody_keeps_an_external_master() -> None:
    assert keeper_access(robot(master={"mode": "external", "uri": "http://192.0.2.1:11311"})) == []


@pytest.mark.parametrize("mode", ["robot", "shared"])
def test_it_is_there_before_the_pod_that_needs_it(mode: str) -> None:
    """A pod without its account is not made; the namespace is applied before everything else of a robot."""
    made = robot(name="r1", master={"mode": mode})
    deployment = keeper_objects(made)[0]
    pod = deployment["spec"]["template"]["spec"]
    account = ("ServiceAccount", deployment["metadata"]["namespace"], pod["serviceAccountName"])
    objects = namespace_objects(made)
    assert account in places([one for one in objects if one["kind"] != "Namespace"])
    assert pod["automountServiceAccountToken"] is True
    spaces = [one["metadata"]["name"] for one in objects if one["kind"] == "Namespace"]
    inside = [one for one in objects if one["kind"] != "Namespace" and not one["kind"].startswith("ClusterRole")]
    assert {one["metadata"]["namespace"] for one in inside} <= set(spaces)
    assert objects[0]["kind"] == "Namespace"
