# SPDX-License-Identifier: GPL-3.0-or-later
"""What keeps two versions of an app from overlapping, and what follows where nothing is said."""

from __future__ import annotations

from typing import Any

import pytest
from ansible_collections.rosops.fleet.plugins.plugin_utils._model import context
from ansible_collections.rosops.fleet.tests.unit.robots import robot


def app(declared: Any = (), /, **changes: Any) -> context.App:
    one = {"name": "a", "image": "example.org/a:1", "args": ["x"], "pattern": "pubsub", **changes}
    return robot(one, volumes=declared).apps[0]


def container(**fields: Any) -> dict[str, Any]:
    return {"spec": {"template": {"spec": {"containers": [{"name": "ros-app", **fields}]}}}}


LOGS = [{"name": "logs"}]
GPU = {"limits": {"nvidia.com/gpu": 1}}


@pytest.mark.parametrize(
    ("changes", "handoff"),
    [
        ({}, "overlap"),
        ({"devices": ["/dev/ttyUSB0"]}, "replace"),
        ({"devices": ["/dev/ttyUSB0"], "pattern": "action"}, "drain"),
        ({"devices": ["/dev/ttyUSB0"], "handoff": "drain"}, "drain"),
        ({"host_network": True}, "replace"),
        ({"overrides": {"spec": {"template": {"spec": {"hostNetwork": True}}}}}, "replace"),
        ({"overrides": container(ports=[{"containerPort": 1, "hostPort": 8080}])}, "replace"),
        ({"overrides": container(ports=[{"containerPort": 8080}])}, "overlap"),
        ({"resources": GPU}, "replace"),
        ({"resources": {"requests": {"nvidia.com/gpu": "1"}}}, "replace"),
        ({"resources": {"limits": {"nvidia.com/gpu": 0, "memory": "1Gi"}}}, "overlap"),
        ({"resources": {"limits": {"nvidia.com/gpu": "0"}}}, "overlap"),
        ({"overrides": container(resources=GPU)}, "replace"),
        ({"volumes": LOGS}, "replace"),
        ({"volumes": [{"name": "logs", "read_only": True}]}, "overlap"),
        ({"volumes": [{"name": "logs", "shared": True}]}, "overlap"),
        ({"volumes": [{"name": "pod", "shared": True}]}, "replace"),
        ({"volumes": [{"name": "many"}]}, "overlap"),
        ({"volumes": [{"name": "unknown"}]}, "overlap"),  # an error of its own
    ],
)
def test_what_two_pods_cannot_have_makes_replace_of_overlap(changes: dict[str, Any], handoff: str) -> None:
    declared = [
        {"name": "logs"},
        {"name": "pod", "access_mode": "ReadWriteOncePod"},
        {"name": "many", "access_mode": "ReadWriteMany"},
    ]
    assert app(declared, **changes).handoff == handoff


def test_devices_are_the_robots() -> None:
    assert app(devices=["/dev/ttyUSB0"]).placement == "local"
    assert app().placement == "remote"


@pytest.mark.parametrize(
    ("changes", "node"),
    [
        ({}, "/a"),
        ({"args": ["x", "__ns:=cam"]}, "/cam/a"),
        ({"args": ["x", "__ns:=/front/cam/"]}, "/front/cam/a"),
        ({"env": {"ROS_NAMESPACE": "cam"}}, "/cam/a"),
        ({"env": {"ROS_NAMESPACE": "other"}, "args": ["__ns:=cam"]}, "/cam/a"),
        ({"command": ["sh", "-c", 'exec talk __ns:=cam "$@"'], "args": ["sh"]}, "/cam/a"),
        ({"env": {"ROS_NAMESPACE": "/"}}, "/a"),
    ],
)
def test_a_namespace_of_the_apps_own(changes: dict[str, Any], node: str) -> None:
    one = {"name": "a", "image": "example.org/a:1", **changes}
    made = robot(one)
    assert context.graph_node(made.apps[0], made) == node
    if "env" in changes or changes == {}:
        shared = robot(one, name="r1", master={"mode": "shared"})
        assert context.robot_space(shared.apps[0], shared) == "/r1"
