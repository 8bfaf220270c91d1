# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Well-known nodes of which there must not be two."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from ansible_collections.rosops.fleet.plugins.plugin_utils._validate.launch_file import Node
from ansible_collections.rosops.fleet.plugins.plugin_utils._validate.single_nodes import SINGLE, why_single

DOCS = Path(__file__).resolve().parents[5] / "docs" / "apps.md"


@pytest.mark.parametrize(
    ("package", "kind", "words"),
    [
        ("amcl", "amcl", "two estimates of where the robot is would fight"),
        ("robot_localization", "ekf_localization_node", "two estimates"),
        ("robot_localization", "ukf_localization_node", "two estimates"),
        ("gmapping", "slam_gmapping", "two maps"),
        ("slam_toolbox", "async_slam_toolbox_node", "two maps"),
        ("cartographer_ros", "cartographer_node", "two maps"),
        ("move_base", "move_base", "two servers lose goals"),
        ("teleop_twist_keyboard", "teleop_twist_keyboard.py", "both move the robot"),
        ("controller_manager", "spawner", "unload"),
        ("rplidar_ros", "rplidarNode", "one device"),
        ("realsense2_camera", "realsense2_camera_node", "one device"),
        ("velodyne_driver", "velodyne_node", "one device"),
    ],
)
def test_known_nodes(package: str, kind: str, words: str) -> None:
    assert words in why_single(Node("/n", package, kind))
    assert why_single(Node("/n", package, f"{kind}_view")) == "" or kind.startswith(("ekf", "ukf", "slam_gmapping"))
    assert why_single(Node("/n", f"my_{package}", kind)) == ""


@pytest.mark.parametrize(
    ("args", "words"),
    [
        ("load realsense2_camera/RealSenseNodeFactory manager", "one device"),
        ("standalone velodyne_driver/DriverNodelet", "one device"),
        ("load robot_localization/EkfNodelet manager", "two estimates"),
        ("load gmapping/SlamGMappingNodelet manager", "two maps"),
        ("load image_proc/rectify manager", ""),
        ("manager", ""),
        ("load $(env DRIVER) manager", ""),
    ],
)
def test_known_nodelets(args: str, words: str) -> None:
    said = why_single(Node("/n", "nodelet", "nodelet", args))
    assert words in said
    assert bool(said) == bool(words)


@pytest.mark.parametrize(
    ("args", "refused"),
    [
        ("-a -O /bags/run.bag", True),
        ("-a -O/bags/run.bag", True),
        ("--output-name=/bags/run.bag -a", True),
        ("-a -o /bags/run", False),
        ("-a --output-prefix=/bags/run", False),
        ("-a", False),
    ],
)
def test_bags(args: str, refused: bool) -> None:
    assert bool(why_single(Node("/recorder", "rosbag", "record", args))) == refused
    assert why_single(Node("/recorder", "recorder", "record", args)) == ""


def test_a_device_is_named() -> None:
    node = Node("/base", "base", "driver", devices=("/dev/ttyUSB0", "/dev/ttyUSB1"))
    assert why_single(node) == "/dev/ttyUSB0 is one device, and the two would both drive it"


@pytest.mark.parametrize(
    ("package", "kind"),
    [
        ("robot_localization", "navsat_transform_node"),
        ("cartographer_ros", "cartographer_occupancy_grid_node"),
        ("rplidar_ros", "rplidarNodeClient"),
        ("robot_state_publisher", "robot_state_publisher"),
        ("map_server", "map_server"),
        ("rosbag", "play"),
        ("nodelet", "nodelet"),
    ],
)
def test_of_others_two_do_no_harm(package: str, kind: str) -> None:
    assert why_single(Node("/n", package, kind)) == ""


@pytest.mark.parametrize("package", ["amcl", "robot_localization", "gmapping", "slam_toolbox", "move_base", "urg_node"])
def test_the_documentation_names_the_same_packages(package: str) -> None:
    assert package in SINGLE
    assert re.search(rf"^\| .*`{package}`", DOCS.read_text("utf-8"), re.MULTILINE)
