# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""What the nodes of a launch file are called in the next version."""

from __future__ import annotations

from typing import Any

import pytest
from ansible_collections.rosops.fleet.plugins.module_utils._step.objects import revision_of
from ansible_collections.rosops.fleet.plugins.plugin_utils._objects.app import app_deployment
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.nodes import (
    Launched,
    Succession,
    launched,
    succession,
)
from ansible_collections.rosops.fleet.tests.unit.plugins.plugin_utils._update.update_objects import app
from ansible_collections.rosops.fleet.tests.unit.robots import robot

OVERLAP = Launched("_11111111", "_22222222")
THERE = [
    "/map", "/manager_11111111/load_nodelet", "/manager_11111111/bond", "/manager_11111111/list",
    "/camera_11111111/get_loggers", "/camera_11111111/late", "/camera/image",
]  # fmt: skip


def deployment(**more: Any) -> Any:
    made = robot(app("base", **more))
    return app_deployment(made.apps[0], made)


def test_each_node_gets_the_next_revision() -> None:
    found = succession(OVERLAP, ["/camera_11111111", "/arm/joint_11111111", "/manager_11111111"], THERE)
    assert found.nodes == {
        "/camera_11111111": "/camera_22222222",
        "/arm/joint_11111111": "/arm/joint_22222222",
        "/manager_11111111": "/manager_22222222",
    }


def test_private_names_stay_but_for_those_of_a_manager() -> None:
    found = succession(OVERLAP, ["/camera_11111111", "/manager_11111111"], THERE)
    assert found.names == {
        "/manager_11111111/load_nodelet": "/manager_22222222/load_nodelet",
        "/manager_11111111/bond": "/manager_22222222/bond",
        "/manager_11111111/list": "/manager_22222222/list",
        "/camera_11111111/get_loggers": "/camera_22222222/get_loggers",
        "/camera_11111111/late": "/camera/late",  # the next version knows of it
    }


@pytest.mark.parametrize(
    ("old", "new", "before", "after", "private"),
    [
        ("", "_2222222f", "/camera", "/camera_2222222f", "/camera/image"),
        ("_11111111", "", "/camera_11111111", "/camera", "/camera/image"),
        ("", "", "/camera", "/camera", "/camera/image"),
    ],
)
def test_from_one_handoff_to_another(old: str, new: str, before: str, after: str, private: str) -> None:
    found = succession(Launched(old, new), [before], [f"{before}/image"])
    assert found == Succession({before: after}, {f"{before}/image": private})


def test_what_is_held_and_what_may_overlap_is_said_as_the_launch_file_calls_it() -> None:
    app_ = Launched("_11111111", "_22222222", held=("lidar", "/arm/joint"), overlap=("odom",))
    assert [app_.is_held(node) for node in ("/front/lidar_11111111", "/arm/joint_11111111", "/joint_11111111")] == [
        True, True, False,
    ]  # fmt: skip
    assert app_.may_overlap("/odom_11111111") and not app_.may_overlap("/odometry_11111111")


def test_the_words_of_the_deployment_say_it() -> None:
    launch = {"package": "base", "file": "base.launch", "replace": ["lidar"], "overlap": ["odom"]}
    before, after = deployment(launch=launch, pattern=None), deployment(image="x.org/a:2", launch=launch)
    (spec,) = robot(app("base", launch=launch)).apps
    assert launched(before, after, spec) == Launched("", f"_{revision_of(after)}", ("lidar",), ("odom",))
    assert launched(after, before, spec) == Launched(f"_{revision_of(after)}", "", (), ("odom",))
    assert launched(before, deployment(), spec) is None  # a node of the app's own name


def test_successions_of_several_apps_are_one() -> None:
    both = Succession({"/a": "/b"}) | Succession({"/c": "/d"}, {"/c/x": "/d/x"})
    assert both.renames == {"/a": "/b", "/c": "/d", "/c/x": "/d/x"}
