# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Which nodes must not be there twice, as far as the graph shows it."""

from __future__ import annotations

from typing import Any

import pytest
from ansible_collections.rosops.fleet.plugins.module_utils._ros.graph import Graph
from ansible_collections.rosops.fleet.plugins.module_utils._ros.graph_json import graph_from
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.obstacles import obstacle

NODE = "/base_11111111"


def graph(topic: str = "/scan", type_: str = "sensor_msgs/LaserScan", **more: Any) -> Graph:
    return graph_from({"actions": more.pop("actions", {}), "topics": {topic: {"type": type_, **more}}})


@pytest.mark.parametrize(
    ("found", "words"),
    [
        (graph(publishers=[NODE]), ""),
        (graph(subscribers=[NODE]), ""),
        (graph("/cmd_vel", "geometry_msgs/Twist", publishers=[NODE]), "publishes /cmd_vel (geometry_msgs/Twist)"),
        (graph("/cmd_vel", "geometry_msgs/Twist", subscribers=[NODE]), "obeys /cmd_vel"),
        (graph("/cmd_vel", "geometry_msgs/Twist", subscribers=["/other"]), ""),
        (graph("/pose", "geometry_msgs/PoseStamped", publishers=[NODE]), ""),
        (graph("/drive", "ackermann_msgs/AckermannDrive", publishers=[NODE]), "publishes /drive"),
        (graph("/arm/command", "trajectory_msgs/JointTrajectory", subscribers=[NODE]), "obeys /arm/command"),
        (graph("/gripper", "control_msgs/GripperCommand", publishers=[NODE]), "publishes /gripper"),
        (graph("/mavros/rc", "mavros_msgs/RCIn", publishers=[NODE]), "publishes /mavros/rc"),
        (graph("/tf", "tf2_msgs/TFMessage", publishers=[NODE]), "publishes /tf, where two of it would contradict"),
        (graph("/robot1/tf", "tf2_msgs/TFMessage", publishers=[NODE]), "publishes /robot1/tf"),
        (graph("/tf_static", "tf2_msgs/TFMessage", publishers=[NODE]), ""),
        (graph("/tf", "tf2_msgs/TFMessage", subscribers=[NODE]), ""),
        (graph(actions={"/dock": {"servers": [NODE]}}), "serves the action /dock"),
        (graph(actions={"/dock": {"servers": ["/other"]}}), ""),
    ],
)
def test_what_forbids_two_of_a_node(found: Graph, words: str) -> None:
    said = obstacle(found, NODE)
    assert said.startswith(words)
    assert bool(said) == bool(words)


@pytest.mark.parametrize("node", ["/robot_state_publisher_1a", "/static_transform_publisher"])
def test_two_that_say_the_same_do_no_harm(node: str) -> None:
    assert obstacle(graph("/tf", "tf2_msgs/TFMessage", publishers=[node]), node) == ""
