# SPDX-License-Identifier: GPL-3.0-or-later
"""What bounds keepers. How the API server judges by it, tests/update/test_9_rights.py shows on a real one."""

from __future__ import annotations

import re
from typing import Any

import pytest
from ansible_collections.rosops.fleet.plugins.module_utils._step.words import BACK_TO
from ansible_collections.rosops.fleet.plugins.plugin_utils._objects import admission
from ansible_collections.rosops.fleet.plugins.plugin_utils._objects.app import app_objects
from ansible_collections.rosops.fleet.tests.unit.robots import robot

APP = {
    "name": "driver", "placement": "local", "image": "example.org/a:1",
    "command": ["sh", "-c", "a\nb"], "env": {"A": "1"},
}  # fmt: skip
LINES = {
    "image ros-app image=example.org/a:1",
    "env ros-app name=A value=1",
    "replicas deployment spec.replicas=1",
    "nodes 1",
    "node node-restriction.kubernetes.io/rosops-robot=robot1",
    "label rosops.fleet/robot=robot1",
    "account pod automountServiceAccountToken=false",
    "host pod",
    "projected.sources rosops-code configMap.name=rosops-code",
    "projected.sources rosops-code configMap.name=driver-update configMap.items=contract.json:contract.json",
    "volumeMounts ros-app name=rosops-code mountPath=/opt/rosops-fleet/hooks readOnly=true",
    "has pod nodeSelector",
    "has volumes projected",
    "has containers securityContext",
}


def deployment(**more: Any) -> dict[str, Any]:
    (made,) = app_objects(robot({**APP, **more}))
    return made


def lines(made: dict[str, Any]) -> list[str]:
    return admission.back_to(made)[BACK_TO].split("\n")


def test_a_version_is_told_a_fact_a_line() -> None:
    found = lines(deployment())
    assert set(found) >= LINES
    (run,) = (line for line in found if line.startswith("run "))
    assert " | sh | -c | a\\nb args=" in run
    assert " lifecycle.preStop.exec.command=python3 | " in run
    (may,) = (line for line in found if line.startswith("may "))
    assert "allowPrivilegeEscalation=false" in may
    assert "capabilities.drop=AUDIT_WRITE | MKNOD" in may
    assert all(line.split(" ")[0] in admission.WORDS for line in found)


@pytest.mark.parametrize(
    ("more", "new"),
    [
        ({"image": "example.org/a:2"}, {"image ros-app image=example.org/a:2"}),
        ({"devices": ["/dev/ttyS0"]}, {
            "may ros-app securityContext.privileged=true", "volume device-0 hostPath.path=/dev/ttyS0",
            "volumeMounts ros-app name=device-0 mountPath=/dev/ttyS0", "has volumes hostPath",
        }),
        ({"host_network": True}, {"host pod hostNetwork=true", "has pod hostNetwork", "has pod dnsPolicy"}),
        ({"env": {"A": {"secret": "s", "key": "k"}}}, {
            "env ros-app name=A valueFrom.secretKeyRef.name=s valueFrom.secretKeyRef.key=k",
        }),
        ({"overrides": {"spec": {"template": {"spec": {"priorityClassName": "system-node-critical"}}}}}, {
            "host pod priorityClassName=system-node-critical", "has pod priorityClassName",
        }),
        ({"placement": "remote"}, {"node node-restriction.kubernetes.io/rosops-placement=remote"}),
        ({"overrides": {"spec": {"replicas": 2}}}, {"replicas deployment spec.replicas=2"}),
        ({"overrides": {"spec": {"template": {"spec": {"hostNetwork": False, "serviceAccountName": "mine"}}}}}, {
            "account pod serviceAccountName=mine automountServiceAccountToken=false",
            "has pod hostNetwork", "has pod serviceAccountName",
        }),
    ],
)  # fmt: skip
def test_what_another_version_has_is_another_fact(more: dict[str, Any], new: set[str]) -> None:
    ours = ("label rosops.fleet/revision", "note ", "run ", "env ros-app name=ROS")
    found = set(lines(deployment(**more))) - set(lines(deployment()))
    assert {line for line in found if not line.startswith(ours)} == new


def test_none_before_and_one_with_too_many_facts() -> None:
    assert admission.back_to(None) == {BACK_TO: ""}
    many = {f"V{number}": "x" for number in range(admission.MOST)}
    assert admission.back_to(deployment(env=many)) == {}


def test_no_path_is_longer_than_the_api_server_follows() -> None:
    paths = [path for words in admission.TELLS.values() for found in words.values() for path in found]
    assert max(path.count(".") for path in paths) < 4


def test_what_is_left_out_by_the_api_server_is_left_out() -> None:
    made = deployment()
    pod = made["spec"]["template"]["spec"]
    pod["hostPID"], pod["containers"][0]["args"] = False, []
    pod["securityContext"] = {"runAsUser": 0, "supplementalGroups": [20, 44]}
    found = lines(made)
    assert {"host pod", "user pod securityContext.runAsUser=0 securityContext.supplementalGroups=20 | 44"} <= {*found}
    assert not any("args=" in line for line in found)


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
