# SPDX-License-Identifier: GPL-3.0-or-later
"""What the code in a pod has to know of its app: names, parameters, and how long a stop may take."""

from __future__ import annotations

import json
from typing import Any

import pytest
from ansible_collections.rosops.fleet.plugins.plugin_utils._objects.app import app_objects
from ansible_collections.rosops.fleet.plugins.plugin_utils._objects.pod_settings import app_settings
from ansible_collections.rosops.fleet.tests.unit.robots import robot

APP = {"name": "a", "image": "example.org/a:1", "command": ["run"]}
PARAMS = {"rate": 20, "/speed": 1}
TOLD = {"~rate": 20, "/speed": 1}


def settings(**changes: Any) -> dict[str, Any]:
    found = robot({**APP, **changes}, name="r-1")
    return app_settings(found.apps[0], found)


def test_names_are_full_but_for_private_ones_of_a_revision() -> None:
    readiness = {
        "topics": [
            {"name": "out", "min_rate": 5, "publishers": 1},
            {"name": "~own", "min_rate": 2},
            {"name": "/x"},
            {"name": "shared", "min_rate": 9, "publishers": 2},
        ],
        "actions": ["move", "~grip", {"name": "/arm", "state": "idle"}],
    }
    found = settings(pattern="pubsub", readiness=readiness)
    assert found["min_rates"] == {"/out": 5, "~own": 2}
    assert found["actions"] == ["/move", "~grip", "/arm"]
    found = settings(pattern="pubsub", readiness=readiness, private_names=["own"])
    assert found["min_rates"] == {"/out": 5, "/a/own": 2}
    found = settings(pattern="action", readiness=readiness)
    assert found["actions"] == ["/move", "/a/grip", "/arm"]


@pytest.mark.parametrize(
    ("changes", "expected"),
    [
        ({"pattern": "action"}, 30),
        ({"pattern": "action", "drain_deadline": 100, "termination_grace_period": 120}, 100),
        ({"pattern": "pubsub"}, 30),  # service calls under way
        ({"pattern": "pubsub", "drain_deadline": 100, "termination_grace_period": 120}, 100),
        ({"termination_grace_period": 30}, 25),  # what is left is for the app to end
        ({"termination_grace_period": 2}, 1),
    ],
)
def test_the_stop_fits_in_the_grace_period(changes: dict[str, Any], expected: int) -> None:
    assert settings(**changes)["stop_deadline"] == expected


def test_settings_belong_to_the_revision_that_they_came_with() -> None:
    """Going back to the version before brings back what was asked of it."""
    asked = {"readiness": {"command": "echo $(HOME) > /x"}}
    before, after = (app_objects(robot({**APP, **more}, name="r-1"))[-1]["spec"]["template"] for more in ({}, asked))
    names = [item["metadata"]["labels"]["rosops.fleet/revision"] for item in (before, after)]
    assert names[0] != names[1]
    environment = {item["name"]: item.get("value") for item in after["spec"]["containers"][0]["env"]}
    # the kubelet makes $ of $$, and would put its own variables in the place of $(NAME)
    assert json.loads(environment["ROSOPS_SETTINGS"].replace("$$", "$")) == settings(**asked)
    assert "$$(HOME)" in environment["ROSOPS_SETTINGS"]


@pytest.mark.parametrize(
    ("said", "told"),
    [
        ({}, {}),
        ({"params": PARAMS}, {"params": TOLD}),
        ({"params": PARAMS, "keep_params": ["pid/p", "/speed"]}, {"params": TOLD, "keep_params": ["~pid/p", "/speed"]}),
        ({"handoff": "replace", "keep_params": ["rate"]}, {"params": {}, "keep_params": ["~rate"]}),
        ({"params": PARAMS, "keep_params": []}, {"params": TOLD}),
    ],
)
def test_parameters(said: dict[str, Any], told: dict[str, Any]) -> None:
    found = settings(**said)
    assert {key: found[key] for key in ("params", "keep_params") if key in found} == told


@pytest.mark.parametrize(
    ("said", "told"),
    [
        (
            {"pattern": "pubsub", "launch": {"file": "a.launch", "replace": ["arm", "/dock"]}},
            {"held": ["arm", "/dock"]},
        ),
        ({"pattern": "pubsub", "launch": {"file": "a.launch"}}, {}),
        ({"launch": {"file": "a.launch", "replace": ["arm"]}}, {}),
        ({"pattern": "pubsub", "args": ["rosbridge_websocket"]}, {"on_demand": True}),
        ({"args": ["rosbridge_websocket"]}, {}),
    ],
)
def test_what_a_pod_cannot_owe_the_one_before(said: dict[str, Any], told: dict[str, Any]) -> None:
    """Where both are there at once; the templates of others have no word of it."""
    found = settings(**said)
    assert {key: found[key] for key in ("held", "on_demand") if key in found} == told
