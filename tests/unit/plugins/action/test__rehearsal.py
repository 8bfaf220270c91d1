# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""The actions of record and rehearse: files in, files out, and what they say of those that are none."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from ansible_collections.rosops.fleet.plugins.action import _recording_write, _rehearsal_cast, _rehearsal_review
from ansible_collections.rosops.fleet.plugins.module_utils._ros.recording import Recording
from ansible_collections.rosops.fleet.tests.unit.plugins.action.actions import run
from ansible_collections.rosops.fleet.tests.unit.plugins.plugin_utils._rehearsal.recordings import RECORDING
from ansible_collections.rosops.fleet.tests.unit.robots import fleet_of, robot

APP = {"name": "temperature", "image": "x.example/t:1", "command": ["run"], "pattern": "pubsub"}
CHANGE = {"temperature": {"image": "x.example/t:2"}}


def keep(path: Path, check: bool = False) -> dict[str, Any]:
    return run(_recording_write, {"recording": RECORDING.as_dict(), "path": str(path)}, {}, check_mode=check)


def test_a_recording_is_kept_for_its_user_alone(tmp_path: Path) -> None:
    path = tmp_path / "recordings" / "robot1.json"
    assert keep(path, check=True)["changed"]
    assert not path.exists()
    assert keep(path)["changed"]
    assert path.stat().st_mode & 0o777 == 0o600
    assert Recording.from_dict(json.loads(path.read_text()), "it") == RECORDING
    assert not keep(path)["changed"]


def test_a_recording_that_cannot_be_kept(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    found = keep(tmp_path / "file" / "robot1.json")
    assert found["failed"]
    assert "cannot be written" in found["msg"]
    nowhere = run(_recording_write, {"recording": RECORDING.as_dict(), "path": ""}, {})
    assert (nowhere["failed"], nowhere["msg"]) == (True, "record_file is empty: say where the recording goes")
    other = run(_recording_write, {"recording": {}, "path": "x"}, {})
    assert "what the robot's host returned is no recording" in other["msg"]


def cast(path: Path, **more: Any) -> dict[str, Any]:
    args = {"recording": str(path), "apps": [APP], "change": CHANGE, **more}
    return run(_rehearsal_cast, args, fleet_of(robot(APP, name="robot1", master={"image": "lab/ros:1"})))


def test_the_cast(tmp_path: Path) -> None:
    path = tmp_path / "robot1.json"
    keep(path)
    found = cast(path)
    assert (found["changed"], len(found["before"])) == (False, 3)
    assert {item["image"] for item in found["before"]} == {"lab/ros:1", "x.example/t:1"}
    assert {item["image"] for item in found["after"]} == {"lab/ros:1", "x.example/t:2"}
    given = cast(path, image="other:1", command=["/bin/env"])
    assert given["before"][0]["image"] == "other:1"
    assert given["before"][0]["command"] == ["/bin/env"]


def test_layers_of_apps_are_one(tmp_path: Path) -> None:
    path = tmp_path / "robot1.json"
    keep(path)
    model = [{"name": "temperature", "image": "x.example/t:model", "env": {"A": "1"}}]
    own = [{"name": "temperature", "env": {"B": "2"}}]
    found = cast(path, model=model, own=own)
    [real] = [item for item in found["before"] if item["name"] == "temperature"]
    assert real == {**APP, "image": "x.example/t:model", "env": {"A": "1", "B": "2"}}


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


def test_the_review(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path, report = tmp_path / "robot1.json", tmp_path / "reports" / "rehearsal.json"
    keep(path)
    account = {"messages": 5, "missing": 0, "twice": 0, "publishers": ["/temperature"], "gaps": []}
    values = {"/rehearsal/temperature_stats": json.dumps({"/temperature": account})}
    stage = Recording("robot1", values=values).as_dict()
    args = {
        "recording": str(path),
        "change": CHANGE,
        "outcome": {"outcome": "updated", "reason": "", "steps": []},
        "before": Recording("robot1").as_dict(),
        "after": stage,
        "report": str(report),
    }
    assert run(_rehearsal_review, args, {}, check_mode=True)["changed"] is False
    assert not report.exists()
    found = run(_rehearsal_review, args, {})
    assert json.loads(report.read_text()) == json.loads(json.dumps(found["rehearsal"]))
    assert found["rehearsal"]["received"][0]["messages"] == 5
    assert "[robot1] robot1's graph, temperature changed: updated" in capsys.readouterr().out
    (tmp_path / "file").write_text("")
    failed = run(_rehearsal_review, {**args, "report": str(tmp_path / "file" / "x.json")}, {})
    assert "the report cannot be written" in failed["msg"]
