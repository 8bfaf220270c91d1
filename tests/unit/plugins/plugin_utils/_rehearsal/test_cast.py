# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""The apps of a rehearsal: valid ones, the changed ones real, and all others stand-ins."""

from __future__ import annotations

import json
from typing import Any

import pytest
from ansible_collections.rosops.fleet.plugins.module_utils._common.errors import SpecError
from ansible_collections.rosops.fleet.plugins.plugin_utils._objects.app import app_objects
from ansible_collections.rosops.fleet.plugins.plugin_utils._rehearsal.cast import PLAN, PROGRAM, cast, changed
from ansible_collections.rosops.fleet.plugins.plugin_utils._rehearsal.recording import OTHERS, parts
from ansible_collections.rosops.fleet.plugins.plugin_utils._validate.fleet import check_fleet
from ansible_collections.rosops.fleet.tests.unit.plugins.plugin_utils._rehearsal.recordings import RECORDING
from ansible_collections.rosops.fleet.tests.unit.robots import robot

REAL = {"name": "temperature", "image": "x.example/temperature:1", "command": ["run"], "pattern": "pubsub"}
STAYS = {"name": "temperature-stats", "image": "x.example/stats:1", "command": ["run"], "volumes": [{"name": "logs"}]}
ITEMS: list[dict[str, Any]] = [REAL, STAYS]
PARTS = parts(RECORDING, "it")


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
