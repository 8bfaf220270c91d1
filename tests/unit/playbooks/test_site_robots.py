# SPDX-License-Identifier: GPL-3.0-or-later
"""site.yml and its robots as a run has them: ansible-playbook itself, a program in the place of ssh, an API of ours."""

from __future__ import annotations

from ansible_collections.rosops.fleet.tests.unit.playbooks.control_node import Control
from ansible_collections.rosops.fleet.tests.unit.playbooks.robot_runs import KINDS, STAGES, WAVE, Run, path_of, runs
from ansible_collections.rosops.fleet.tests.unit.plugins.plugin_utils._kube.kube_server import Server


def test_who_runs_nothing_comes_first_and_who_works_in_waves(server: Server, control: Control) -> None:
    for name in ("robot2", "robot5"):
        runs(server, name)
    run = Run(control, "robot1,robot2,robot3,robot5", "--tags", STAGES, update_failure_budget=1)
    assert run.plays.count(WAVE) == 2, run.output  # a robot each: the one that was made had no wave
    # made at once, and it stays, though it does not get ready
    assert run.outcome("robot1")[0] == "failed"
    assert "what came up stays as it is" in run.outcome("robot1")[1]
    assert server.find(path_of("Deployment", "robot-robot1", "talker"))
    assert server.find(path_of("Deployment", "robot-robot1", "ros-master"))
    # at work: before a step nothing of the app is touched, and its ROS master is asked in vain
    assert run.outcome("robot2")[0] == "failed"
    assert "no app was touched: the ROS master does not answer" in run.outcome("robot2")[1]
    # robots that fail end the waves as in an update
    not_begun = "not begun: robot1, robot2 failed, which is more than update_failure_budget allows"
    assert run.outcome("robot5") == ("unchanged", not_begun)
    for name in ("robot2", "robot5"):
        assert ":0" in str(server.find(path_of("Deployment", f"robot-{name}", "talker")))
    assert run.outcome("robot3")[0] == "deferred-offline"
    assert run.output.count("UNREACHABLE!") == 1  # in the very end, for the exit status
    assert run.status == 4, run.output


def test_tags_mean_parts(server: Server, control: Control) -> None:
    """Those that are left out, too; which tags mean which parts is said by the tests of the parts."""
    run = Run(control, "robot1", "--tags", STAGES, "--skip-tags", "apps,ready")
    assert server.find("/api/v1/namespaces/robot-robot1"), run.output
    names = ("rosops-code", "ros-master", "talker")
    there = {name for name in names for kind in KINDS if server.find(path_of(kind, "robot-robot1", name))}
    assert there == {"rosops-code", "ros-master"}, run.output


def test_check_mode_shows_what_a_robot_would_get_and_what_its_gate_says(server: Server, control: Control) -> None:
    runs(server, "robot2")
    run = Run(control, "robot1,robot2", "--tags", STAGES, "--check", "--diff")
    assert "+++ after: Deployment robot-robot1/talker" in run.output
    assert "x.example/talker:1" in run.output
    assert run.outcome("robot1")[0] == "updated"
    assert not server.find("/api/v1/namespaces/robot-robot1")
    assert "nothing was touched: the ROS master does not answer" in run.outcome("robot2")[1]
    assert ":0" in str(server.find(path_of("Deployment", "robot-robot2", "talker")))
