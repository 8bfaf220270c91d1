# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""What an update is meant to change, from an app's specification to the words of check mode."""

from __future__ import annotations

from typing import Any

import pytest
from ansible_collections.rosops.fleet.plugins.module_utils._ros.graph import Graph
from ansible_collections.rosops.fleet.plugins.module_utils._ros.graph_json import graph_from
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.intended import allowed, intended, on_demand
from ansible_collections.rosops.fleet.tests.unit.robots import robot

OLD = "/camera_0a1b2c3d"


def app(**changes: Any) -> dict[str, Any]:
    return {"name": "camera", "image": "example.org/a:1", "args": ["x"], "pattern": "pubsub", **changes}


def found(*apps: dict[str, Any], back: bool = False, master: Any = None) -> Any:
    made = robot(*apps, name="r1", master=master)
    return intended(made.apps, made, {"camera": OLD}, back)


def test_names_are_those_of_the_graph() -> None:
    update = {"ignore": ["debug/*", "~own", "~kept", "/x"], "renamed": {"~a": "b"}, "rates": {"scan": 10}}
    said = found(app(update=update, private_names=["kept"]))
    assert said.ignore == ("/debug/*", f"{OLD}/own", "/camera/kept", "/x")
    assert (said.renamed, said.rates, said.on_demand) == ({f"{OLD}/a": "/b"}, {"/scan": 10.0}, ())
    shared = found(app(update=update), master={"mode": "shared"})
    assert (shared.ignore[0], shared.rates) == ("/r1/debug/*", {"/r1/scan": 10.0})


def test_a_step_is_one_change_and_a_way_back_renames_the_other_way_round() -> None:
    apps = [
        app(update={"renamed": {"/a": "/b"}}),
        app(name="other", update={"ignore": ["~x"], "renamed": {"/c": "/d"}}),
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
    one = app(command=words[:1], args=words[1:])
    assert on_demand(robot(one).apps[0]) is expected
    assert found(one).on_demand == ((OLD,) if expected else ())


def graph() -> Graph:
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
    assert allowed(graph(), [OLD], found(app(update=update))) == [
        "/debug/a may be missing or of another type",
        "/debug/reset may be missing or of another type",
        "/dock may be missing or of another type",
        "/scan has to be /front/scan then",
        "/map may carry any rate",
        "/scan may carry 10 Hz or more (now 40 Hz)",
        f"what {OLD} latched on /map is given to later subscribers by the keeper until the next version says something",
    ]
    for unkept in (found(app(hooks="none")), found(app(), master={"mode": "external", "uri": "http://m:1"})):
        assert allowed(graph(), [OLD], unkept) == [f"what {OLD} latched on /map goes with it"]
    assert allowed(graph(), ["/other"], found(app(update=update))) == []
    bridge = found(app(args=["rosbridge_websocket"]))
    assert allowed(graph(), [OLD], bridge)[0] == (f"{OLD} may have other topics and services: its clients ask for them")
