# SPDX-License-Identifier: GPL-3.0-or-later
"""ROS nodes for the tests, run by the Python that has rospy: `nodes.py KIND NAME LOG [ARGUMENTS]`.

Each writes what it saw as lines of JSON, so that a test counts from what the nodes say and not from what it hopes.
"""

from __future__ import annotations

import faulthandler
import json
import signal
import sys
import threading
import time
from collections.abc import Callable
from typing import Any

import actionlib
import rospy
from actionlib.msg import TestAction, TestGoal, TestResult
from actionlib_msgs.msg import GoalStatusArray  # begins with a header, as sensors' messages do
from genpy.message import get_message_class
from rospy.impl.registration import RegManager
from std_msgs.msg import (
    Float32,
    Float64MultiArray,
    Header,
    Int32,
    MultiArrayDimension,
    MultiArrayLayout,
    String,
    UInt64,
)
from std_srvs.srv import Trigger

HZ = 500
_lock = threading.Lock()


class Log:
    def __init__(self, path: str) -> None:
        self.file = open(path, "a", encoding="utf-8", buffering=1)  # noqa: PTH123, SIM115 - lives as long as the node

    def __call__(self, **entry: Any) -> None:
        with _lock:
            self.file.write(json.dumps({"at": time.time(), **entry}) + "\n")


def talker(log: Log, topic: str = "/numbers") -> None:
    out = rospy.Publisher(topic, UInt64, queue_size=1000)
    log(up=True)
    rate, number = rospy.Rate(HZ), 0
    while not rospy.is_shutdown():
        out.publish(number)
        number += 1
        rate.sleep()


def listener(log: Log, topic: str = "/numbers") -> None:
    seen = {"count": 0}

    def got(_message: Any) -> None:
        seen["count"] += 1

    rospy.Subscriber(topic, UInt64, got, queue_size=1000)
    while not rospy.is_shutdown():
        time.sleep(0.1)
        log(**seen)


def unlucky(log: Log) -> None:
    """A listener that is slow between the master's answer to its registration and the use of that answer.

    Meanwhile rospy's own thread waits for the lock that the registration holds, so it finds two lists when it goes on.
    """
    update = RegManager.publisher_update

    def late(self: RegManager, topic: str, uris: list[str]) -> None:
        if threading.current_thread() is threading.main_thread():
            time.sleep(0.6)  # that thread looks every half second
            log(registered=topic)
            while not self.updates:  # until a publisher has come
                time.sleep(0.01)
        update(self, topic, uris)

    RegManager.publisher_update = late
    listener(log)


def dock(log: Log, topic: str = "/dock", value: str = "") -> None:
    """Latches its value when it is told to, with SIGUSR1; at its start, as most nodes do, nothing."""
    out = rospy.Publisher(topic, String, queue_size=1, latch=True)
    signal.signal(signal.SIGUSR1, lambda _received, _frame: out.publish(value))
    log(up=True)
    rospy.spin()


def docked(log: Log, topic: str = "/dock") -> None:
    """What it hears, and from whom."""

    def got(message: Any) -> None:
        log(heard=message.data, by=message._connection_header["callerid"])

    rospy.Subscriber(topic, String, got)
    log(up=True)
    rospy.spin()


def looker(log: Log, topic: str = "/dock") -> None:
    """Subscribes anew for each message, again and again."""
    while not rospy.is_shutdown():
        log(heard=rospy.wait_for_message(topic, String).data)


def service(log: Log, name: str = "/trigger", seconds: str = "0") -> None:
    def serve(_request: Any) -> Any:
        log(asked=True)
        end = time.monotonic() + float(seconds)
        while time.monotonic() < end and not rospy.is_shutdown():
            time.sleep(0.01)
        return True, ""

    rospy.Service(name, Trigger, serve)
    log(up=True)
    rospy.spin()


def caller(log: Log, name: str = "/trigger", persistent: str = "") -> None:
    kept = rospy.ServiceProxy(name, Trigger, persistent=True) if persistent else None
    while not rospy.is_shutdown():
        try:
            log(ok=(kept or rospy.ServiceProxy(name, Trigger))().success)
            if kept:
                rospy.spin()  # it stays connected and asks nothing more
        except (rospy.ServiceException, rospy.ROSException, OSError) as error:
            log(ok=False, error=str(error))
        time.sleep(0.05)


def executed(log: Log, goal: int, is_over: Callable[[], bool]) -> bool:
    """As many milliseconds as the goal says in its lowest five digits; whether it came to its end."""
    log(start=goal)
    end = time.monotonic() + goal % 100000 / 1000
    while time.monotonic() < end:
        if is_over():
            log(broken=goal)
            return False
        time.sleep(0.002)
    return True


def server(log: Log, action: str = "/work") -> None:
    def execute(goal: Any) -> None:
        good = executed(log, goal.goal, lambda: rospy.is_shutdown() or acting.is_preempt_requested())
        (acting.set_succeeded if good else acting.set_preempted)(TestResult(goal.goal))

    acting = actionlib.SimpleActionServer(action, TestAction, execute, auto_start=False)
    acting.start()
    log(up=True)
    rospy.spin()


