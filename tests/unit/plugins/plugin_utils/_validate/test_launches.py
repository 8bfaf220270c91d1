# SPDX-License-Identifier: GPL-3.0-or-later
"""Launch files whose text is in the inventory, against what their app says of them, and nodes that are known."""

from __future__ import annotations

from typing import Any

import pytest
from ansible_collections.rosops.fleet.plugins.plugin_utils._model.app import File
from ansible_collections.rosops.fleet.plugins.plugin_utils._validate.fleet import check_fleet
from ansible_collections.rosops.fleet.plugins.plugin_utils._validate.launch_file import Node
from ansible_collections.rosops.fleet.plugins.plugin_utils._validate.launches import why_single, written
from ansible_collections.rosops.fleet.tests.unit.bad_input import table

AMCL = '<node pkg="amcl" type="amcl" name="amcl"/>'
TALKER = '<node pkg="demo" type="talk" name="talker"/>'
FOREIGN = '<node pkg="nodelet" type="nodelet" name="crop" args="load pcl/Crop manager"/>'
TWICE = "lacks the node /amcl (amcl/amcl): two estimates of where the robot is would fight"
JUDGED = "list it in launch.replace, or in launch.overlap if two of it do no harm"
FILE = "/srv/a.launch"


def problems(inside: str, launch: dict[str, Any] | None = None, robot: dict[str, Any] | None = None, **app: Any) -> str:
    """What is said of an app that overlaps and has one launch file."""
    given = {"file": FILE, **(launch or {})}
    files = app.pop("files", [{"path": FILE, "content": f"<launch>{inside}</launch>"}])
    changed = table.changed_app({"args": None, "pattern": "pubsub", "launch": given, "files": files, **app})
    report = check_fleet(table.GROUPS, {"robot1": {**(robot or {}), "ros_apps": [changed]}})
    assert report.problems or report.warnings == []
    return "\n".join(problem.line().removeprefix("hosts.robot1.ros_apps[0].") for problem in report.problems)


@pytest.mark.parametrize(
    ("inside", "launch", "app"),
    [
        (AMCL, {"replace": ["amcl"]}, {}),
        (f'<group ns="nav">{AMCL}</group>', {"replace": ["nav/amcl"]}, {}),
        (AMCL, {}, {"handoff": "replace"}),  # they are replaced together
        ('<node pkg="amcl" type="amcl" name="amcl" if="$(arg on)"/>', {"args": {"on": False}}, {}),
        ('<arg name="n"/><node pkg="amcl" type="amcl" name="$(env N)"/>', {"args": {"n": 1}}, {}),  # nobody knows
        ('<include file="b.launch"/>', {"replace": ["lidar"]}, {}),
        ('<include file="b.launch" pass_all_args="true"/>', {"args": {"n": 1}}, {}),
        ('<node pkg="a" type="b" name="$(anon b)"/>', {"replace": ["lidar"]}, {}),
        (FOREIGN, {"replace": ["crop"]}, {}),
        (FOREIGN + '<include file="b.launch"/>', {}, {}),
        (FOREIGN + '<node pkg="nodelet" type="nodelet" name="manager" args="manager"/>', {}, {}),
        (
            AMCL.replace("/>", ' if="$(env A)"/>') + AMCL.replace("/>", ' unless="$(env A)"/>'),
            {"overlap": ["amcl"]},
            {},
        ),
        (AMCL, {"replace": ["lidar"]}, {"files": []}),  # it is in the image
        (AMCL, {}, {"files": [{"path": FILE, "secret": "launches"}]}),
        (AMCL, {}, {"files": [{"path": "/srv/b.launch", "content": "no XML, and no launch file of ours"}]}),
    ],
)
def test_what_must_pass(inside: str, launch: dict[str, Any], app: dict[str, Any]) -> None:
    assert problems(inside, launch, **app) == ""


@pytest.mark.parametrize(
    ("inside", "launch", "words"),
    [
        (AMCL + TALKER, {}, f"launch.replace: {TWICE}; allowed: {JUDGED}"),
        (f'<group ns="nav">{AMCL}</group>', {"replace": ["amcl", "m/amcl"]}, "launch.replace[1]: is m/amcl, which"),
        (TALKER, {"overlap": ["talker", "amcl"]}, "launch.overlap[1]: is amcl, which the launch file does not start"),
        ("", {"overlap": ["amcl"]}, "allowed: leave it out"),
        (TALKER, {"replace": ["lidar"]}, "allowed: one of /talker"),
        (AMCL.replace("/>", ' if="$(env A)"/>'), {}, TWICE),  # it may be there
        (TALKER + TALKER, {}, f"launch.file: {FILE}, line 1: /talker is at {FILE}, line 1, too"),
        (TALKER, {"args": {"speed": 1}}, "launch.args.speed: is no <arg> of the launch file; allowed: no args"),
        ('<arg name="spead" default="1"/>', {"args": {"speed": 1}}, "allowed: one of spead"),
        ('<arg name="n"/>', {}, "launch.args: lacks n, for which /srv/a.launch, line 1, has neither a value nor"),
        ('<arg name="n"/>', {"args": {"n": ""}}, "launch.args: lacks n"),  # roslaunch does not take it
        (FOREIGN, {}, "lacks the node /crop (pcl/Crop): the launch file does not start its manager /manager"),
        (FOREIGN, {"overlap": ["crop"]}, "allowed: list it in launch.replace, or handoff: replace"),
    ],
)
def test_what_is_refused(inside: str, launch: dict[str, Any], words: str) -> None:
    said = problems(inside, launch)
    assert words in said
    assert len(said.splitlines()) == 1


