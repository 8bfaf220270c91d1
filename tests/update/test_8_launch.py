# SPDX-License-Identifier: GPL-3.0-or-later
"""A robot that is one launch file of nine nodes: updated, and taken back, without a loss to those outside of it."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from fleet import LIMIT, Fleet, Variables, scenario_apps

NINE = Path(__file__).with_name("nine")
BIN = "/opt/rosops-apps/bin"
PROGRAMS = ("temperature_publisher", "temperature_subscriber_cpp", "prime_factors_server", "add_two_ints_server")
INSIDE = ["temperature", "add-two-ints", "prime-factors"]  # apps that the launch file stands for
NODES = ("adder", "factors", "front/settings", "inside", "manager", "map_server", "relay", "sensor", "static_tf")


@pytest.fixture
def nine(fleet: Fleet) -> Iterator[Variables]:
    """The robot with the launch file; what the tests after this one find is what they know."""
    before = fleet.variables
    yield with_launch(fleet)
    fleet.update(before_the_action(before), *LIMIT, update_remove_apps=["bringup"])
    fleet.return_to(before)


def with_launch(fleet: Fleet, **launch: Any) -> Variables:
    apps = scenario_apps()
    scripts = {name: f'#!/bin/sh\nexec {BIN}/{name} "$@"\n' for name in PROGRAMS}
    plain = (".xml", ".launch")
    texts = {path.name: path.read_text("utf-8") for path in NINE.iterdir()}
    scripts |= {name: f"#!/usr/bin/python3\n{text}" for name, text in texts.items() if not name.endswith(plain)}
    texts |= scripts
    bringup = {
        "name": "bringup",
        "image": "lab/apps:robot",
        "command": ["/ros_entrypoint.sh"],
        "launch": {"package": "nine", "file": "nine.launch", "replace": ["factors"], **launch},
        "placement": "local",
        "pattern": "pubsub",
        "env": {"LOG_DIR": "/mnt/data/sensor-volume", "ROS_PACKAGE_PATH": "/srv"},
        "volumes": [{"name": "sensor-volume", "shared": True}],
        "files": [
            {"path": f"/srv/nine/{name}", "content": text, "mode": "0644" if name.endswith(plain) else "0755"}
            for name, text in sorted(texts.items())
        ],
        "drain_deadline": 70,
        "termination_grace_period": 80,
        "readiness": {
            "topics": [{"name": "temperature", "publishers": 1}, {"name": "/front/settings/told", "publishers": 1}],
            "services": ["add_two_ints", "/front/settings/tell"],
            "actions": ["prime_factors"],
        },
    }
    left = [without(app, "depends_on") for app in apps if app["name"] not in INSIDE]
    return {**fleet.variables, "scenario_apps": [bringup, *left], "lab_apps_version": "robot"}


def without(app: dict[str, Any], key: str) -> dict[str, Any]:
    return {name: value for name, value in app.items() if name != key}


def before_the_action(variables: Variables) -> Variables:
    """Without the action's own app: two servers of one action is what no version is proven beside."""
    apps = scenario_apps()
    left = [without(app, "depends_on") for app in apps if app["name"] != "prime-factors"]
    return {**variables, "scenario_apps": left}


def installed(fleet: Fleet, variables: Variables) -> None:
    for wanted, gone in ((before_the_action(variables), INSIDE[2:]), (variables, INSIDE[:2])):
        fleet.update(wanted, *LIMIT, update_remove_apps=gone).must(0)
    fleet.wait_settled()


def nodes_of(fleet: Fleet) -> list[str]:
    """The launch file's nodes on the graph, without their version, which is that of the pod."""
    (pod,) = fleet.pods()["robot1"]["bringup"]
    suffix = f"_{pod.version}"
    found = [name for name in fleet.cluster.ros_nodes("robot1", pod.name) if name.endswith(suffix)]
    return sorted(name.removesuffix(suffix).lstrip("/") for name in found)


@pytest.mark.long
@pytest.mark.promise("a launch file of nine nodes is updated without a loss, and a bad version of it taken back")
def test_a_launch_file_is_updated_without_a_loss(fleet: Fleet, nine: Variables) -> None:
    installed(fleet, nine)
    assert nodes_of(fleet) == [*NODES]
    watch = fleet.watch()
    changes = with_env(nine, ROSOPS_APPS_VERSION="next")
    run = fleet.update(changes, *LIMIT).must(0)
    assert [step["name"] for step in run.steps("robot1")] == ["bringup"], run
    assert nodes_of(fleet) == [*NODES]
    watch.assert_nothing_lost("robot1")

    watch = fleet.watch()
    slow = with_launch(fleet, args={"rate": 250})
    run = fleet.update(slow, *LIMIT, update_ready_timeout=30)  # the probe has its say after ten seconds
    assert run.outcomes["robot1"] == "rolled-back", run
    assert re.search(r"rate /temperature: 2[0-5]\d(\.\d+)? Hz", run.host("robot1")["reason"]), run
    assert nodes_of(fleet) == [*NODES]
    watch.assert_nothing_lost("robot1")


@pytest.mark.parametrize(("hooks", "times"), [("sidecar", 3), ("app", 10)])
def test_updates_of_a_launch_file_one_after_the_other(fleet: Fleet, nine: Variables, hooks: str, times: int) -> None:
    """With the figures at the end: copies, and how long nothing came."""
    bringup, *others = nine["scenario_apps"]
    changes = {**nine, "scenario_apps": [{**bringup, "hooks": hooks}, *others]}
    installed(fleet, changes)
    watch = fleet.watch()
    for number in range(times):
        changes = with_env(changes, ROSOPS_APPS_VERSION=f"number {number}")
        fleet.update(changes, *LIMIT).must(0)
    watch.assert_nothing_lost("robot1")
    before = fleet.running()
    fleet.update(changes, *LIMIT).must_change_nothing()
    fleet.assert_still_running(before)


def with_env(variables: Variables, **env: str) -> Variables:
    bringup, *others = variables["scenario_apps"]
    return {**variables, "scenario_apps": [{**bringup, "env": {**bringup["env"], **env}}, *others]}
