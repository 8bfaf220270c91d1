# SPDX-License-Identifier: GPL-3.0-or-later
"""What containers may do on their host, where overrides say something; what they may without stands in the goldens."""

from __future__ import annotations

from typing import Any

import pytest
from ansible_collections.rosops.fleet.plugins.plugin_utils._objects.app import app_objects
from ansible_collections.rosops.fleet.plugins.plugin_utils._objects.common import APPS
from ansible_collections.rosops.fleet.plugins.plugin_utils._objects.master import master_objects
from ansible_collections.rosops.fleet.plugins.plugin_utils._objects.namespace import namespace_objects
from ansible_collections.rosops.fleet.tests.unit.robots import robot

SECURED = {"allowPrivilegeEscalation": False, "seccompProfile": {"type": "RuntimeDefault"}}
OPEN = {"allowPrivilegeEscalation": True, "capabilities": {"drop": [], "add": ["SYS_NICE"]}, "runAsUser": 1000}


def containers(pod: dict[str, Any]) -> dict[str, Any]:
    """What the overrides of an app, of the master and of its keeper make of their pods' containers, by name."""

    def overrides(name: str) -> dict[str, Any]:
        return {"spec": {"template": {"spec": {"containers": [{"name": name, "securityContext": pod}]}}}}

    app = {"name": "a", "image": "example.org/a:1", "args": ["x"], "overrides": overrides("ros-app")}
    master = {"overrides": overrides("ros-master-container"), "keeper_overrides": overrides("ros-keeper")}
    made = robot(app, master=master)
    pods = [
        one["spec"]["template"]["spec"] for one in [*master_objects(made), *app_objects(made)] if "Depl" in one["kind"]
    ]
    return {one["name"]: one.get("securityContext") for found in pods for one in found["containers"]}


def added(*names: str, drop: list[str]) -> dict[str, Any]:
    return {**SECURED, "capabilities": {"add": [*names], "drop": drop}}


@pytest.mark.parametrize(
    ("asked", "app", "ours"),
    [
        ({"privileged": True}, None, None),  # the API refuses it with escalation forbidden
        ({"capabilities": {"add": ["SYS_ADMIN"]}}, None, None),
        (OPEN, {**SECURED, **OPEN}, {**SECURED, **OPEN}),
        # raw sockets of a driver (EtherCAT, ping): containerd adds first and drops then, but for ALL, which goes before
        ({"capabilities": {"add": ["NET_RAW", "SYS_NICE"]}},
         added("NET_RAW", "SYS_NICE", drop=[one for one in APPS if one != "NET_RAW"]),
         added("NET_RAW", "SYS_NICE", drop=["ALL"])),
        ({"capabilities": {"add": ["ALL"]}}, added("ALL", drop=[]), added("ALL", drop=[])),
    ],
)  # fmt: skip
def test_overrides_come_last(asked: dict[str, Any], app: dict[str, Any] | None, ours: dict[str, Any] | None) -> None:
    """A mighty container is left as it is."""
    found = containers(asked)
    assert found == {"ros-app": app or asked, "ros-master-container": ours or asked, "ros-keeper": ours or asked}


def test_a_container_that_somebody_puts_beside_ours_is_his() -> None:
    beside = {"spec": {"template": {"spec": {"containers": [{"name": "mine", "image": "example.org/mine:1"}]}}}}
    found = master_objects(robot(master={"overrides": beside}))[0]["spec"]["template"]["spec"]["containers"]
    assert ["securityContext" in one for one in found] == [True, False]


@pytest.mark.parametrize("level", ["", "baseline"])
def test_a_namespace_has_the_level_that_was_asked_for(level: str) -> None:
    labels = namespace_objects(robot(pod_security=level))[0]["metadata"]["labels"]
    assert labels.get("pod-security.kubernetes.io/enforce", "") == level
