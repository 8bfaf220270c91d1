# SPDX-License-Identifier: GPL-3.0-or-later
"""Names as the master shows them."""

from __future__ import annotations

import pytest
from ansible_collections.rosops.fleet.plugins.module_utils._ros.names import is_tool, renamed, resolve


@pytest.mark.parametrize(
    ("name", "namespace", "expected"),
    [
        ("/chatter", "/", "/chatter"),
        ("chatter", "/", "/chatter"),
        ("chatter", "/robot1", "/robot1/chatter"),
        ("chatter", "/robot1/", "/robot1/chatter"),
        ("chatter", "robot1", "/robot1/chatter"),
        ("/chatter", "/robot1", "/chatter"),
        ("a/b", "/r/s", "/r/s/a/b"),
        ("~rate", "/robot1", "/robot1/sensor/rate"),
        ("~/rate", "/robot1", "/robot1/sensor/rate"),
    ],
)
def test_resolve(name: str, namespace: str, expected: str) -> None:
    assert resolve(name, namespace, "/robot1/sensor") == expected


@pytest.mark.parametrize(
    ("name", "tool"),
    [
        ("/rostopic_4711_1700000000000", True),
        ("/rviz_1700000000000000000", True),
        ("/rosops_fleet_123", True),
        ("/ros_keeper", True),
        ("/ns/rqt_graph", True),
        ("/temperature_1a2b3c4d", False),
        ("/temperature_12345678", False),
        ("/camera_1_2", False),
        ("/my_rqt", False),
    ],
)
def test_tools(name: str, tool: bool) -> None:
    assert is_tool(name) is tool


@pytest.mark.parametrize(
    ("name", "expected"),
    [("/old", "/new"), ("/old/a/b", "/new/a/b"), ("/oldx", "/oldx"), ("/x", "/x"), ("/x/old", "/x/old")],
)
def test_renamed(name: str, expected: str) -> None:
    assert renamed(name, {"/old": "/new"}) == expected
