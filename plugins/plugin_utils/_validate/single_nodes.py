# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Well-known nodes of which there must not be two, and why. Pure.

The same as users read in docs/apps.md, "Common packages". What is not in here the graph of the robot judges when it is
updated (`_update/nodes.py`); but neither a device nor a file that both would write to shows there.
"""

from __future__ import annotations

import re

from .launch_file import Node

_POSE = "two estimates of where the robot is would fight"
_MAP = "two would make two maps, and both say where the robot is"
_MOVES = "two of it would both move the robot"
_DEVICE = "it has one device, and the two would both drive it"

# Package -> the types of its nodes and nodelets, as a pattern, and the reason.
SINGLE: dict[str, tuple[str, str]] = {
    "amcl": ("amcl", _POSE),
    "robot_localization": ("(?i:ekf|ukf).*", _POSE),
    "robot_pose_ekf": ("robot_pose_ekf", _POSE),
    "gmapping": ("(?i:slam_?gmapping).*", _MAP),
    "hector_mapping": ("hector_mapping", _MAP),
    "slam_toolbox": (".*slam_toolbox_node", _MAP),
    "cartographer_ros": ("cartographer_(offline_)?node", _MAP),
    "move_base": ("move_base", "it serves an action, of which two servers lose goals, and " + _MOVES),
    "twist_mux": ("twist_mux", _MOVES),
    "teleop_twist_joy": ("teleop_node", _MOVES),
    "teleop_twist_keyboard": (r"teleop_twist_keyboard\.py", _MOVES),
    "controller_manager": ("spawner", "at its end it would unload the controllers of the new one, too"),
    "urg_node": ("urg_node", _DEVICE),
    "rplidar_ros": ("rplidarNode", _DEVICE),
    "usb_cam": ("usb_cam_node", _DEVICE),
    "realsense2_camera": ("realsense2_camera_node|RealSenseNodeFactory", _DEVICE),
    "velodyne_driver": ("velodyne_node|DriverNodelet", _DEVICE),
}


def why_single(node: Node) -> str:
    """Why there must not be two of a node, in words; empty: nothing known forbids it."""
    package, kind = node.program
    kinds, reason = SINGLE.get(package, ("", ""))
    if kinds and re.fullmatch(kinds, kind):
        return reason
    if package == "rosbag" and any(word.startswith(("-O", "--output-name")) for word in node.words):
        return "-O names one file, and both would write to it"
    for device in node.devices:
        return f"{device} is one device, and the two would both drive it"
    return ""
