# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""site.yml and its robots as a run has them: ansible-playbook itself, a program in the place of ssh, an API of ours.

No controller runs there: what is applied never gets ready.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from ansible_collections.rosops.fleet.plugins.plugin_utils._objects.app import app_objects
from ansible_collections.rosops.fleet.plugins.plugin_utils._objects.master import master_objects
from ansible_collections.rosops.fleet.plugins.plugin_utils._objects.parts import CODE, PARTS, ground_objects
from ansible_collections.rosops.fleet.tests.unit.playbooks.control_node import CHECKOUT, SSH, Control
from ansible_collections.rosops.fleet.tests.unit.plugins.plugin_utils._kube.kube_server import Server
from ansible_collections.rosops.fleet.tests.unit.robots import robot

STAGES = ",".join(PARTS)
APP = {"name": "talker", "image": "x.example/talker:1", "command": ["run"], "pattern": "pubsub"}
WAVE = "Robots are updated, wave by wave"
PLACES = {"Deployment": "apis/apps/v1", "Service": "api/v1", "ConfigMap": "api/v1"}


def path_of(kind: str, namespace: str, name: str) -> str:
    return f"/{PLACES[kind]}/namespaces/{namespace}/{kind.lower()}s/{name}"


def runs(server: Server, name: str) -> None:
    """A robot that works, on an earlier version of its app."""
    made = robot({**APP, "image": "x.example/talker:0"}, name=name)
    space = f"/api/v1/namespaces/robot-{name}"
    server.put(space, {"metadata": {}})
    for item in [*ground_objects(made, ["apps"], [], CODE), *master_objects(made), *app_objects(made)]:
        if item["kind"] in PLACES:
            item = {**item, "spec": {**item.get("spec", {}), "clusterIP": "192.0.2.200"}}  # noqa: PLW2901
            server.put(path_of(item["kind"], f"robot-{name}", item["metadata"]["name"]), item)


class Run:
    def __init__(
        self, control: Control, robots: str, *arguments: str, playbook: str = "site", **variables: Any
    ) -> None:
        control.write("play.yml", f"- import_playbook: {CHECKOUT}/playbooks/{playbook}.yml\n")
        said = {"ros_apps": [APP], "ros_app_rollout_timeout": 1, "update_failure_budget": 9, **variables}
        done = control.run("--limit", robots, "-e", json.dumps(said), *arguments)
        self.status, self.output = done.returncode, done.stdout + done.stderr
        report: dict[str, Any] = json.loads((control.folder / "report.json").read_text())
        self.hosts = {one["host"]: one for one in report["hosts"]}
        self.plays = [play["name"] for play in report["plays"]]

    def outcome(self, name: str) -> tuple[str, str]:
        return self.hosts[name]["outcome"], self.hosts[name]["reason"]


@pytest.fixture
def control(tmp_path: Path, server: Server) -> Control:
    made = Control(tmp_path, server)
    robot3_is_off = SSH.format(folder=tmp_path).replace("= 192.0.2.1 ]", "= 192.0.2.1 -o $host = 192.0.2.13 ]")
    made.write("ssh", robot3_is_off, 0o755)
    return made


def test_who_runs_nothing_comes_first_and_who_works_in_waves(server: Server, control: Control) -> None:
    for name in ("robot2", "robot5"):
        runs(server, name)
    run = Run(control, "robot1,robot2,robot3,robot5", "--tags", STAGES)
    assert run.plays.count(WAVE) == 2, run.output  # a robot each: the one that was made had no wave
    # made at once, and it stays, though it does not get ready
    assert run.outcome("robot1")[0] == "failed"
    assert "what came up stays as it is" in run.outcome("robot1")[1]
    assert server.find(path_of("Deployment", "robot-robot1", "talker"))
    assert server.find(path_of("Deployment", "robot-robot1", "ros-master"))
    # at work: before a step nothing of the app is touched, and its ROS master is asked in vain
    for name in ("robot2", "robot5"):
        assert run.outcome(name)[0] == "failed"
        assert "no app was touched: the ROS master does not answer" in run.outcome(name)[1]
        assert ":0" in str(server.find(path_of("Deployment", f"robot-{name}", "talker")))
    assert run.outcome("robot3")[0] == "deferred-offline"
    assert run.output.count("UNREACHABLE!") == 1  # in the very end, for the exit status
    assert run.status == 4, run.output


def test_a_robot_that_is_off_ends_no_waves(server: Server, control: Control) -> None:
    """It is the only one of the first wave."""
    runs(server, "robot5")
    run = Run(control, "robot3,robot5", playbook="update")
    assert run.outcome("robot3")[0] == "deferred-offline"
    assert "the ROS master does not answer" in run.outcome("robot5")[1]
    assert run.plays[-1] == "What became of every host"


def test_robots_that_fail_end_the_waves_as_in_an_update(server: Server, control: Control) -> None:
    for name in ("robot2", "robot5"):
        runs(server, name)
    run = Run(control, "robot2,robot5", "--tags", STAGES, update_failure_budget=0)
    assert run.outcome("robot2")[0] == "failed"
    assert run.outcome("robot5") == (
        "unchanged",
        "not begun: robot2 failed, which is more than update_failure_budget allows",
    )


@pytest.mark.parametrize(
    ("words", "made", "not_made"),
    [
        (["--tags", "namespace"], [], ["rosops-code", "ros-master", "talker"]),
        (["--tags", "namespace,master"], ["rosops-code", "ros-master"], ["talker"]),
        (["--tags", STAGES, "--skip-tags", "apps,ready"], ["rosops-code", "ros-master"], ["talker"]),
        (["--tags", "namespace,observability", "--skip-tags", "observability"], [], ["ros-master", "talker"]),
    ],
)
def test_tags_mean_parts(
    server: Server, control: Control, words: list[str], made: list[str], not_made: list[str]
) -> None:
    run = Run(control, "robot1", *words)
    assert server.find("/api/v1/namespaces/robot-robot1"), run.output
    there = {name for name in [*made, *not_made] for kind in PLACES
             if server.find(path_of(kind, "robot-robot1", name))}  # fmt: skip
    assert there == set(made), run.output


def test_check_mode_shows_what_a_robot_would_get_and_what_its_gate_says(server: Server, control: Control) -> None:
    runs(server, "robot2")
    run = Run(control, "robot1,robot2", "--tags", STAGES, "--check", "--diff")
    assert "+++ after: Deployment robot-robot1/talker" in run.output
    assert "x.example/talker:1" in run.output
    assert run.outcome("robot1")[0] == "updated"
    assert not server.find("/api/v1/namespaces/robot-robot1")
    assert "nothing was touched: the ROS master does not answer" in run.outcome("robot2")[1]
    assert ":0" in str(server.find(path_of("Deployment", "robot-robot2", "talker")))
