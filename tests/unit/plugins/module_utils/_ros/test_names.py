# SPDX-License-Identifier: GPL-3.0-or-later
"""Names as the master shows them."""

from __future__ import annotations

import pytest
from ansible_collections.rosops.fleet.plugins.module_utils._pod import launch
from ansible_collections.rosops.fleet.plugins.module_utils._ros.names import (
    REVISION,
    TEMPLATE,
    by_pod,
    by_revision,
    is_meant,
    is_tool,
    is_version,
    renamed,
    resolve,
    stem,
)


@pytest.mark.parametrize(
    ("name", "namespace", "expected"),
    [
        ("/chatter", "/", "/chatter"),
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
        ("/ros_keeper", True),
        ("/ns/rqt_graph", True),
        ("/temperature_1a2b3c4d", False),
        ("/temperature_1a2b3c4d_4567894567", False),
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


@pytest.mark.parametrize(
    ("name", "revision", "plain"),
    [
        ("/camera_1a2b3c4d_79d9c6f8b5", "/camera_1a2b3c4d", "/camera"),
        ("/front/camera_1a2b3c4d_b", "/front/camera_1a2b3c4d", "/front/camera"),
        ("/camera_1a2b3c4d_45678945", "/camera_1a2b3c4d", "/camera"),  # which might be a revision
        ("/camera_12345678_1a2b3c4d_45678945", "/camera_12345678_1a2b3c4d", "/camera_12345678"),
        ("/camera_1a2b3c4d", "/camera_1a2b3c4d", "/camera"),  # of a collection up to 1.0
        ("/camera_1a2b3c4d_left", "/camera_1a2b3c4d_left", "/camera_1a2b3c4d_left"),
        ("/camera_1a2b3c4d_79d9c6f8b5b", "/camera_1a2b3c4d_79d9c6f8b5b", "/camera_1a2b3c4d_79d9c6f8b5b"),
        ("/robot_1a2b3c4d/camera_1a2b3c4d_4", "/robot_1a2b3c4d/camera_1a2b3c4d", "/robot_1a2b3c4d/camera"),
        ("/camera_5", "/camera_5", "/camera_5"),
        ("/79d9c6f8b5", "/79d9c6f8b5", "/79d9c6f8b5"),
    ],
)
def test_what_a_node_is_called_by_its_revision_and_in_all_versions(name: str, revision: str, plain: str) -> None:
    assert (by_revision(name), stem(name)) == (revision, plain)
    assert by_revision(f"{name}/image") == f"{revision}/image"
    assert is_version(name, plain) and not is_version(name, plain[:-1])
    assert is_meant(name, [revision]) and is_meant(name, [name]) and is_meant(name, [plain]) == (plain == revision)


def test_the_launcher_which_stands_alone_knows_the_same_names() -> None:
    assert launch.SUFFIX.pattern == f"{REVISION}(?:{TEMPLATE})?" + r"(?=/|\Z)"


def test_the_nodes_of_a_revision_are_those_of_its_pods() -> None:
    there = ["/a_1a2b3c4d_4", "/a_1a2b3c4d_5", "/a_99999999_4", "/a_99999999", "/b"]
    assert by_pod(there) == {"/a_1a2b3c4d": there[:2], "/a_99999999": there[2:3]}
