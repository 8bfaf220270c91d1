# SPDX-License-Identifier: GPL-3.0-or-later
"""What our code in pods is told: names, parameters, how long a stop may take, and when a robot may be changed."""

from __future__ import annotations

import json
from typing import Any

import pytest
from ansible_collections.rosops.fleet.plugins.module_utils._robot.door import RestRules, rest_of
from ansible_collections.rosops.fleet.plugins.module_utils._step.windows import Windows
from ansible_collections.rosops.fleet.plugins.plugin_utils._objects.app import app_objects
from ansible_collections.rosops.fleet.plugins.plugin_utils._objects.pod_settings import app_settings, rest_maps
from ansible_collections.rosops.fleet.tests.unit.robots import robot

APP = {"name": "a", "image": "example.org/a:1", "command": ["run"]}
GRIP = {
    "topics": [
        {"name": "out", "min_rate": 5, "publishers": 1},
        {"name": "~own", "min_rate": 2},
        {"name": "/x"},
        {"name": "shared", "min_rate": 9, "publishers": 2},
    ],
    "actions": ["move", "~grip", {"name": "/arm", "state": "idle"}],
}
LONG = {"drain_deadline": 100, "termination_grace_period": 120}
LAUNCH = {"file": "a.launch", "replace": ["arm", "/dock"]}


def settings(**changes: Any) -> dict[str, Any]:
    found = robot({**APP, **changes}, name="r-1")
    return app_settings(found.apps[0], found)


@pytest.mark.parametrize(
    ("changes", "told"),
    [
        # names are full but for private ones of a revision
        ({"pattern": "pubsub", "readiness": GRIP},
         {"min_rates": {"/out": 5, "~own": 2}, "actions": ["/move", "~grip", "/arm"]}),
        ({"pattern": "pubsub", "readiness": GRIP, "private_names": ["own"]}, {"min_rates": {"/out": 5, "/a/own": 2}}),
        ({"pattern": "pubsub", "readiness": GRIP, "private_names": ["~/own"]}, {"min_rates": {"/out": 5, "/a/own": 2}}),
        ({"pattern": "action", "readiness": GRIP}, {"actions": ["/move", "/a/grip", "/arm"]}),
        # a stop fits in the grace period
        ({"pattern": "action"}, {"stop_deadline": 30}),
        ({"pattern": "action", **LONG}, {"stop_deadline": 100}),
        ({"pattern": "pubsub", **LONG}, {"stop_deadline": 100}),  # service calls under way
        ({"termination_grace_period": 30}, {"stop_deadline": 25}),  # what is left is for the app to end
        ({"termination_grace_period": 2}, {"stop_deadline": 1}),
        # templates of apps without any have no word of parameters,
        ({}, {"params": None, "keep_params": None}),
        ({"params": {"rate": 20, "/speed": 1}, "keep_params": ["pid/p", "/speed"]},
         {"params": {"~rate": 20, "/speed": 1}, "keep_params": ["~pid/p", "/speed"]}),
        ({"handoff": "replace", "keep_params": ["rate"]}, {"params": {}, "keep_params": ["~rate"]}),
        # nor of what a pod cannot owe the one before, where the two are not there at once
        ({"pattern": "pubsub", "launch": LAUNCH}, {"held": ["arm", "/dock"], "launch": "overlap"}),
        ({"launch": LAUNCH}, {"held": None, "launch": "replace"}),
        ({"pattern": "pubsub", "args": ["rosbridge_websocket"]}, {"on_demand": True}),
        ({"args": ["rosbridge_websocket"]}, {"on_demand": None}),
    ],
)  # fmt: skip
def test_what_a_pod_is_told_of_its_app(changes: dict[str, Any], told: dict[str, Any]) -> None:
    found = settings(**changes)
    assert {key: found.get(key) for key in told} == told


def test_settings_are_as_the_kubelet_hands_them_on() -> None:
    """It makes $ of $$, and would put its own variables in the place of $(NAME)."""
    asked = {"readiness": {"command": "echo $(HOME) > /x"}}
    (app,) = app_objects(robot({**APP, **asked}, name="r-1"))
    env = {item["name"]: item.get("value") for item in app["spec"]["template"]["spec"]["containers"][0]["env"]}
    assert "$$(HOME)" in env["ROSOPS_SETTINGS"]
    assert json.loads(env["ROSOPS_SETTINGS"].replace("$$", "$")) == settings(**asked)


def test_a_keeper_reads_what_the_inventory_says_with_full_names() -> None:
    apps = [
        {"name": "arm", "image": "a:1", "pattern": "action", "readiness": {"actions": ["move", "~tune"]}},
        {"name": "map", "image": "m:1", "scope": "fleet"},
        {"name": "gui", "image": "g:1", "update": {"idle": ["/dock"], "when": [{"topic": "cmd_vel", "quiet": 3.0}]}},
    ]
    battery, steered = {"topic": "/battery", "quiet": 1.0}, {"topic": "/robot_1/cmd_vel", "quiet": 3.0}
    of: dict[str, Any] = {"name": "robot-1", "master": {"mode": "shared"}, "update_when": [battery]}
    (item,) = rest_maps(robot(*apps, **of))
    arm = ("/robot_1/move", "/robot_1/arm/tune")
    assert rest_of(item, "arm") == RestRules("/robot_1", Windows([], "UTC", []), (battery,), arm)  # type: ignore[arg-type]
    assert rest_of(item, "gui").when == (battery, steered)
    assert (rest_of(item, "").when, rest_of(item, "").idle) == ((battery, steered), (*arm, "/dock"))
    with pytest.raises(Exception, match="there is no app map; there are arm, gui"):
        rest_of(item, "map")
    windows = [{"from": "22:00", "to": "05:00"}]
    (item,) = rest_maps(robot(*apps, **of, update_windows=windows, update_timezone="Europe/Berlin"))
    found = rest_of(item, "").windows
    assert (found.spans, found.zone, len(found.turns)) == (windows, "Europe/Berlin", 53)
