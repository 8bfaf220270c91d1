# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""What pods are given: ConfigMaps per namespace, probes and the stop hook; and the order that apps may ask for."""

from __future__ import annotations

import json
from typing import Any

import pytest
from ansible_collections.rosops.fleet.plugins.plugin_utils._objects.app import app_objects
from ansible_collections.rosops.fleet.plugins.plugin_utils._objects.code_maps import code_maps
from ansible_collections.rosops.fleet.plugins.plugin_utils._objects.pod_settings import app_settings
from ansible_collections.rosops.fleet.tests.unit.robots import robot

CODE = {"run.py": "code", "__init__.py": ""}


def app(**changes: Any) -> dict[str, Any]:
    return {"name": "a", "image": "example.org/a:1", "args": ["x"], **changes}


def maps(*apps: dict[str, Any], **more: Any) -> dict[str, list[str]]:
    """namespace/name -> keys."""
    objects = code_maps(robot(*apps, name="r1", **more), CODE)
    return {f"{o['metadata']['namespace']}/{o['metadata']['name']}": sorted(o["data"]) for o in objects}


ROBOT, FLEET = "robot-r1/rosops-code", "fleet/rosops-code"
ONLY_CODE = ["__init__.py", "run.py"]
EXTERNAL = {"mode": "external", "uri": "http://192.0.2.1:11311"}


@pytest.mark.parametrize(
    ("apps", "master", "expected"),
    [
        ([], {}, {ROBOT: ONLY_CODE}),  # the keeper's pod needs it
        ([], EXTERNAL, {}),
        ([app()], {}, {ROBOT: ONLY_CODE}),
        ([app(hooks="none")], {}, {ROBOT: ONLY_CODE}),
        ([app(hooks="none")], EXTERNAL, {}),
        ([app(hooks="sidecar")], EXTERNAL, {ROBOT: ONLY_CODE}),
        ([app()], EXTERNAL, {ROBOT: ONLY_CODE}),
        ([app()], {"mode": "shared"}, {ROBOT: ONLY_CODE, FLEET: ONLY_CODE}),
        ([app(scope="fleet")], {"mode": "shared"}, {FLEET: ONLY_CODE}),
        ([app(scope="fleet")], EXTERNAL, {FLEET: ONLY_CODE}),
        ([], {"mode": "shared"}, {FLEET: ONLY_CODE}),
    ],
)
def test_one_map_per_namespace_in_use(apps: list[Any], master: Any, expected: dict[str, list[str]]) -> None:
    assert maps(*apps, master=master) == expected


def test_the_fleets_map_is_the_same_from_a_robot_without_the_fleets_app() -> None:
    with_app = code_maps(robot(app(scope="fleet"), name="r1", master={"mode": "shared"}), CODE)
    without = code_maps(robot(name="r2", master={"mode": "shared"}), CODE)
    assert without[0] in with_app


def settings(**changes: Any) -> dict[str, Any]:
    found = robot(app(**changes), name="r-1", master=changes.pop("master", {}))
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


def template(**changes: Any) -> dict[str, Any]:
    found: dict[str, Any] = app_objects(robot(app(**changes)))[-1]["spec"]["template"]
    return found


def test_settings_belong_to_the_revision_that_they_came_with() -> None:
    """Going back to the version before brings back what was asked of it."""
    before, after = template(), template(readiness={"command": "echo $(HOME) > /x"})
    names = [item["metadata"]["labels"]["rosops.fleet/revision"] for item in (before, after)]
    assert names[0] != names[1]
    environment = {item["name"]: item.get("value") for item in after["spec"]["containers"][0]["env"]}
    # the kubelet makes $ of $$, and would put its own variables in the place of $(NAME)
    assert json.loads(environment["ROSOPS_SETTINGS"].replace("$$", "$")) == settings(
        readiness={"command": "echo $(HOME) > /x"}, name="a",
    )  # fmt: skip
    assert "$$(HOME)" in environment["ROSOPS_SETTINGS"]
