# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Who may change a robot: one run at a time, of the robot's own fleet, from whichever control node."""

from __future__ import annotations

from pathlib import Path

import pytest
from fleet import LIMIT, Fleet


@pytest.mark.parametrize(
    "second", ["update", pytest.param("site", marks=pytest.mark.promise("one run per robot, through every door"))]
)
def test_second_run_is_told_who_is_there(fleet: Fleet, second: str) -> None:
    """The first one is at it for a minute: its version never gets ready."""
    before, watch = fleet.running(), fleet.watch()
    bad = fleet.new_version("robot1", "temperature", NEVER_CONNECT="true")
    first = fleet.start_update(bad, *LIMIT, update_ready_timeout=60)
    first.wait_for(r"^\[robot1\] temperature: rollout")
    run = fleet.playbooks.run(second, fleet.new_version("robot1", "add-two-ints"), *LIMIT).must(
        2, robot1="deferred-busy"
    )
    assert "process" in run.host("robot1")["reason"], run
    first.finish().must(2, robot1="rolled-back")
    fleet.assert_taken_back(before)
    watch.assert_nothing_lost("robot1")


@pytest.mark.promise("a run of another fleet's inventory reads and changes nothing")
def test_cluster_of_another_fleet_is_refused_by_every_playbook(fleet: Fleet) -> None:
    before = fleet.cluster.versions(fleet.robots)
    foreign = {**fleet.new_version("robot1", "temperature"), "fleet_name": "staging"}
    for playbook in ("site", "update", "rollback", "status"):
        run = fleet.playbooks.run(playbook, foreign, *LIMIT)
        assert run.status != 0 or playbook == "status", run
        assert "staging" in run.output, run.output[-3000:]
        assert "temperature" not in str(run.outcomes), run
    assert fleet.cluster.versions(fleet.robots) == before


@pytest.mark.promise("another control node with an empty home does as well")
def test_from_an_empty_home(fleet: Fleet, tmp_path: Path) -> None:
    home = {"HOME": str(tmp_path), "ANSIBLE_HOME": str(tmp_path / "ansible")}
    wanted = fleet.new_version("robot1", "temperature")
    watch = fleet.watch()
    fleet.playbooks.run("update", wanted, *LIMIT, **home).must(0, robot1="updated")
    fleet.accept(wanted)
    looked = fleet.playbooks.run("status", wanted, "-v", "--limit", "robot1", **home).must(0)
    assert "temperature" in looked.output, looked.output[-3000:]
    fleet.playbooks.run("rollback", {**wanted, "update_apps": ["temperature"]}, "--limit", "robot1", **home).must(
        0, robot1="updated"
    )
    watch.assert_nothing_lost("robot1")
    left = [
        path for path in tmp_path.rglob("*") if path.is_file() and b"certificate-authority-data" in path.read_bytes()
    ]
    assert left == []
