# SPDX-License-Identifier: GPL-3.0-or-later
"""What a rehearsal says of a version is what becomes of it: robot1 is recorded, robot2 is the stage."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from cluster import KEEPER, MASTER
from fleet import Fleet

REAL, STAGE = "robot1", "robot2"
PATIENCE: dict[str, Any] = {"update_ready_timeout": 30}
APP, TOPIC = "temperature", "/temperature"
PROGRAM = "/etc/rehearsal/other_definition.py"
OTHER_DEFINITION = """
import sys
sys.path.insert(0, "/opt/rosops-apps/lib")
from rosops_apps import msg, temperature_publisher
msg.Temperature._md5sum = "0" * 32
temperature_publisher.main()
"""
# Version -> what is changed for it, its outcome, and a word of the reason. The good one is the last: it stays.
VERSIONS: dict[str, tuple[dict[str, Any], str, str]] = {
    "broken": ({"env": {"CRASH_AFTER": 0.3}}, "rolled-back", ""),
    "slower": ({"env": {"RATE_HZ": 250}}, "rolled-back", "rate"),
    "of another definition": (
        {
            "command": ["/ros_entrypoint.sh", "python3", PROGRAM],
            "files": [{"path": PROGRAM, "content": OTHER_DEFINITION}],
        },
        "rolled-back",
        " is not connected to /temperature_",  # who knows another definition hangs up
    ),
    "good": ({"env": {"ROSOPS_APPS_VERSION": "rehearsed"}}, "updated", ""),
}


def limit(robot: str) -> tuple[str, str]:
    return ("--limit", f"{robot},edge1")


def apps(fleet: Fleet, robot: str) -> set[str]:
    """Those that have a pod."""
    return {app for app, pods in fleet.pods()[robot].items() if pods and not app.startswith((MASTER, KEEPER))}


def clear(fleet: Fleet) -> None:
    """Take all apps from the stage, whatever they are."""
    gone = {"ros_apps": [], "update_remove_apps": sorted(apps(fleet, STAGE))}
    fleet.playbooks.run("update", {**fleet.variables, **gone}, *limit(STAGE)).must(0)


@pytest.fixture
def recording(fleet: Fleet, tmp_path: Path) -> Iterator[Path]:
    """Of the real robot at rest; the stage is empty."""
    file = tmp_path / "robot1.json"
    fleet.playbooks.run("record", {**fleet.variables, "record_file": str(file)}, *limit(REAL)).must(0)
    clear(fleet)
    yield file
    clear(fleet)
    fleet.return_to(fleet.variables)


def test_rehearsal_and_reality_agree(fleet: Fleet, recording: Path, tmp_path: Path) -> None:
    recorded = json.loads(recording.read_text())
    assert {app["name"] for app in recorded["apps"]} == apps(fleet, REAL)
    assert recorded["graph"]["topics"][TOPIC]["rate"] == pytest.approx(500, rel=0.1)
    now, then = tmp_path / "now.yml", tmp_path / "next.yml"
    now.write_text(json.dumps({**fleet.variables, **PATIENCE}))
    settings: dict[str, Any] = {
        "update_test_stage": True,
        "update_test_recording": str(recording),
        "update_test_vars": [str(now)],
        "update_test_next": [str(then)],
    }
    for version, (change, outcome, word) in VERSIONS.items():
        then.write_text(json.dumps(fleet.changed(STAGE, APP, **change)))
        rehearsed = fleet.playbooks.run("update_test", settings, *limit(STAGE))
        said = " ".join(rehearsed.output.split())
        assert "lost 0" in said, (version, rehearsed)
        told = said.partition("update ended with ")[2]
        assert rehearsed.status == 0 or f"{STAGE} {outcome}: " in told, (version, rehearsed)
        assert (rehearsed.status == 0) == (outcome == "updated"), (version, rehearsed)
        assert word in said, (version, rehearsed)

        watch = fleet.watch()
        wanted = fleet.changed(REAL, APP, **change)
        run = fleet.update(wanted, *limit(REAL), **PATIENCE)
        assert run.outcomes == {REAL: outcome}, (version, run)
        assert word in run.host(REAL)["reason"], (version, run)
        watch.assert_nothing_lost(REAL, goals=False)
        fleet.figures.append(f"{version}: {outcome}, rehearsed in {rehearsed.ended - rehearsed.began:.0f} s")
