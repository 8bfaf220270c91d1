# SPDX-License-Identifier: GPL-3.0-or-later
"""The ROS graph of a mobile robot with an arm, as ros_graph_info returns it: some nodes, three of them at the edge."""

from __future__ import annotations

from typing import Any

from ansible_collections.rosops.fleet.plugins.plugin_utils._report.ros_graph import Reading, links
from ansible_collections.rosops.fleet.plugins.plugin_utils._report.rows import Link, Workload

# Topic, rate, who sends it, who hears it.
TOPICS = """
/scan                    15  merger > amcl move_base
/odometry/filtered       50  ekf > amcl move_base slam docking
/camera/image_raw        30  camera > detector recorder
/detections               5  detector > mission
/joint_states            50  arm_driver gripper > state_publisher grasp_planner
/cmd_vel_teleop           -  joystick > mux
/cmd_vel                 20  mux > base safety
/safety/stop             10  safety > mux arm_driver
/mission/state            1  mission > dashboard fleet_link
/log/bag_state            1  recorder > -
"""
EDGE = ("detector", "dashboard", "fleet_link")
ADDRESSES = {"robot1": "10.42.1.7", "edge1": "10.42.0.9"}
APPS = [
    Workload("robot1", "base", nodes=("robot1",), addresses=(ADDRESSES["robot1"],)),
    Workload("robot1", "detector", nodes=("edge1",), addresses=(ADDRESSES["edge1"],)),
]


def graph(broken: tuple[tuple[str, str], ...] = (), down: tuple[str, ...] = ()) -> dict[str, Any]:
    """`broken`: publisher and subscriber that are registered and not connected."""
    topics: dict[str, dict[str, Any]] = {}
    for line in TOPICS.strip().splitlines():
        name, rate, *rest = line.split(maxsplit=2)
        senders, hearers = ([f"/{one}" for one in part.split() if one != "-"] for part in rest[0].split(">"))
        pairs = [(one, other) for one in senders for other in hearers if (one, other) not in broken]
        topics[name] = {
            "type": "std_msgs/Empty",
            "publishers": senders,
            "subscribers": hearers,
            "connections": [{"publisher": one, "subscriber": other} for one, other in pairs],
            "rate": None if rate == "-" else float(rate),
        }
    for part, senders, hearers in (
        ("goal", ["/mission"], ["/move_base"]),
        ("result", ["/move_base"], ["/mission"]),
        ("status", ["/move_base"], ["/mission"]),
    ):
        pair = {"publisher": senders[0], "subscriber": hearers[0]}
        topics[f"/move_base/{part}"] = {"publishers": senders, "subscribers": hearers, "connections": [pair]}
    names = sorted({name for topic in topics.values() for name in (*topic["publishers"], *topic["subscribers"])})
    nodes = {
        name: {
            "uri": f"http://{ADDRESSES['edge1' if name[1:] in EDGE else 'robot1']}:40000/",
            "pid": None if name in down else 1,
        }
        for name in names
    }
    return {"nodes": nodes, "topics": topics, "actions": {"/move_base": {"servers": ["/move_base"]}}}


def rows(robot: str = "robot1", **more: Any) -> list[Link]:
    """As the section `links` has them."""
    return links({robot: Reading.from_dict(graph(**more), {})})
