# SPDX-License-Identifier: GPL-3.0-or-later
"""An app that is taken out of the inventory stays until its removal is asked for, and then leaves nothing behind."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest
from fleet import LIMIT, Fleet


@pytest.fixture(autouse=True)
def settled(fleet: Fleet) -> Iterator[None]:
    """What the tests after this one find is what they know."""
    before = fleet.variables
    yield
    left = [app for app in ("spare", "pair") if of_app(fleet, app)]
    if left:
        fleet.update(before, update_remove_apps=left)
    fleet.accept(before)


def of_app(fleet: Fleet, app: str) -> list[str]:
    """What the cluster has of it, and the parameter server."""
    (asked,) = fleet.pods()["robot1"]["add-two-ints"]
    parameters = fleet.cluster.parameters("robot1", asked.name)
    pods = [name for name, there in fleet.pods()["robot1"].items() if there]
    names = [name.split("/")[-1] for name in fleet.cluster.versions(["robot1"])]
    return sorted(name for name in [*pods, *names, *parameters] if name.startswith(app))


LAUNCH = """<launch>
  <arg name="second"/>
  <node pkg="pair" type="listen" name="pair_one"/>
  <node pkg="pair" type="listen" name="$(arg second)"/>
</launch>
"""
PACKAGE = (
    "<package><name>pair</name><version>1.0.0</version><description>two</description><license>none</license></package>"
)


def spare_and_pair(fleet: Fleet) -> None:
    """Two apps that are there: a node with all that an app may have, and a launch file that the inventory brings."""
    (listener,) = fleet.pods()["robot1"]["temperature-stats"]
    program = "/opt/rosops-apps/bin/temperature_subscriber"
    settings = {"LOG_DIR": "/tmp"}  # noqa: S108 - the pod's own
    both: dict[str, Any] = {"image": listener.image, "env": settings, "placement": "local"}
    spare: dict[str, Any] = {
        **both, "name": "spare", "command": ["/ros_entrypoint.sh", program], "pattern": "pubsub",
        "params": {"limit": 1}, "ports": [{"name": "web", "port": 9001}],
        "files": [{"path": "/etc/spare.yaml", "content": "a: 1\n"}],
    }  # fmt: skip
    pair: dict[str, Any] = {
        **both, "name": "pair", "command": ["/ros_entrypoint.sh"], "depends_on": ["spare"],
        "launch": {"package": "pair", "file": "two.launch", "args": {"second": "pair_two"}},
        "env": {**settings, "ROS_PACKAGE_PATH": "/srv"},
        "files": [
            {"path": "/srv/pair/package.xml", "content": PACKAGE},
            {"path": "/srv/pair/two.launch", "content": LAUNCH},
            {"path": "/srv/pair/listen", "content": f'#!/bin/sh\nexec {program} "$@"\n', "mode": "0755"},
        ],
        # those two, the one before, and the one that was there
        "readiness": {"timeout": 15, "topics": [{"name": "temperature", "subscribers": 4, "connected": True}]},
    }  # fmt: skip
    run = fleet.update({**fleet.variables, "ros_apps_robot": [pair, spare]}, *LIMIT).must(0)
    assert [step["name"] for step in run.steps("robot1")] == ["spare", "pair"], run
    # the pod, the Deployment, its files, its earlier versions, its parameters
    assert len(of_app(fleet, "spare")) == 5, of_app(fleet, "spare")
    assert len(of_app(fleet, "pair")) == 4, of_app(fleet, "pair")  # no parameters
    assert [*fleet.cluster.behind("robot1", "spare")] == ["web:9001"]


@pytest.mark.promise("an app that was taken out is removed without a loss, where that is asked for")
def test_an_app_that_was_taken_out_goes_when_that_is_asked_for(fleet: Fleet) -> None:
    without = fleet.variables
    spare_and_pair(fleet)
    watch = fleet.watch()
    before = fleet.running()

    run = fleet.update(without, *LIMIT).must(0, robot1="updated")
    assert run.host("robot1")["reason"] == "ConfigMap robot-robot1/robot-rest", run  # what the keeper is told of them
    assert "not in the inventory, left as they are (update_remove_apps takes them away): pair, spare" in run.output
    fleet.update(without, *LIMIT).must(0, robot1="unchanged").must_change_nothing()
    fleet.update(without, *LIMIT, "--check", update_remove_apps=["all"]).must(0, robot1="updated")
    fleet.assert_still_running(before)

    run = fleet.update(without, *LIMIT, update_remove_apps=["all"]).must(0, robot1="updated")
    assert [step["name"] for step in run.steps("robot1")] == ["pair", "spare"], run
    assert (of_app(fleet, "spare"), of_app(fleet, "pair")) == ([], [])
    assert fleet.cluster.behind("robot1", "spare") == {}
    watch.assert_nothing_lost("robot1")
