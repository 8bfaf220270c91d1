# SPDX-License-Identifier: GPL-3.0-or-later
"""A recorded graph as parts for stand-ins: who plays what, what is left out, and what a damaged file says."""

from __future__ import annotations

import json
from typing import Any

import pytest
from ansible_collections.rosops.fleet.plugins.module_utils._common.errors import SpecError
from ansible_collections.rosops.fleet.plugins.plugin_utils._objects.app import app_objects
from ansible_collections.rosops.fleet.plugins.plugin_utils._rehearsal.recording import (
    KIND,
    OTHERS,
    PLAN,
    PROGRAM,
    cast,
    changed,
    parts,
)
from ansible_collections.rosops.fleet.plugins.plugin_utils._validate.fleet import check_fleet
from ansible_collections.rosops.fleet.tests.unit.plugins.plugin_utils._rehearsal.recordings import RECORDING
from ansible_collections.rosops.fleet.tests.unit.robots import robot

PARTS = parts(RECORDING, "it")
REAL = {"name": "temperature", "image": "x.example/temperature:1", "command": ["run"], "pattern": "pubsub"}
STAYS = {"name": "temperature-stats", "image": "x.example/stats:1", "command": ["run"], "volumes": [{"name": "logs"}]}
ITEMS: list[dict[str, Any]] = [REAL, STAYS]
DEFINITION = RECORDING["graph"]["topics"]["/temperature"]["definition"]


def test_nodes_are_their_apps_by_address_and_others_are_of_none() -> None:
    """Of apps with their host's address nobody knows which one it is."""
    assert {app: (part.placement, [node["name"] for node in part.nodes]) for app, part in PARTS.items()} == {
        "temperature": ("local", ["/temperature"]),
        "temperature-stats": ("remote", ["/arm/helper", "/temperature_stats"]),
        OTHERS: ("local", ["/loner"]),
    }


def test_what_a_node_plays_has_no_revision() -> None:
    topic = {"name": "/temperature", "type": "demo/Temperature", "definition": DEFINITION, "latched": False}
    service = {"name": "/temperature/reset", "type": "demo/Home", "md5sum": "home"}
    [played] = PARTS["temperature"].nodes
    assert (played["name"], played["publishes"]) == ("/temperature", [{**topic, "rate": 250.0}])
    assert (played["subscribes"], played["services"]) == ([], [service])


def test_what_is_latched_who_serves_and_how_often_an_action_tells() -> None:
    """Loggers and what does not answer are left out; a status that nobody listened to is sent all the same."""
    helper, stats = PARTS["temperature-stats"].nodes
    assert [(one["name"], one["latched"], one["rate"]) for one in helper["publishes"]] == [
        ("/map", True, 0.0),
        ("/work/status", True, 5.0),
    ]
    assert [one["name"] for one in helper["services"]] == ["/home"]
    assert stats["subscribes"] == [{"name": "/temperature", "type": "demo/Temperature", "md5sum": "temperature"}]


def test_nobody_sends_goals_of_zeros_or_what_nobody_has_defined() -> None:
    [loner] = PARTS[OTHERS].nodes
    assert {one["name"]: one["rate"] for one in loner["publishes"]} == {"/temperature": 250.0, "/work/goal": 0.0}
    assert loner["subscribes"] == [{"name": "/unknown", "type": "", "md5sum": ""}]


@pytest.mark.parametrize(
    ("data", "said"),
    [
        ([], "r.json is no recording of a robot's graph: rosops.fleet.record makes one"),
        ({"kind": "something"}, "r.json is no recording of a robot's graph"),
        ({**RECORDING, "version": 7}, "r.json is of version 7, not 1: record the robot again"),
        ({**RECORDING, "graph": {}}, r"r.json is damaged \(KeyError: 'nodes'\): record the robot again"),
        ({**RECORDING, "apps": ["x"]}, r"r.json is damaged \(TypeError: "),
        (
            {"kind": KIND, "version": 1, "apps": [], "graph": {**RECORDING["graph"], "nodes": []}},
            r"r.json is damaged \(AttributeError: ",
        ),
    ],
)
def test_another_file(data: Any, said: str) -> None:
    with pytest.raises(SpecError, match=said):
        parts(data, "r.json")


# ---- the cast


def test_the_changed_app_is_real_and_all_others_are_stand_ins() -> None:
    found = {item["name"]: item for item in cast(PARTS, ITEMS, ["temperature"], "ros:noetic")}
    assert set(found) == {"temperature", "temperature-stats", OTHERS}
    assert found["temperature"] == REAL
    stats = found["temperature-stats"]
    assert (stats["image"], stats["placement"], stats["handoff"]) == ("ros:noetic", "remote", "replace")
    assert "volumes" not in stats
    files = {one["path"]: one["content"] for one in stats["files"]}
    assert "class Node" in files[PROGRAM]
    assert [node["name"] for node in json.loads(files[PLAN])["nodes"]] == ["/arm/helper", "/temperature_stats"]
    assert stats["args"] == ["python3", PROGRAM, PLAN]
    assert stats["readiness"] == {
        "nodes": False,
        "topics": [
            {"name": "/map", "publishers": 1},
            {"name": "/work/status", "publishers": 1},
            {"name": "/work/goal", "subscribers": 1},
            {"name": "/temperature", "subscribers": 1},
        ],
        "services": ["/home"],
    }


def test_it_is_valid_and_is_what_a_robot_can_run() -> None:
    items = json.loads(json.dumps(cast(PARTS, ITEMS, ["temperature"], "ros:noetic")))
    groups = {"edge": ["edge1"], "robots": ["robot1"], "all": ["edge1", "robot1"]}
    variables = {"ros_apps": items, "ros_master_image": "ros:noetic"}
    report = check_fleet(groups, {"robot1": variables, "edge1": {}})
    assert [problem.line() for problem in report.problems] == []
    deployments = [one for one in app_objects(robot(*items)) if one["kind"] == "Deployment"]
    [container] = next(
        one["spec"]["template"]["spec"]["containers"] for one in deployments if one["metadata"]["name"] == OTHERS
    )
    assert container["args"] == ["python3", PROGRAM, PLAN]  # its nodes have names of their own: no __name:= behind it


@pytest.mark.parametrize(
    ("then", "names"),
    [
        ([{**REAL, "image": "x.example/temperature:2"}, STAYS], ["temperature"]),
        ([REAL], ["temperature-stats"]),
        ([STAYS, REAL, {"name": "extra"}], ["extra"]),
    ],
)
def test_what_changes(then: list[dict[str, Any]], names: list[str]) -> None:
    assert changed(ITEMS, then) == names


def test_nothing_changes() -> None:
    with pytest.raises(SpecError, match=r"changes none of .* given with -e stays as it is: temperature, temperature-"):
        changed(ITEMS, list(ITEMS))
