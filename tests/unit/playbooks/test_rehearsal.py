# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""The playbooks record and rehearse: what they refuse, what is kept, and that stand-ins are what a robot then gets."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import yaml
from ansible_collections.rosops.fleet.plugins.plugin_utils._rehearsal.cast import OTHERS
from ansible_collections.rosops.fleet.tests.unit.playbooks.control_node import CHECKOUT, Control
from ansible_collections.rosops.fleet.tests.unit.playbooks.robot_runs import STAGES, path_of
from ansible_collections.rosops.fleet.tests.unit.plugins.fake_ros import Peers
from ansible_collections.rosops.fleet.tests.unit.plugins.plugin_utils._kube.kube_server import Server
from ansible_collections.rosops.fleet.tests.unit.plugins.plugin_utils._rehearsal.recordings import RECORDING

APPS = [
    {"name": "temperature", "image": "x.example/temperature:1", "command": ["run"], "pattern": "pubsub"},
    {"name": "temperature-stats", "image": "x.example/stats:1", "command": ["run"]},
]


@pytest.fixture
def control(tmp_path: Path, server: Server) -> Control:
    return Control(tmp_path, server)


@pytest.fixture
def peers() -> Iterator[Peers]:
    found = Peers()
    yield found
    found.close()


def play(control: Control, playbook: str, inventory: dict[str, Any], *arguments: str, **said: Any) -> tuple[int, str]:
    control.write("play.yml", f"- import_playbook: {CHECKOUT}/playbooks/{playbook}.yml\n")
    hosts = yaml.safe_load((control.folder / "hosts.yml").read_text())
    hosts["all"]["vars"].update({"ros_apps": APPS, "ros_app_rollout_timeout": 1, **inventory})
    control.write("hosts.yml", yaml.safe_dump(hosts))
    done = control.run("--limit", "robot1", "-e", json.dumps(said), *arguments)
    print(done.stdout + done.stderr)
    return done.returncode, done.stdout + done.stderr


def test_a_recording_of_a_master(server: Server, control: Control, peers: Peers) -> None:
    replies = {
        "getSystemState": [1, "", [[], [], []]],
        "getTopicTypes": [1, "", []],
        "getParam": [1, "", {"camera": {"password": "hush-hush"}}],
    }
    uri = peers.api("master", replies, multicall=True)
    path = control.folder / "recordings" / "robot1.json"
    status, output = play(
        control,
        "record",
        {"ros_master_mode": "external", "ros_master_uri": uri.rstrip("/")},
        record_seconds=0.1,
        record_file=str(path),
    )
    assert status == 0, output
    kept = json.loads(path.read_text())
    assert (kept["robot"], kept["parameters"]) == ("robot1", {"/camera/password": "str"})
    assert path.stat().st_mode & 0o777 == 0o600
    assert "hush-hush" not in path.read_text() + output
    assert server.writes == []


def recording(control: Control) -> dict[str, Any]:
    control.write("robot1.json", json.dumps(RECORDING.as_dict()))
    return {"rehearse_file": str(control.folder / "robot1.json")}


def test_a_robot_that_is_no_stage_is_not_touched(server: Server, control: Control) -> None:
    status, output = play(
        control,
        "rehearse",
        {},
        "--tags",
        STAGES,
        **recording(control),
        rehearse_change={"temperature": {"image": "x:2"}},
    )
    assert status == 2
    assert "say so in its" in output
    assert server.writes == []


def test_stand_ins_are_what_the_robot_gets(server: Server, control: Control) -> None:
    """No controller runs there, so they never get ready, and nothing is rehearsed."""
    status, output = play(
        control,
        "rehearse",
        {"rehearse_stage": True},
        "--tags",
        STAGES,
        **recording(control),
        rehearse_change={"temperature": {"image": "x.example/temperature:2"}},
        rehearse_image="x.example/ros:1",
    )
    assert status == 2, output
    made = {
        name: server.find(path_of("Deployment", "robot-robot1", name))
        for name in ("temperature", "temperature-stats", OTHERS)
    }
    images = {
        name: one["spec"]["template"]["spec"]["containers"][0]["image"] for name, one in made.items() if one is not None
    }
    assert images == {
        "temperature": "x.example/temperature:1",
        "temperature-stats": "x.example/ros:1",
        OTHERS: "x.example/ros:1",
    }
    assert "temperature:2" not in json.dumps(made)
