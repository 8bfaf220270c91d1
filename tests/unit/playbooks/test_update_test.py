# SPDX-License-Identifier: GPL-3.0-or-later
"""update_test.yml says what was lost and what became of the update; with what record.yml keeps stand-ins play."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import yaml
from ansible_collections.rosops.fleet.plugins.plugin_utils._rehearsal.recording import OTHERS, parts
from ansible_collections.rosops.fleet.tests.unit.playbooks.control_node import CHECKOUT, Control
from ansible_collections.rosops.fleet.tests.unit.playbooks.robot_runs import STAGES, Run, path_of
from ansible_collections.rosops.fleet.tests.unit.plugins.fake_ros import Peers
from ansible_collections.rosops.fleet.tests.unit.plugins.plugin_utils._kube.kube_server import Server
from ansible_collections.rosops.fleet.tests.unit.plugins.plugin_utils._rehearsal.recordings import RECORDING

APPS = [
    {"name": "temperature", "image": "{{ temperature_image }}", "command": ["run"], "pattern": "pubsub"},
    {"name": "temperature-stats", "image": "x.example/stats:1", "command": ["run"]},
]


@pytest.fixture
def peers() -> Iterator[Peers]:
    found = Peers()
    yield found
    found.close()


def play(control: Control, playbook: str, inventory: dict[str, Any], *arguments: str, **said: Any) -> tuple[int, str]:
    control.write("play.yml", f"- import_playbook: {CHECKOUT}/playbooks/{playbook}.yml\n")
    hosts = yaml.safe_load((control.folder / "hosts.yml").read_text())
    hosts["all"]["vars"].update(
        {"ros_apps": APPS, "temperature_image": "x.example/temperature:1", "ros_app_rollout_timeout": 1, **inventory}
    )
    control.write("hosts.yml", yaml.safe_dump(hosts))
    (control.folder / "temporary").mkdir()
    done = control.run(
        "--limit", "robot1", "-e", json.dumps(said), *arguments, TMPDIR=str(control.folder / "temporary")
    )
    return done.returncode, done.stdout + done.stderr


@pytest.fixture
def master(peers: Peers) -> dict[str, str]:
    """An external one, of an empty graph."""
    replies = {"getSystemState": [1, "", [[], [], []]], "getTopicTypes": [1, "", []], "getParam": [1, "", {}]}
    uri = peers.api("master", replies, multicall=True)
    return {"ros_master_mode": "external", "ros_master_uri": uri.rstrip("/")}


def test_a_recording_of_a_master(server: Server, control: Control, master: dict[str, str]) -> None:
    path = control.folder / "robot7.json"
    status, output = play(control, "record", master, record_seconds=0.1, record_file=str(path))
    assert status == 0, output
    assert parts(json.loads(path.read_text()), "it") == {}
    assert path.stat().st_mode & 0o777 == 0o600
    assert server.writes == []


def test_one_file_is_not_for_several_robots(control: Control) -> None:
    found = Run(control, "robot1,robot2", playbook="record", record_file="robot7.json")
    assert (found.status, "record_file is for one robot" in found.output) == (2, True)


def test_an_update_that_fails_and_nobody_who_sends(server: Server, control: Control, master: dict[str, str]) -> None:
    """No controller runs there, so what is next never gets ready."""
    control.write("next.yml", "temperature_image: x.example/temperature:2\n")
    said = {"update_test_end": str(control.folder / "listened"), "ansible_async_dir": str(control.folder / "async")}
    wanted = [str(control.folder / "next.yml")]
    status, output = play(control, "update_test", master, "--tags", STAGES, update_test_next=wanted, **said)
    assert status == 2, output
    assert "no message was seen on any topic; update ended with 2: robot1 failed: " in output
    made = server.find(path_of("Deployment", "robot-robot1", "temperature"))
    assert "x.example/temperature:2" in json.dumps(made)


def rehearse(control: Control, **inventory: Any) -> tuple[int, str]:
    control.write("robot7.json", json.dumps(RECORDING))
    control.write("next.yml", "temperature_image: x.example/temperature:2\n")
    recording, wanted = str(control.folder / "robot7.json"), [str(control.folder / "next.yml")]
    said = {"update_test_recording": recording, "update_test_next": wanted}
    image = {"ros_master_image": "x.example/ros:1"}
    return play(control, "update_test", {**image, **inventory}, "--tags", STAGES, **said)


def test_a_robot_that_is_no_stage_is_not_touched(server: Server, control: Control) -> None:
    status, output = rehearse(control)
    assert status == 2
    assert "say in its variables" in output
    assert server.writes == []


def test_stand_ins_are_what_the_robot_gets(server: Server, control: Control, tmp_path: Path) -> None:
    """No controller runs there, so they never get ready, and no update begins."""
    status, output = rehearse(control, update_test_stage=True)
    assert status == 2, output
    assert "What was recorded does not play: site ended with 2: robot1 failed: install: 0 of 1 pods updated" in output
    assert "Update it meanwhile" not in output
    names, ros = ("temperature", "temperature-stats", OTHERS), "x.example/ros:1"
    made = {name: server.find(path_of("Deployment", "robot-robot1", name)) for name in names}
    images = [one["spec"]["template"]["spec"]["containers"][0]["image"] for one in made.values() if one is not None]
    assert images == ["x.example/temperature:1", ros, ros]
    assert "temperature:2" not in json.dumps(made)
    assert "{{ no template }}" in json.dumps(server.lists)
    assert not list((tmp_path / "temporary").iterdir())
