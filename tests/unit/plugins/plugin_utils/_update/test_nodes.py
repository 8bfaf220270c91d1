# SPDX-License-Identifier: GPL-3.0-or-later
"""Apps on the graph: their nodes and the next version's, what that may change, and what two of a node would undo."""

from __future__ import annotations

from typing import Any

import pytest
from ansible_collections.rosops.fleet.plugins.module_utils._ros.graph import Graph
from ansible_collections.rosops.fleet.plugins.module_utils._ros.graph_json import graph_from
from ansible_collections.rosops.fleet.plugins.module_utils._step.objects import revision_of
from ansible_collections.rosops.fleet.plugins.plugin_utils._objects.app import app_deployment
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.nodes import (
    Launched,
    Succession,
    allowed,
    intended,
    launched,
    obstacle,
    succession,
)
from ansible_collections.rosops.fleet.tests.unit.robots import robot
from ansible_collections.rosops.fleet.tests.unit.simulated.objects import app

OVERLAP = Launched("_11111111", "_22222222")
THERE = [
    "/map", "/manager_11111111/load_nodelet", "/manager_11111111/bond", "/manager_11111111/list",
    "/camera_11111111/get_loggers", "/camera_11111111/late", "/camera/image",
]  # fmt: skip


def deployment(**more: Any) -> Any:
    made = robot(app("base", **more))
    return app_deployment(made.apps[0], made)


def test_private_names_stay_but_for_those_of_a_manager() -> None:
    found = succession(OVERLAP, ["/camera_11111111", "/arm/joint_11111111", "/manager_11111111"], THERE)
    assert found.nodes["/arm/joint_11111111"] == "/arm/joint_22222222"
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


# --- what the next version is meant to change -------------------------------------------------------------------------

OLD = "/camera_0a1b2c3d"


def camera(**changes: Any) -> dict[str, Any]:
    return {"name": "camera", "image": "example.org/a:1", "args": ["x"], "pattern": "pubsub", **changes}


def found(*apps: dict[str, Any], back: bool = False, master: Any = None) -> Any:
    made = robot(*apps, name="r1", master=master)
    return intended(made.apps, made, {"camera": OLD}, back)


def test_names_are_those_of_the_graph() -> None:
    update = {"ignore": ["debug/*", "~own", "~kept", "/x"], "renamed": {"~a": "b"}, "rates": {"scan": 10}}
    said = found(camera(update=update, private_names=["kept"]))
    assert said.ignore == ("/debug/*", f"{OLD}/own", "/camera/kept", "/x")
    assert (said.renamed, said.rates, said.on_demand) == ({f"{OLD}/a": "/b"}, {"/scan": 10.0}, ())
    shared = found(camera(update=update), master={"mode": "shared"})
    assert (shared.ignore[0], shared.rates) == ("/r1/debug/*", {"/r1/scan": 10.0})


def test_a_step_is_one_change_and_a_way_back_renames_the_other_way_round() -> None:
    apps = [
        camera(update={"renamed": {"/a": "/b"}}),
        camera(name="other", update={"ignore": ["~x"], "renamed": {"/c": "/d"}}),
    ]
    assert found(*apps).renamed == {"/a": "/b", "/c": "/d"}
    assert found(*apps).ignore == ("/other/x",)  # of an app that is new
    assert found(*apps, back=True).renamed == {"/b": "/a", "/d": "/c"}


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        (["rosrun", "rosbridge_server", "rosbridge_websocket"], True),
        (["sh", "-c", 'exec rosrun web_video_server web_video_server "$@"'], True),
        (["/opt/ros/noetic/lib/foxglove_bridge/foxglove_bridge"], True),
        (["rosrun", "my_rosbridge_server_test", "node"], False),
        (["rosbag", "record", "-a"], False),
    ],
)
def test_programs_that_do_what_their_clients_ask(words: list[str], expected: bool) -> None:
    one = camera(command=words[:1], args=words[1:])
    assert robot(one).apps[0].on_demand is expected
    assert found(one).on_demand == ((OLD,) if expected else ())


