# SPDX-License-Identifier: GPL-3.0-or-later
"""Images on the edge hosts: looked at once in a run, at a cost that grows with the fleet and not with its square."""

from __future__ import annotations

from ansible_collections.rosops.fleet.tests.unit.playbooks.control_node import Control
from ansible_collections.rosops.fleet.tests.unit.playbooks.robot_runs import Run

LOOK = "TASK [rosops.fleet.images : Bring what is missing]"
LOGIN = """{{ lookup('ansible.builtin.pipe', 'echo x >> %s/looks; echo pull') }}"""


def test_each_edge_host_is_looked_at_once_and_a_robot_is_told_why_the_run_ended(control: Control) -> None:
    """There is no k3s on edge2, so no further play begins: the robot was not looked at, and is not `unchanged`."""
    run = Run(control, "edge2,robot1", "--tags", "images")
    of_edge = run.output.partition("PLAY [Images are on the edge hosts before anything needs them]")[2]
    assert (of_edge.count(LOOK), run.outcome("edge2")[0]) == (1, "failed")
    outcome, reason = run.outcome("robot1")
    assert (outcome, run.status) == ("failed", 2)
    assert reason.startswith("not carried on: the run ended on edge2: Say what is not there failed")


def test_an_update_goes_on_without_them_and_credentials_are_collected_once(control: Control) -> None:
    """Of all robots, and not by every edge host anew."""
    secret = {"name": LOGIN % control.folder, "registry": "r.example", "username": "u", "password": "hunter2"}
    looks = []
    for edge in ("edge2", "edge1,edge2,edge3"):
        (control.folder / "looks").write_text("")
        run = Run(control, edge, playbook="update", robot_namespace_pull_secrets=[secret])
        assert (run.output.count(LOOK), run.status, run.outcome("edge2")[0]) == (1, 0, "unchanged")
        assert "hunter2" not in run.output
        looks.append(len((control.folder / "looks").read_text().split()))
    assert looks[0] == looks[1] > 0
    assert run.outcome("edge1")[0] == "deferred-offline"
