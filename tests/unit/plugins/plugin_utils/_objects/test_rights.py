# SPDX-License-Identifier: GPL-3.0-or-later
"""What a keeper's account may do where. What bounds that further: test_admission.py."""

from __future__ import annotations

import re

import pytest
from ansible_collections.rosops.fleet.plugins.plugin_utils._objects import admission
from ansible_collections.rosops.fleet.plugins.plugin_utils._objects.rights import keeper_access
from ansible_collections.rosops.fleet.tests.unit.robots import robot

EXTERNAL = {"mode": "external", "uri": "http://192.0.2.1:11311"}
# what the readiness gates of a namespace's pods take
GATES = {
    ("pods", "list"), ("pods", "watch"), ("pods/status", "patch"), ("pods/eviction", "create"), ("events", "create"),
    ("configmaps", "get"),
}  # fmt: skip
MORE = {
    ("deployments", "get"), ("deployments", "list"), ("deployments", "patch"), ("configmaps", "patch"),
    ("leases", "get"), ("leases", "create"), ("leases", "update"),
}  # fmt: skip


@pytest.mark.parametrize(
    ("master", "home", "allowed"),
    [
        ({}, "robot-r1", {"robot-r1": GATES | MORE}),
        (EXTERNAL, "robot-r1", {"robot-r1": GATES | MORE}),
        ({"mode": "none"}, "robot-r1", {"robot-r1": GATES | MORE}),
        (
            {"mode": "shared"},
            "fleet",
            {
                "robot-r1": GATES | MORE,
                "fleet": GATES | MORE | {("configmaps", "list")},  # which robots there are
                "": {("leases", "list")},
            },
        ),
    ],
)
def test_a_keeper_may_open_gates_where_it_looks_and_nowhere_else(
    master: dict[str, str], home: str, allowed: dict[str, set[tuple[str, str]]]
) -> None:
    objects = keeper_access(robot(name="r1", master=master))
    found = {
        one["metadata"].get("namespace", ""): {
            (kind, verb) for rule in one["rules"] for kind in rule["resources"] for verb in rule["verbs"]
        }
        for one in objects
        if one["kind"] in ("Role", "ClusterRole")
    }
    assert found == allowed
    bindings = [one for one in objects if one["kind"] in ("RoleBinding", "ClusterRoleBinding")]
    assert [one["metadata"].get("namespace", "") for one in bindings] == [*found]
    account = {"kind": "ServiceAccount", "name": "ros-keeper", "namespace": home}
    assert all(one["subjects"] == [account] for one in bindings)


@pytest.mark.parametrize("home", ["robot-r1", "fleet"])
def test_the_policy_bounds_a_keeper_whichever_namespace_it_is_of_or_writes_in(home: str) -> None:
    policy, force = admission.admission_objects()
    (condition,) = policy["spec"]["matchConditions"]
    tests = re.findall(r"(startsWith|endsWith)\('([^']*)'\)", condition["expression"])
    user = f"system:serviceaccount:{home}:ros-keeper"
    assert [getattr(user, kind.lower())(text) for kind, text in tests] == [True, True]
    rules = policy["spec"]["matchConstraints"]["resourceRules"]
    assert "pods/status" in [kind for rule in rules for kind in rule["resources"]]
    assert "namespaceSelector" not in policy["spec"]["matchConstraints"]
    assert force["spec"].keys() == {"policyName", "validationActions"}
