# SPDX-License-Identifier: GPL-3.0-or-later
"""A robot as its users describe it, with apps of its own: a driver with a device, a latched map, a launch
file and parameters from the inventory, a recorder with a volume, a bridge at a port, an init container.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from fleet import LIMIT, Fleet, Variables

HERE = Path(__file__).parent
APPS = ("lidar", "map", "pipeline", "controller", "recorder", "bridge")


def file(name: str, directory: str = "robot") -> dict[str, Any]:
    """A program or a text of the tests, as an item of `files`."""
    text = (HERE / directory / name).read_text("utf-8")
    program = "." not in name
    shebang = "#!/usr/bin/python3\n" if program else ""
    return {"path": f"/srv/{directory}/{name}", "content": shebang + text, "mode": "0755" if program else "0644"}


def robot_apps(version: str) -> list[dict[str, Any]]:
    both: dict[str, Any] = {"image": "lab/apps:robot", "env": {"VERSION": version}, "placement": "local"}
    entry = ["/ros_entrypoint.sh"]
    return [
        {**both, "name": "lidar", "command": [*entry, "/srv/robot/scan"], "pattern": "pubsub", "devices": ["/dev/null"],
         "files": [file("scan")], "params": {"port": "/dev/null"},
         "readiness": {"topics": [{"name": "scan", "type": "sensor_msgs/LaserScan", "publishers": 1, "min_rate": 9}]}},
        {**both, "name": "map", "command": [*entry, "/srv/nine/map_server"], "pattern": "pubsub",
         "files": [file("map_server", "nine")], "readiness": {"topics": [{"name": "map", "publishers": 1}]}},
        {**both, "name": "pipeline", "command": entry, "pattern": "pubsub", "depends_on": ["lidar"],
         "launch": {"file": "/srv/robot/bringup.launch", "args": {"frame": "laser"}},
         "env": {**both["env"], "ROS_PACKAGE_PATH": "/srv"},
         "files": [file(name) for name in ("image", "bringup.launch", "package.xml")],
         "readiness": {"topics": [{"name": "/rectify/image_raw", "publishers": 1}]}},
        {**both, "name": "controller", "command": [*entry, "/srv/robot/image"], "handoff": "replace",
         "files": [file("image")], "params": {"rate": 50, "pid": {"p": 1.5}}, "keep_params": ["rate"]},
        {**both, "name": "recorder", "command": entry, "readiness": {"nodes": False},
         "args": ["sh", "-c", "exec rostopic echo -p /scan/header/seq > /mnt/data/sensor-volume/scan-$(hostname).csv"],
         "volumes": [{"name": "sensor-volume", "shared": True}]},
        {**both, "name": "bridge", "command": ["/srv/robot/bridge"], "readiness": {"nodes": False},
         "files": [file("bridge")],
         "ports": [{"name": "web", "port": 9090, "node_port": "{{ 30190 + inventory_hostname[-1] | int }}"}],
         "overrides": {"spec": {"template": {"spec": {"initContainers": [
             {"name": "first", "image": "lab/apps:robot", "command": ["true"]}]}}}}},
    ]  # fmt: skip


@pytest.fixture
def variables(fleet: Fleet) -> Iterator[Variables]:
    """The fleet's, with one robot's own apps; what the tests after this one find is what they know."""
    before = fleet.variables
    yield {**before, "lab_apps_version": "robot"}
    fleet.update(before, *LIMIT, update_remove_apps=[*APPS])
    fleet.return_to(before)


def test_a_robot_with_all_that_robots_have(fleet: Fleet, variables: Variables) -> None:
    watch = fleet.watch()
    for version in ("1", "2"):
        wanted = {**variables, "ros_apps_robot": robot_apps(version)}
        run = fleet.update(wanted, *LIMIT).must(0, robot1="updated")
        assert {app for step in run.steps("robot1") for app in step["apps"]} == {*APPS}, run
        fleet.update(wanted, *LIMIT).must(0, robot1="unchanged").must_change_nothing()
    pods = fleet.pods()["robot1"]
    (asked,) = pods["lidar"]
    known = fleet.cluster.parameters("robot1", asked.name)
    assert (known["lidar"], known["controller"]) == ({"port": "/dev/null"}, {"rate": 50, "pid": {"p": 1.5}})
    nodes = fleet.cluster.ros_nodes("robot1", asked.name)
    launched = [f"/{name}_{pods['pipeline'][0].version}" for name in ("detect", "rectify")]
    assert {*launched, "/lidar", f"/map_{pods['map'][0].version}", "/controller"} <= {*nodes}
    look = "import urllib.request; print(urllib.request.urlopen('http://127.0.0.1:30191/').status)"
    assert fleet.hosts.ssh("robot1", f'python3 -c "{look}"').strip() == "200"
    recorded = fleet.hosts.ssh("robot1", "cat /var/lib/rancher/k3s/storage/*robot1_sensor*/scan-*.csv | wc -l")
    assert int(recorded) > 100
    watch.assert_nothing_lost("robot1")
