# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Who may change a robot: one run at a time, of the robot's own fleet, from whichever control node."""

from __future__ import annotations

from pathlib import Path

import pytest
from fleet import LIMIT, Fleet

PARTS = {"site": ("--tags", "apps,ready"), "update": ()}
THROUGH_SITE = pytest.mark.promise("site.yml changes a robot at work through the same gate, and one run at a time may")


@pytest.mark.parametrize(
    ("first", "second"), [("update", "update"), ("update", "site"), pytest.param("site", "update", marks=THROUGH_SITE)]
)
def test_second_run_is_told_who_is_there(fleet: Fleet, first: str, second: str) -> None:
    """The first one is at it for most of a minute: its version never gets ready, and is taken back. Then a good one."""
    before = fleet.running()
    watch = fleet.watch()
    bad = fleet.new_version("robot1", "temperature", NEVER_CONNECT="true")
    running = fleet.playbooks.start(first, {**bad, "update_ready_timeout": 45}, "-v", *PARTS[first], *LIMIT)
    running.wait_for(r"^\[robot1\] temperature: rollout")
    run = fleet.playbooks.run(second, fleet.new_version("robot1", "add-two-ints"), *LIMIT)
    assert (run.status, run.outcomes) == (2, {"robot1": "deferred-busy"}), run
    assert "process" in run.host("robot1")["reason"], run
    ended = running.finish()
    assert (ended.status, ended.outcomes) == (2, {"robot1": "rolled-back"}), ended
    fleet.wait_settled()
    fleet.assert_still_running(before, "robot1")

    good = fleet.new_version("robot1", "temperature")
    run = fleet.playbooks.run(first, good, *PARTS[first], *LIMIT)
    assert (run.status, run.outcomes) == (0, {"robot1": "updated"}), run
    assert [step["name"] for step in run.steps("robot1")] == ["temperature"], run
    assert fleet.running()["robot1"]["temperature"] != before["robot1"]["temperature"]
    watch.assert_nothing_lost("robot1")
    fleet.accept(good)


FOREIGN = pytest.mark.promise("a run of another fleet's inventory reads and changes nothing")


@pytest.mark.parametrize("playbook", [pytest.param("update", marks=FOREIGN), "site", "rollback", "status"])
def test_cluster_of_another_fleet_is_refused(fleet: Fleet, playbook: str) -> None:
    before = fleet.cluster.versions(fleet.robots)
    foreign = {**fleet.new_version("robot1", "temperature"), "fleet_name": "staging"}
    run = fleet.playbooks.run(playbook, foreign, *LIMIT)
    assert run.status != 0 or playbook == "status", run
    assert "staging" in run.output, run.output[-3000:]
    assert "temperature" not in str(run.outcomes), run
    assert fleet.cluster.versions(fleet.robots) == before


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
