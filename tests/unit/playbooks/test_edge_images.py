# SPDX-License-Identifier: GPL-3.0-or-later
"""Images on the edge hosts: looked at once in a run, at a cost that grows with the fleet and not with its square."""

from __future__ import annotations

import json

import pytest
from ansible_collections.rosops.fleet.tests.unit.playbooks.control_node import Control
from ansible_collections.rosops.fleet.tests.unit.playbooks.robot_runs import Run

LOGIN = """{{ lookup('ansible.builtin.pipe', 'echo x >> %s/looks; echo pull') }}"""


@pytest.mark.parametrize(("playbook", "edge2", "status"), [("site", "failed", 4), ("update", "unchanged", 0)])
def test_each_edge_host_is_looked_at_once(control: Control, playbook: str, edge2: str, status: int) -> None:
    """There is no k3s on edge2, and edge1 is off. An update goes on without their images."""
    run = Run(control, "edge1,edge2", *(["--tags", "images"] if playbook == "site" else []), playbook=playbook)
    assert run.output.count("TASK [rosops.fleet.images : Bring what is missing]") == 1
    assert run.outcome("edge1")[0] == "deferred-offline"
    assert run.outcome("edge2")[0] == edge2
    assert run.status == status


def test_a_robot_is_told_why_the_run_ended_before_its_turn(control: Control) -> None:
    """All hosts of the play have failed, so no further play begins: it was not looked at, and is not `unchanged`."""
    run = Run(control, "edge2,robot1", "--tags", "images", playbook="site")
    outcome, reason = run.outcome("robot1")
    assert (outcome, run.status) == ("failed", 2)
    assert reason.startswith("not carried on: the run ended on edge2: Say what is not there failed")


def test_credentials_are_collected_once(control: Control) -> None:
    """Of all robots, and not by every edge host anew."""
    secret = {"name": LOGIN % control.folder, "registry": "r.example", "username": "u", "password": "hunter2"}
    looks = []
    for edge in ("edge2", "edge2,edge3"):
        (control.folder / "looks").write_text("")
        extra = ("-e", json.dumps({"robot_namespace_pull_secrets": [secret]}))
        run = Run(control, edge, *extra, playbook="update")
        assert "hunter2" not in run.output
        looks.append(len((control.folder / "looks").read_text().split()))
    assert looks[0] == looks[1] > 0
