# SPDX-License-Identifier: GPL-3.0-or-later
"""What containers may do on their host."""

from __future__ import annotations

from typing import Any

import pytest
from ansible_collections.rosops.fleet.plugins.plugin_utils._objects.app import app_objects
from ansible_collections.rosops.fleet.plugins.plugin_utils._objects.master import master_objects
from ansible_collections.rosops.fleet.plugins.plugin_utils._objects.namespace import namespace_objects
from ansible_collections.rosops.fleet.tests.unit.robots import robot

APP = {"name": "a", "image": "example.org/a:1", "args": ["x"]}


def contexts(*apps: dict[str, Any], **variables: Any) -> dict[str, Any]:
    """Deployment -> its container's securityContext."""
    made = robot(*apps, **variables)
    objects = [*master_objects(made), *app_objects(made)]
    return {
        one["metadata"]["name"]: one["spec"]["template"]["spec"]["containers"][0].get("securityContext")
        for one in objects
        if one["kind"] == "Deployment"
    }


def overrides(context: dict[str, Any], name: str = "ros-app") -> dict[str, Any]:
    return {"spec": {"template": {"spec": {"containers": [{"name": name, "securityContext": context}]}}}}


def test_nobody_gets_more_rights_than_it_started_with() -> None:
    found = contexts(APP)
    assert set(found) == {"ros-master", "ros-keeper", "a"}
    for context in found.values():
        assert context["allowPrivilegeEscalation"] is False
        assert context["seccompProfile"] == {"type": "RuntimeDefault"}
        assert "runAsNonRoot" not in context  # most ROS images run as root
    for ours in ("ros-master", "ros-keeper"):
        assert found[ours]["capabilities"] == {"drop": ["ALL"]}
    looks = contexts(volumes=[{"name": "logs"}], observability={"enabled": True})["ros-keeper"]
    assert looks["capabilities"] == {"drop": ["ALL"], "add": ["DAC_OVERRIDE"]}


def test_an_app_keeps_what_entrypoints_and_drivers_use() -> None:
    dropped = set(contexts(APP)["a"]["capabilities"]["drop"])
    assert {"NET_RAW", "MKNOD"} <= dropped
    assert not dropped & {"ALL", "CHOWN", "DAC_OVERRIDE", "FOWNER", "SETUID", "SETGID", "KILL", "NET_BIND_SERVICE"}


@pytest.mark.parametrize(
    ("asked", "expected"),
    [
        ({"privileged": True}, {"privileged": True}),  # the API refuses it with escalation forbidden
        ({"capabilities": {"add": ["SYS_ADMIN"]}}, {"capabilities": {"add": ["SYS_ADMIN"]}}),
    ],
)
def test_a_mighty_container_is_left_as_it_is(asked: dict[str, Any], expected: dict[str, Any]) -> None:
    assert contexts({**APP, "overrides": overrides(asked)})["a"] == expected
    assert contexts({**APP, "devices": ["/dev/ttyUSB0"]})["a"] == {"privileged": True}


def test_overrides_come_last() -> None:
    asked = {"allowPrivilegeEscalation": True, "capabilities": {"drop": [], "add": ["SYS_NICE"]}, "runAsUser": 1000}
    expected = {**asked, "seccompProfile": {"type": "RuntimeDefault"}}
    assert contexts({**APP, "overrides": overrides(asked)})["a"] == expected
    master = {"overrides": overrides(asked, "ros-master-container"), "keeper_overrides": overrides(asked, "ros-keeper")}
    found = contexts(master=master)
    assert found["ros-master"] == found["ros-keeper"] == expected


def test_a_container_that_somebody_puts_beside_ours_is_his() -> None:
    beside = {"spec": {"template": {"spec": {"containers": [{"name": "mine", "image": "example.org/mine:1"}]}}}}
    containers = master_objects(robot(master={"overrides": beside}))[0]["spec"]["template"]["spec"]["containers"]
    assert ["securityContext" in one for one in containers] == [True, False]


def in_the_container(context: dict[str, Any], before: set[str]) -> set[str]:
    """What containerd makes of capabilities: ALL first, then what is added, then what is dropped."""
    asked = context["capabilities"]
    add, drop = set(asked.get("add", ())), set(asked.get("drop", ()))
    all_of_them = {*before, "SYS_NICE", "IPC_LOCK"}
    start = set() if "ALL" in drop else all_of_them if "ALL" in add else before
    return (start | add) - drop - {"ALL"}


@pytest.mark.parametrize("wanted", [["NET_RAW"], ["NET_RAW", "SYS_NICE"], ["MKNOD"], ["ALL"]])
def test_a_capability_that_is_asked_for_is_there(wanted: list[str]) -> None:
    """Raw sockets of a driver (EtherCAT, ping): added, and dropped right after."""
    usual = {"CHOWN", "KILL", "MKNOD", "NET_RAW", "SYS_CHROOT"}
    asked = overrides({"capabilities": {"add": wanted}})
    found = in_the_container(contexts({**APP, "overrides": asked})["a"], usual)
    assert found >= ({"SYS_NICE", "IPC_LOCK", *usual} if wanted == ["ALL"] else {*wanted, "CHOWN", "KILL"})
    assert wanted == ["ALL"] or "SYS_CHROOT" not in found
    ours = contexts(master={"overrides": overrides({"capabilities": {"add": ["SYS_NICE"]}}, "ros-master-container")})
    assert in_the_container(ours["ros-master"], usual) == {"SYS_NICE"}


def test_only_what_is_set_right_changes_the_revision() -> None:
    same = {"allowPrivilegeEscalation": False}
    one, other = app_objects(robot(APP))[0], app_objects(robot({**APP, "overrides": overrides(same)}))[0]
    assert one["spec"]["template"] == other["spec"]["template"]


@pytest.mark.parametrize("level", ["", "baseline"])
def test_a_namespace_has_the_level_that_was_asked_for(level: str) -> None:
    labels = namespace_objects(robot(pod_security=level))[0]["metadata"]["labels"]
    assert labels.get("pod-security.kubernetes.io/enforce", "") == level
