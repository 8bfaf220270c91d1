# SPDX-License-Identifier: GPL-3.0-or-later
"""The cast of a rehearsal as files, and what is said of recordings that are none."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from ansible_collections.rosops.fleet.plugins.action import _rehearsal_cast
from ansible_collections.rosops.fleet.tests.unit.plugins.action.actions import run
from ansible_collections.rosops.fleet.tests.unit.plugins.plugin_utils._rehearsal.recordings import RECORDING
from ansible_collections.rosops.fleet.tests.unit.robots import fleet_of, robot

APP = {"name": "temperature", "image": "x.example/t:1", "command": ["run"], "pattern": "pubsub"}
LAYERS = {"ros_apps": [APP], "ros_apps_model": [], "ros_apps_robot": []}
NEXT = {**LAYERS, "ros_apps_robot": [{"name": "temperature", "image": "x.example/t:2"}]}


def cast(path: Path) -> dict[str, Any]:
    args = {"recording": str(path), "now": LAYERS, "next": NEXT, "dest": str(path.parent)}
    return run(_rehearsal_cast, args, fleet_of(robot(APP, name="robot1", master={"image": "lab/ros:1"})))


def test_the_cast_of_what_is_next_says_who_is_real(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "robot7.json"
    path.write_text(json.dumps(RECORDING))
    assert cast(path)["changed"] is False
    images = [item["image"] for item in json.loads((tmp_path / "next.json").read_text())]
    assert images == ["lab/ros:1", "lab/ros:1", "x.example/t:2"]
    assert "[robot1] robot7.json is played; for real: temperature" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("text", "said"),
    [(None, "cannot be read: No such file"), ("{", "is no JSON: "), ("{}", "is no recording of a robot's graph")],
)
def test_a_file_that_is_no_recording(tmp_path: Path, text: str | None, said: str) -> None:
    path = tmp_path / "robot1.json"
    if text is not None:
        path.write_text(text)
    found = cast(path)
    assert found["failed"]
    assert str(path) in found["msg"]
    assert said in found["msg"]
