# SPDX-License-Identifier: GPL-3.0-or-later
"""What the stand-in tells rospy to do; on ROS itself it is run in tests/ros."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any
from unittest.mock import Mock

import pytest
from ansible_collections.rosops.fleet.plugins.module_utils._rehearsal import stand_in
from ansible_collections.rosops.fleet.tests.unit.plugins.fake_ros import until


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
    sent: dict[str, list[Any]] = {}

    def advertised(topic: str, _kind: Any, **_more: Any) -> Any:
        return SimpleNamespace(publish=sent.setdefault(topic, []).append)

    error = type("ServiceException", (Exception,), {})
    rospy = Mock(AnyMsg=type("AnyMsg", (), {"_buff": None}), ServiceException=error)
    rospy.is_shutdown.side_effect = lambda: sum(map(len, sent.values())) >= 5  # once enough was sent
    rospy.spin.side_effect = lambda: until(rospy.is_shutdown)
    rospy.Publisher.side_effect = advertised
    stand_in.Node(rospy, generate, PLAN).play()
    rospy.init_node.assert_called_once_with("driver")
    heard = dict(call.args for call in rospy.Subscriber.call_args_list)
    assert {name: (kind._type, kind._md5sum) for name, kind in heard.items()} == {
        "/odd": ("*", "*"),
        "/odom": ("demo/Odom", "cc"),
    }
    assert {topic: len(sent) for topic, sent in sent.items()} == {"/map": 1, "/silent": 0, "/state": 4}
    published = {call.args[0]: (call.args[1].made_of, call.kwargs["latch"]) for call in rospy.Publisher.call_args_list}
    assert (published["/map"], published["/state"]) == (("uint32 a", True), ("uint32 a", False))
    [(name, kind, handler)] = [call.args for call in rospy.Service.call_args_list]
    assert (name, kind._type, kind._md5sum, kind._request_class._md5sum) == ("/arm/home", "demo/Home", "bb", "bb")
    with pytest.raises(error, match="no answer"):
        handler(None)
