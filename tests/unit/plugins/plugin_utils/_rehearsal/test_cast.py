# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""The apps of a rehearsal: valid ones, the changed ones real, and all others stand-ins."""

from __future__ import annotations

import json
from dataclasses import replace
from typing import Any

import pytest
from ansible_collections.rosops.fleet.plugins.module_utils._common.errors import SpecError
from ansible_collections.rosops.fleet.plugins.module_utils._pod import stand_in
from ansible_collections.rosops.fleet.plugins.plugin_utils._objects.app import app_objects
from ansible_collections.rosops.fleet.plugins.plugin_utils._rehearsal.cast import OTHERS, PLAN, PROGRAM, Stage, cast
from ansible_collections.rosops.fleet.plugins.plugin_utils._validate.fleet import check_fleet
from ansible_collections.rosops.fleet.tests.unit.plugins.plugin_utils._rehearsal.recordings import RECORDING
from ansible_collections.rosops.fleet.tests.unit.robots import robot

ITEMS: list[dict[str, Any]] = [
    {
        "name": "temperature",
        "image": "x.example/temperature:1",
        "command": ["run"],
        "pattern": "pubsub",
        "env": {"RATE_HZ": "500"},
    },
    {"name": "temperature-stats", "image": "x.example/stats:1", "command": ["run"], "volumes": [{"name": "logs"}]},
]
STAGE = Stage("ros:noetic")
NEW = {"temperature": {"image": "x.example/temperature:2", "env": {"RATE_HZ": "250"}}}


def by_name(items: Any) -> dict[str, dict[str, Any]]:
    return {item["name"]: item for item in items}


def test_the_changed_app_is_real_and_all_others_are_stand_ins() -> None:
    found = cast(RECORDING, ITEMS, NEW, STAGE)
    before, after = by_name(found.before), by_name(found.after)
    assert set(before) == set(after) == {"temperature", "temperature-stats", OTHERS}
    assert before["temperature"] == ITEMS[0]
    assert after["temperature"] == {**ITEMS[0], "image": "x.example/temperature:2", "env": {"RATE_HZ": "250"}}
    assert [before[name] for name in ("temperature-stats", OTHERS)] == [
        after[name] for name in ("temperature-stats", OTHERS)
    ]
    stats = before["temperature-stats"]
    assert (stats["image"], stats["placement"], stats["handoff"]) == ("ros:noetic", "remote", "replace")
    assert "volumes" not in stats
    files = {one["path"]: one["content"] for one in stats["files"]}
    assert "class Account" in files[PROGRAM]
    assert [node["name"] for node in json.loads(files[PLAN])["nodes"]] == ["/temperature_stats", "/arm/helper"]
    assert stats["args"] == ["python3", PROGRAM, PLAN]
    [alone] = json.loads(by_name(found.before)[OTHERS]["files"][1]["content"])["nodes"]
    assert alone["name"] == "/loner"


def test_what_stand_ins_have_to_show() -> None:
    stats = by_name(cast(RECORDING, ITEMS, NEW, STAGE).before)["temperature-stats"]
    assert stats["readiness"] == {
        "nodes": False,
        "topics": [
            {"name": "/map", "publishers": 1},
            {"name": "/temperature", "subscribers": 1},
            {"name": "/work/goal", "subscribers": 1},
            {"name": "/work/status", "publishers": 1},
        ],
        "services": ["/home"],
    }


def test_values_that_were_recorded_are_set_once_for_all() -> None:
    before = by_name(cast(RECORDING, ITEMS, NEW, STAGE).before)
    assert [item["params"] for item in before.values() if "params" in item] == [{"/speed": 0.5}]
    plain = cast(replace(RECORDING, values={}), ITEMS, NEW, STAGE)
    assert not any("params" in item for item in plain.before)


def test_both_are_valid_and_are_what_a_robot_can_run() -> None:
    found = cast(RECORDING, ITEMS, NEW, STAGE)
    for items in (found.before, found.after):
        variables = {"ros_apps": json.loads(json.dumps(items)), "ros_master_image": "ros:noetic"}
        groups = {"edge": ["edge1"], "robots": ["robot1"], "all": ["edge1", "robot1"]}
        report = check_fleet({"groups": groups, "hosts": {"robot1": variables, "edge1": {}}})
        assert [problem.line() for problem in report.problems] == []
    deployments = [one for one in app_objects(robot(*found.before)) if one["kind"] == "Deployment"]
    [container] = next(
        one["spec"]["template"]["spec"]["containers"] for one in deployments if one["metadata"]["name"] == OTHERS
    )
    assert container["args"] == ["python3", PROGRAM, PLAN]  # its nodes have names of their own: no __name:= behind it
    assert stand_in.__file__.endswith("stand_in.py")


def test_services_of_what_is_changed_are_greeted() -> None:
    found = by_name(cast(RECORDING, ITEMS, {"temperature-stats": {"image": "x:2"}}, STAGE).before)
    asks = {
        name: [node["asks"] for node in json.loads(item["files"][1]["content"])["nodes"]]
        for name, item in found.items()
        if "files" in item
    }
    assert asks == {"temperature": [["/home"]], OTHERS: [[]]}


def test_a_robot_without_nodes_of_its_own() -> None:
    assert OTHERS not in by_name(cast(replace(RECORDING, others=()), ITEMS, NEW, STAGE).before)


def test_an_app_that_was_not_recorded_may_be_new() -> None:
    items = [*ITEMS, {"name": "extra", "image": "x.example/extra:1"}]
    assert "extra" in by_name(cast(RECORDING, items, {"extra": {"image": "x.example/extra:2"}}, STAGE).after)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({}, "rehearse_change is empty; it says what changes of which of this inventory's apps: temperature"),
        ({"lidar": {}}, "rehearse_change names lidar; .*: temperature, temperature-stats"),
    ],
)
def test_nothing_to_change(change: dict[str, Any], said: str) -> None:
    with pytest.raises(SpecError, match=said):
        cast(RECORDING, ITEMS, change, STAGE)