def test_the_nodes_of_robots_on_one_master_have_the_robots_namespace() -> None:
    said = problems(AMCL, {"overlap": ["/amcl"]}, {"ros_master_mode": "shared"})
    assert "launch.overlap[0]: is /amcl, which the launch file does not start; allowed: one of /robot1/amcl" in said
    assert problems(AMCL, {"overlap": ["/robot1/amcl"]}, {"ros_master_mode": "shared"}) == ""


def test_several_files_are_one_app() -> None:
    files = [{"path": f"/srv/{name}.launch", "content": f"<launch>{AMCL}</launch>"} for name in "ab"]
    both = {"file": ["/srv/a.launch", "/srv/b.launch"], "overlap": ["amcl"]}
    assert "/srv/b.launch, line 1: /amcl is at /srv/a.launch, line 1, too" in problems("", both, files=files)
    files[1]["content"] = '<launch><arg name="n"/></launch>'
    assert problems("", {**both, "args": {"n": 1}}, files=files) == ""
    # of what is in the image nobody knows
    assert problems("", {**both, "args": {"m": 1}, "replace": ["lidar"]}, files=files[:1]) == ""
    assert TWICE in problems("", {"file": both["file"]}, files=files[:1])


@pytest.mark.parametrize(
    ("name", "paths", "found"),
    [
        ("/srv/a.launch", ["/srv/b.launch", "/srv/a.launch"], "/srv/a.launch"),
        ("/srv/a.launch", ["/srv/base/a.launch"], None),
        ("a.launch", ["/ws/src/base/a.launch"], "/ws/src/base/a.launch"),
        ("a.launch", ["/ws/src/base/launch/a.launch"], "/ws/src/base/launch/a.launch"),
        ("a.launch", ["/ws/src/arm/launch/a.launch"], None),
        ("a.launch", ["/ws/src/base/launch/a.launch", "/ws/src/base/a.launch"], None),  # roslaunch refuses both
        ("a.launch", ["/ws/src/base/launch/aa.launch"], None),
        ("a.launch", ["/ws/src/base_b/a.launch"], None),
    ],
)
def test_which_item_is_the_launch_file(name: str, paths: list[str], found: str | None) -> None:
    item = written([File(path, "text") for path in paths], "base", name)
    assert (item and item.path) == found


PORTS = ["/dev/ttyUSB0", "/dev/ttyUSB1"]


@pytest.mark.parametrize(
    ("node", "words"),
    [
        (Node("/n", "robot_localization", "ekf_localization_node"), "two estimates"),
        (Node("/n", "robot_localization", "navsat_transform_node"), ""),
        (Node("/n", "gmapping", "slam_gmapping"), "two maps"),
        (Node("/n", "slam_toolbox", "async_slam_toolbox_node"), "two maps"),
        (Node("/n", "cartographer_ros", "cartographer_node"), "two maps"),
        (Node("/n", "cartographer_ros", "cartographer_occupancy_grid_node"), ""),
        (Node("/n", "move_base", "move_base"), "two servers lose goals"),
        (Node("/n", "my_move_base", "move_base"), ""),
        (Node("/n", "rplidar_ros", "rplidarNode"), "one device"),
        (Node("/n", "rplidar_ros", "rplidarNodeClient"), ""),
        (Node("/n", "map_server", "map_server"), ""),
        # nodelets
        (Node("/n", "nodelet", "nodelet", "load realsense2_camera/RealSenseNodeFactory manager"), "one device"),
        (Node("/n", "nodelet", "nodelet", "standalone velodyne_driver/DriverNodelet"), "one device"),
        (Node("/n", "nodelet", "nodelet", "load gmapping/SlamGMappingNodelet manager"), "two maps"),
        (Node("/n", "nodelet", "nodelet", "load image_proc/rectify manager"), ""),
        (Node("/n", "nodelet", "nodelet", "load $(env DRIVER) manager"), ""),
        # bags
        (Node("/n", "rosbag", "record", "-a -O /bags/run.bag"), "both would write to it"),
        (Node("/n", "rosbag", "record", "-a -O/bags/run.bag"), "both would write to it"),
        (Node("/n", "rosbag", "record", "--output-name=/bags/run.bag -a"), "both would write to it"),
        (Node("/n", "rosbag", "record", "-a -o /bags/run"), ""),
        (Node("/n", "rosbag", "record", "-a --output-prefix=/bags/run"), ""),
        (Node("/n", "recorder", "record", "-a -O /bags/run.bag"), ""),
        (Node("/n", "base", "driver", devices=PORTS), "/dev/ttyUSB0 is one device, and the two would both drive it"),
    ],
)
def test_which_nodes_there_must_not_be_two_of(node: Node, words: str) -> None:
    said = why_single(node)
    assert words in said
    assert bool(said) == bool(words)