def seen() -> Graph:
    def topic(**more: Any) -> dict[str, Any]:
        return {"publishers": [OLD], "subscribers": ["/peer"], **more}

    found = {
        "topics": {
            "/scan": topic(rates={OLD: 40.0}), "/debug/a": topic(), "/map": topic(latched=[OLD]),
            "/debug/foreign": {"publishers": ["/peer"], "subscribers": []},
            "/gain/parameter_updates": topic(latched=[OLD]),
        },
        "services": {"/debug/reset": {"provider": OLD, "providers": [OLD]}},
        "actions": {"/dock": {"servers": [OLD]}},
    }  # fmt: skip
    return graph_from(found)


def test_what_a_step_would_allow_is_told_of_what_there_is() -> None:
    update = {
        "ignore": ["/debug/*", "/dock", "/gone"], "renamed": {"/scan": "/front/scan", "/old": "/new"},
        "rates": {"/front/scan": 10, "/map": 0},
    }  # fmt: skip
    assert allowed(seen(), [OLD], found(camera(update=update))) == [
        "/debug/a may be missing or of another type",
        "/debug/reset may be missing or of another type",
        "/dock may be missing or of another type",
        "/scan has to be /front/scan then",
        "/map may carry any rate",
        "/scan may carry 10 Hz or more (now 40 Hz)",
        f"what {OLD} latched on /map is given to later subscribers by the keeper until the next version says something",
    ]
    for unkept in (found(camera(hooks="none")), found(camera(), master={"mode": "external", "uri": "http://m:1"})):
        assert allowed(seen(), [OLD], unkept) == [f"what {OLD} latched on /map goes with it"]
    assert allowed(seen(), ["/other"], found(camera(update=update))) == []
    bridge = found(camera(args=["rosbridge_websocket"]))
    assert allowed(seen(), [OLD], bridge)[0] == (f"{OLD} may have other topics and services: its clients ask for them")


# --- what two of a node would undo ------------------------------------------------------------------------------------

NODE = "/base_11111111"


def graph(topic: str = "/scan", type_: str = "sensor_msgs/LaserScan", **more: Any) -> Graph:
    return graph_from({"actions": more.pop("actions", {}), "topics": {topic: {"type": type_, **more}}})


@pytest.mark.parametrize(
    ("found", "words"),
    [
        (graph(publishers=[NODE]), ""),
        (graph(subscribers=[NODE]), ""),
        (graph("/cmd_vel", "geometry_msgs/Twist", publishers=[NODE]), "publishes /cmd_vel (geometry_msgs/Twist)"),
        (graph("/cmd_vel", "geometry_msgs/Twist", subscribers=[NODE]), "obeys /cmd_vel"),
        (graph("/cmd_vel", "geometry_msgs/Twist", subscribers=["/other"]), ""),
        (graph("/pose", "geometry_msgs/PoseStamped", publishers=[NODE]), ""),
        (graph("/drive", "ackermann_msgs/AckermannDrive", publishers=[NODE]), "publishes /drive"),
        (graph("/tf", "tf2_msgs/TFMessage", publishers=[NODE]), "publishes /tf, where two of it would contradict"),
        (graph("/robot1/tf", "tf2_msgs/TFMessage", publishers=[NODE]), "publishes /robot1/tf"),
        (graph("/tf_static", "tf2_msgs/TFMessage", publishers=[NODE]), ""),
        (graph("/tf", "tf2_msgs/TFMessage", subscribers=[NODE]), ""),
        (graph(actions={"/dock": {"servers": [NODE]}}), "serves the action /dock"),
        (graph(actions={"/dock": {"servers": ["/other"]}}), ""),
    ],
)
def test_what_forbids_two_of_a_node(found: Graph, words: str) -> None:
    said = obstacle(found, NODE)
    assert said.startswith(words)
    assert bool(said) == bool(words)


@pytest.mark.parametrize("node", ["/robot_state_publisher_1a", "/static_transform_publisher"])
def test_two_that_say_the_same_do_no_harm(node: str) -> None:
    assert obstacle(graph("/tf", "tf2_msgs/TFMessage", publishers=[node]), node) == ""
