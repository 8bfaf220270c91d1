# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Why two of a node must not be there at once, as far as the ROS graph shows it. Pure.

It shows names and types: a device, a port or a file that both would write to it does not show.
"""

from __future__ import annotations

from ...module_utils._ros.graph import Graph, names_of

# Who publishes one of these moves the robot, and who takes it obeys.
MOVING = ("geometry_msgs/Twist", "geometry_msgs/TwistStamped", "trajectory_msgs/JointTrajectory")
MOVING_PACKAGES = ("ackermann_msgs/", "control_msgs/", "mavros_msgs/")
# These say what follows from the robot's description alone: two of them say the same.
AGREEING = ("state_publisher", "static_transform")


def obstacle(graph: Graph, node: str) -> str:
    """What the node does that two of it would undo, in words; empty: nothing that shows."""
    for name, action in sorted(graph.actions.items()):
        if node in names_of(action.servers):
            return f"serves the action {name}, of which two servers lose goals"
    for name, topic in sorted(graph.topics.items()):
        moves = topic.type in MOVING or topic.type.startswith(MOVING_PACKAGES)
        publishes = node in names_of(topic.publishers)
        if moves and publishes:
            return f"publishes {name} ({topic.type}), so two of it would both move the robot"
        if moves and node in names_of(topic.subscribers):
            return f"obeys {name} ({topic.type}), and two of it would"
        agrees = any(word in node for word in AGREEING)
        if name.endswith("/tf") and publishes and not agrees:
            return f"publishes {name}, where two of it would contradict each other"
    return ""