def pool(log: Log, action: str = "/work") -> None:
    """As `server`, but it executes the goals of several clients at the same time."""

    def execute(handle: Any) -> None:
        goal = handle.get_goal().goal
        if executed(log, goal, rospy.is_shutdown):
            handle.set_succeeded(TestResult(goal))

    def accept(handle: Any) -> None:
        handle.set_accepted()
        threading.Thread(target=execute, args=(handle,)).start()

    actionlib.ActionServer(action, TestAction, accept, auto_start=False).start()
    log(up=True)
    rospy.spin()


def acting_client(log: Log, action: str) -> tuple[Any, list[int]]:
    """A client, and what it was told by SIGUSR1."""
    acting = actionlib.SimpleActionClient(action, TestAction)
    acting.wait_for_server()
    log(up=True)
    told: list[int] = []  # no Event: one that is told in the middle of its own wait() waits for itself
    signal.signal(signal.SIGUSR1, lambda received, _frame: told.append(received))
    return acting, told


def client(log: Log, action: str = "/work", first: str = "1", milliseconds: str = "20") -> None:
    """Numbered goals, each waited for, until told to stop."""
    acting, told = acting_client(log, action)
    number = int(first)
    while not told and not rospy.is_shutdown():
        acting.send_goal(TestGoal(number * 100000 + int(milliseconds)))
        done = acting.wait_for_result(rospy.Duration(60))
        log(goal=number, done=done, state=acting.get_state())
        number += 1
    log(ended=True)


def canceller(log: Log, action: str = "/work") -> None:
    """One goal, cancelled half a second later."""
    acting, told = acting_client(log, action)
    while not told:
        time.sleep(0.05)
    acting.send_goal(TestGoal(77700500))
    time.sleep(0.5)
    acting.cancel_goal()
    done = acting.wait_for_result(rospy.Duration(60))
    log(goal=777, done=done, state=acting.get_state())


def hearer(log: Log, topic: str, kind: str = "std_msgs/String") -> None:
    rospy.Subscriber(topic, get_message_class(kind), lambda _message: None)
    log(up=True)
    rospy.spin()


# ---- for the exporter


def counted(log: Log, topic: str = "/fast", hertz: str = "500") -> None:
    """Publishes on a grid of time, and writes down how many it has published: what the exporter is measured by."""
    out = rospy.Publisher(topic, UInt64, queue_size=1000)
    count, period, began = 0, 1 / float(hertz), time.monotonic()

    def write() -> None:
        while not rospy.is_shutdown():
            log(count=count)
            time.sleep(0.02)

    threading.Thread(target=write, daemon=True).start()
    while not rospy.is_shutdown():
        out.publish(count)
        count += 1
        time.sleep(max(0.0, began + count * period - time.monotonic()))


def points(_log: Log) -> None:
    """A hundred a second, with numbers that rospy counts up."""
    out = rospy.Publisher("/points", GoalStatusArray, queue_size=1000)
    while not rospy.is_shutdown():
        out.publish(GoalStatusArray())
        time.sleep(0.01)


# ---- for graphs


def chatter(_log: Log, hertz: str) -> None:
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
        time.sleep(max(0.0, began + number / float(hertz) - time.monotonic()))


def robot(_log: Log, speed: str) -> None:
    """Its battery, latched, and its speed, in a message with others in it; and a header, which changes all the time."""
    battery = rospy.Publisher("/battery", Float32, queue_size=1, latch=True)
    battery.publish(0.75)
    out = rospy.Publisher("/speed", Float64MultiArray, queue_size=10)
    head = rospy.Publisher("/alive", Header, queue_size=10)
    dimension = MultiArrayDimension(label="m/s", size=2, stride=2)
    while not rospy.is_shutdown():
        out.publish(MultiArrayLayout(dim=[dimension]), [0.0, float(speed)])
        head.publish(Header(stamp=rospy.Time.now(), frame_id="base"))
        time.sleep(0.05)


class Woken(rospy.SubscribeListener):
    """Says so on a topic of its own when somebody subscribes, as a camera begins to encode then."""

    def __init__(self) -> None:
        self.told = rospy.Publisher("/woken", String, queue_size=1, latch=True)

    def peer_subscribe(self, _topic: str, _publish: object, _peer_publish: object) -> None:
        self.told.publish("by somebody")


def camera(log: Log) -> None:
    """A lazy publisher beside one that somebody listens to."""
    rospy.Publisher("/image/compressed", String, subscriber_listener=Woken(), queue_size=1)
    chatter(log, "20")


if __name__ == "__main__":
    kind, name, path, *words = sys.argv[1:]
    faulthandler.register(signal.SIGUSR2)  # a test that failed asks where the threads are
    # no /rosout: the master under test has nobody who listens to it
    rospy.init_node(name, disable_rosout=True, disable_signals=kind in ("client", "canceller"))
    globals()[kind](Log(path), *words)  # one of the functions above
