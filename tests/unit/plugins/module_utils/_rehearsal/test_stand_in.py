# SPDX-License-Identifier: GPL-3.0-or-later
"""What the stand-in tells rospy to do; on ROS itself it is run in tests/ros."""

from __future__ import annotations

import time
from types import SimpleNamespace
from typing import Any

import pytest
from ansible_collections.rosops.fleet.plugins.module_utils._rehearsal import stand_in


class Rospy:
    """Writes down what is asked of it; it is shut down once enough was sent."""

    AnyMsg = type("AnyMsg", (), {"_buff": None})
    ServiceException = type("ServiceException", (Exception,), {})

    def __init__(self, most: int) -> None:
        self.most = most
        self.node = ""
        self.heard: dict[str, Any] = {}
        self.served: dict[str, Any] = {}
        self.sent: dict[str, list[Any]] = {}
        self.kinds: dict[str, Any] = {}

    def init_node(self, name: str) -> None:
        self.node = name

    def is_shutdown(self) -> bool:
        return sum(map(len, self.sent.values())) >= self.most

    def spin(self) -> None:
        while not self.is_shutdown():
            time.sleep(0.001)

    def Subscriber(self, topic: str, kind: Any) -> None:  # noqa: N802 - rospy's
        self.heard[topic] = kind

    def Service(self, name: str, kind: Any, handler: Any) -> None:  # noqa: N802
        self.served[name] = (kind, handler)

    def Publisher(self, topic: str, kind: Any, queue_size: int, latch: bool) -> Any:  # noqa: N802
        self.kinds[topic] = (kind, queue_size, latch)
        return SimpleNamespace(publish=self.sent.setdefault(topic, []).append)


def generate(name: str, definition: str) -> dict[str, Any]:
    return {name: type("Thing", (), {"made_of": definition}), "demo/Part": None}


TOPIC = {"type": "demo/Thing", "definition": "uint32 a"}
PLAN = {
    "name": "/arm/driver",
    "publishes": [
        {**TOPIC, "name": "/map", "latched": True, "rate": 0.0},
        {**TOPIC, "name": "/silent", "latched": False, "rate": 0.0},
        {**TOPIC, "name": "/state", "latched": False, "rate": 500.0},
    ],
    "subscribes": [{"name": "/odd", "type": "", "md5sum": ""}, {"name": "/odom", "type": "demo/Odom", "md5sum": "cc"}],
    "services": [{"name": "/arm/home", "type": "demo/Home", "md5sum": "bb"}],
}


def test_a_node() -> None:
    rospy = Rospy(5)
    stand_in.Node(rospy, generate, PLAN).play()
    assert rospy.node == "driver"
    assert {name: (kind._type, kind._md5sum) for name, kind in rospy.heard.items()} == {
        "/odd": ("*", "*"),
        "/odom": ("demo/Odom", "cc"),
    }
    assert {topic: len(sent) for topic, sent in rospy.sent.items()} == {"/map": 1, "/silent": 0, "/state": 4}
    kind, _queue, latch = rospy.kinds["/map"]
    assert (kind.made_of, latch, rospy.kinds["/state"][2]) == ("uint32 a", True, False)
    kind, handler = rospy.served["/arm/home"]
    assert (kind._type, kind._md5sum, kind._request_class._md5sum) == ("demo/Home", "bb", "bb")
    with pytest.raises(rospy.ServiceException, match="no answer"):
        handler(None)
