# SPDX-License-Identifier: GPL-3.0-or-later
"""Apps of images that have no Python, with files of the inventory and ports: their hooks are beside them."""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Any

import pytest
from fleet import LIMIT, Fleet, scenario_apps

BIN = "/opt/rosops-apps/bin"
BARE: dict[str, Any] = {"image": "lab/apps:bare", "hooks": "sidecar"}
IMAGES: dict[str, Any] = {"lab_apps_version": "bare"}


@pytest.fixture(autouse=True)
def settled(fleet: Fleet) -> Iterator[None]:
    """What the tests after this one find is what they know."""
    before = fleet.variables
    yield
    fleet.return_to(before)


@pytest.mark.long
@pytest.mark.promise("an image without Python is updated without a loss")
@pytest.mark.promise("a version that does less in the ROS graph is taken back")
def test_an_image_without_python_is_updated_without_a_loss(fleet: Fleet) -> None:
    files = [{"path": "/etc/sensor/limits.yaml", "content": "most: 40\n"}]
    ports = [{"name": "debug", "port": 9000, "node_port": 30123}]
    said: dict[str, Any] = {"command": [f"{BIN}/temperature_publisher_cpp"], "files": files, "ports": ports}
    changes = fleet.changed("robot1", "temperature", **said, params={"limits": {"most": 40, "on": True}}, **BARE)
    changes = fleet.changed(
        "robot1", "temperature-stats", on=changes, command=[f"{BIN}/temperature_subscriber_cpp"], **BARE
    )
    watch = fleet.watch()
    run = fleet.update({**changes, **IMAGES}, *LIMIT).must(0)
    assert {app for step in run.steps("robot1") for app in step["apps"]} == {"temperature", "temperature-stats"}, run
    fleet.wait_settled()
    (pod,) = fleet.pods()["robot1"]["temperature"]
    assert pod.image == "lab/apps:bare", pod
    assert fleet.cluster.execute("robot1", pod.name, "cat", files[0]["path"]) == files[0]["content"]
    assert fleet.cluster.execute("robot1", pod.name, "sh", "-c", "command -v python3 || echo none") == "none\n"
    assert fleet.cluster.behind("robot1", "temperature") == {"debug:9000": [pod.name]}
    assert own_parameters(fleet) == {f"temperature_{pod.version}": {"limits": {"most": 40, "on": True}}}

    # from one sidecar to the next, with a file and a parameter that say something else
    said = {"files": [{**files[0], "content": "most: 50\n"}], "params": {"limits": {"most": 50}}}
    changes = fleet.changed("robot1", "temperature", on=changes, **said)
    run = fleet.update({**changes, **IMAGES}, *LIMIT).must(0)
    assert [step["name"] for step in run.steps("robot1")] == ["temperature"], run
    (pod,) = fleet.pods()["robot1"]["temperature"]
    assert fleet.cluster.execute("robot1", pod.name, "cat", files[0]["path"]) == "most: 50\n"
    assert fleet.cluster.behind("robot1", "temperature") == {"debug:9000": [pod.name]}
    proven = {f"temperature_{pod.version}": {"limits": {"most": 50, "on": True}}}  # mappings are merged by the fleet
    assert own_parameters(fleet) == proven
    watch.assert_nothing_lost("robot1")

    # a version that must not stay is known by what its sidecar says
    watch = fleet.watch()
    bad = fleet.new_version("robot1", "temperature", on=changes, RATE_HZ=250)
    run = fleet.update({**bad, **IMAGES}, *LIMIT, update_ready_timeout=20)
    assert run.outcomes["robot1"] == "rolled-back", run
    assert re.search(r"rate /temperature: 2[0-5]\d(\.\d+)? Hz", run.host("robot1")["reason"]), run
    assert own_parameters(fleet) == proven
    watch.assert_nothing_lost("robot1")


def test_an_image_that_runs_what_it_runs_by_itself(fleet: Fleet) -> None:
    """Without a command: only its image knows what it starts, and gets the node's name as its argument."""
    apps = scenario_apps()
    (sensor,) = (app for app in apps if app["name"] == "temperature")
    del sensor["command"]
    sensor.update(args=[], **BARE)
    watch = fleet.watch()
    fleet.update({**fleet.variables, "scenario_apps": apps, **IMAGES}, *LIMIT).must(0)
    (pod,) = fleet.pods()["robot1"]["temperature"]
    assert (pod.image, pod.ended) == ("lab/apps:bare", ""), pod
    watch.assert_nothing_lost("robot1", goals=False)


def test_an_action_server_with_its_hooks_beside_it(fleet: Fleet) -> None:
    """Its goals are let end, and those that come meanwhile are held, as with hooks in its own container."""
    watch = fleet.watch()
    changes = fleet.changed("robot1", "prime-factors", hooks="sidecar")
    for _version in ("the first with a sidecar", "the next"):
        changes = fleet.new_version("robot1", "prime-factors", on=changes)
        run = fleet.update(changes, *LIMIT).must(0)
        assert [step["name"] for step in run.steps("robot1")] == ["prime-factors"], run
    watch.assert_nothing_lost("robot1")


def own_parameters(fleet: Fleet) -> dict[str, Any]:
    """Name of the sensor's version -> its private parameters."""
    (asked,) = fleet.pods()["robot1"]["add-two-ints"]
    known = fleet.cluster.parameters("robot1", asked.name)
    return {name: value for name, value in known.items() if re.fullmatch(r"temperature(_[0-9a-f]{8}_\w+)?", name)}
