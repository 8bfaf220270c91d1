# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Nodes for test_traffic_on_ros.py, each a process with ROS's Python: `traffic_nodes.py KIND __name:=NAME`."""

from __future__ import annotations

import sys
import time

import rospy
from actionlib_msgs.msg import GoalStatusArray  # begins with a header, as sensors' messages do


def source(skip: int) -> None:
    """A hundred a second; of those numbers that rospy counts up it leaves some out, in one place."""
    out = rospy.Publisher("/points", GoalStatusArray, queue_size=1000)
    number = 0
    while not rospy.is_shutdown():
        out.publish(GoalStatusArray())
        number += 1
        if number == 200:
            out.impl.seq += skip
        time.sleep(0.01)


def sink() -> None:
    rospy.Subscriber("/points", GoalStatusArray, lambda _message: None)
    rospy.spin()


if __name__ == "__main__":
    rospy.init_node("node")
    {"source": lambda: source(0), "skipping": lambda: source(3), "sink": sink}[sys.argv[1]]()
