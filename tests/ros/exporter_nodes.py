# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Nodes for the exporter's tests, run by the Python that has rospy: `exporter_nodes.py KIND NAME LOG [ARGUMENTS]`."""

from __future__ import annotations

import faulthandler
import json
import signal
import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path

import rospy
from rosgraph_msgs.msg import Log as Stamped
from std_msgs.msg import UInt64

NEAR_OVERFLOW = 2**31 - 10_000


def counted(path: str, topic: str = "/fast", hertz: str = "500") -> None:
    """Publishes on a grid of time, and writes down how many it has published: what the exporter is measured by."""
    out = rospy.Publisher(topic, UInt64, queue_size=1000)
    count, period, began = 0, 1 / float(hertz), time.monotonic()

    def write() -> None:
        with open(path, "a", encoding="utf-8", buffering=1) as file:  # noqa: PTH123
            while not rospy.is_shutdown():
                file.write(json.dumps({"at": time.time(), "count": count}) + "\n")
                time.sleep(0.02)

    threading.Thread(target=write, daemon=True).start()
    while not rospy.is_shutdown():
        out.publish(count)
        count += 1
        time.sleep(max(0.0, began + count * period - time.monotonic()))


def loud(path: str, topic: str = "/loud") -> None:
    """Its first connection has carried nearly two gigabytes: soon rospy cannot say how many."""
    out = rospy.Publisher(topic, UInt64, queue_size=10)
    Path(path).write_text(json.dumps({"up": True}) + "\n")
    while not rospy.is_shutdown():
        for queued in out.impl.connections:
            connection = queued._connection
            connection.stat_bytes = max(connection.stat_bytes, NEAR_OVERFLOW)
        out.publish(1)
        time.sleep(0.01)


def stamped(_path: str, topic: str = "/stamped") -> None:
    out = rospy.Publisher(topic, Stamped, queue_size=10)
    while not rospy.is_shutdown():
        message = Stamped()
        message.header.stamp = rospy.Time.from_sec(time.time() - 0.25)
        out.publish(message)
        time.sleep(0.02)


def hearer(_path: str, topic: str = "/stamped") -> None:
    rospy.Subscriber(topic, Stamped, lambda _: None)
    rospy.spin()


KINDS: dict[str, Callable[..., None]] = {function.__name__: function for function in (counted, loud, stamped, hearer)}

if __name__ == "__main__":
    kind, name, path, *words = sys.argv[1:]
    faulthandler.register(signal.SIGUSR2)  # a test that failed asks where the threads are
    rospy.init_node(name, disable_rosout=True)
    KINDS[kind](path, *words)
