# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Nodes for test_live_graph.py, each a process of its own with ROS's Python: `graph_nodes.py KIND NAME`."""

from __future__ import annotations

import faulthandler
import signal
import sys
import time

import rospy
from std_msgs.msg import Float32, Float64MultiArray, Header, Int32, MultiArrayDimension, MultiArrayLayout, String
from std_srvs.srv import Trigger


def talker(hertz: float) -> None:
    out = rospy.Publisher("/chatter", String, queue_size=1000)
    own = rospy.Publisher("~debug", Int32, queue_size=1000)
    latched = rospy.Publisher("/config", String, queue_size=1, latch=True)
    latched.publish("once")
    rospy.Service("/trigger", Trigger, lambda _: (True, "done"))
    began, number = time.monotonic(), 0
    while not rospy.is_shutdown():
        out.publish("hello")
        own.publish(number)
        number += 1
        time.sleep(max(0.0, began + number / hertz - time.monotonic()))


def robot(speed: float) -> None:
    """Its battery, latched, and its speed, in a message with others in it; and a header, which changes all the time."""
    battery = rospy.Publisher("/battery", Float32, queue_size=1, latch=True)
    battery.publish(0.75)
    out = rospy.Publisher("/speed", Float64MultiArray, queue_size=10)
    head = rospy.Publisher("/alive", Header, queue_size=10)
    dimension = MultiArrayDimension(label="m/s", size=2, stride=2)
    while not rospy.is_shutdown():
        out.publish(MultiArrayLayout(dim=[dimension]), [0.0, speed])
        head.publish(Header(stamp=rospy.Time.now(), frame_id="base"))
        time.sleep(0.05)


class Woken(rospy.SubscribeListener):
    """Says so on a topic of its own when somebody subscribes, as a camera begins to encode then."""

    def __init__(self) -> None:
        self.told = rospy.Publisher("/woken", String, queue_size=1, latch=True)

    def peer_subscribe(self, _topic: str, _publish: object, _peer_publish: object) -> None:
        self.told.publish("by somebody")


def camera() -> None:
    """A lazy publisher beside one that somebody listens to."""
    rospy.Publisher("/image/compressed", String, subscriber_listener=Woken(), queue_size=1)
    talker(20.0)


def server() -> None:
    import actionlib  # noqa: PLC0415 - only this node needs it
    from actionlib.msg import TestAction  # noqa: PLC0415

    actionlib.SimpleActionServer("/work", TestAction, lambda _: None, auto_start=False).start()


def caller(persistent: bool) -> None:
    """Calls all the time, over one connection or over a new one each time."""
    rospy.wait_for_service("/trigger")
    proxy = rospy.ServiceProxy("/trigger", Trigger, persistent=persistent)
    while not rospy.is_shutdown():
        proxy()
        time.sleep(0.01)


def main() -> None:
    kind, name = sys.argv[1:3]
    faulthandler.register(signal.SIGUSR2)  # a test that failed asks where the threads are
    rospy.init_node(name, disable_signals=False)
    if kind == "talker":
        talker(float(sys.argv[3]))
    elif kind == "listener":
        rospy.Subscriber("/chatter", String, lambda _: None)
    elif kind == "camera":
        camera()
    elif kind == "robot":
        robot(float(sys.argv[3]))
    elif kind == "server":
        server()
    else:
        caller(kind == "persistent")
    rospy.spin()


if __name__ == "__main__":
    main()
