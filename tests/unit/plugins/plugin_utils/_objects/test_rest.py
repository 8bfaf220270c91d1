# SPDX-License-Identifier: GPL-3.0-or-later
"""What a keeper is told of when its robot may be changed."""

from __future__ import annotations

import json

import pytest
from ansible_collections.rosops.fleet.plugins.module_utils._robot.door import Rest, rest_of
from ansible_collections.rosops.fleet.plugins.module_utils._step.windows import Windows
from ansible_collections.rosops.fleet.plugins.plugin_utils._objects.pod_settings import rest_maps
from ansible_collections.rosops.fleet.tests.unit.robots import robot

APPS = [
    {"name": "arm", "image": "a:1", "pattern": "action", "readiness": {"actions": ["move", "~tune"]}},
    {"name": "map", "image": "m:1", "scope": "fleet"},
    {"name": "gui", "image": "g:1", "update": {"idle": ["/dock"], "when": [{"topic": "cmd_vel", "quiet": 3.0}]}},
]
WINDOWS = [{"from": "22:00", "to": "05:00"}]


def test_it_reads_what_the_inventory_says_with_full_names() -> None:
    master = {"mode": "shared"}
    (item,) = rest_maps(robot(*APPS, name="robot-1", master=master, update_when=[{"topic": "/battery", "quiet": 1.0}]))
    assert (item["metadata"]["name"], item["metadata"]["namespace"]) == ("robot-rest", "robot-robot-1")
    battery, steered = {"topic": "/battery", "quiet": 1.0}, {"topic": "/robot_1/cmd_vel", "quiet": 3.0}
    arm = ("/robot_1/move", "/robot_1/arm/tune")
    assert rest_of(item, "arm") == Rest("/robot_1", Windows([], "UTC", []), (battery,), arm)  # type: ignore[arg-type]
    assert rest_of(item, "gui").when == (battery, steered)
    assert (rest_of(item, "").when, rest_of(item, "").idle) == ((battery, steered), (*arm, "/dock"))
    with pytest.raises(Exception, match="there is no app map; there are arm, gui"):
        rest_of(item, "map")


def test_it_says_the_same_each_time_and_windows_with_their_clock() -> None:
    made = [rest_maps(robot(*APPS[:1], update_windows=WINDOWS, update_timezone="Europe/Berlin")) for _time in range(2)]
    assert made[0] == made[1]
    said = json.loads(made[0][0]["data"]["rest.json"])
    assert (said["space"], said["windows"]["spans"], len(said["windows"]["turns"])) == ("/", WINDOWS, 53)


def test_an_external_master_has_no_keeper_to_be_told() -> None:
    assert rest_maps(robot(*APPS[:1], master={"mode": "external", "uri": "http://10.0.0.1:11311"})) == []
