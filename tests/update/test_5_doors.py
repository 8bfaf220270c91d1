# SPDX-License-Identifier: GPL-3.0-or-later
"""Who may change a robot: one run at a time, of the robot's own fleet, from whichever control node."""

from __future__ import annotations

import pytest
from fleet import LIMIT, Fleet

SITE = ("--tags", "apps,ready", *LIMIT)


@pytest.mark.promise("site.yml changes a robot at work through the same gate, and one run at a time may")
def test_second_run_is_told_who_is_there(fleet: Fleet) -> None:
    """The first one is at it for half a minute: its version never gets ready, and is taken back. Then a good one."""
    before = fleet.running()
    watch = fleet.watch()
    bad = fleet.new_version("robot1", "temperature", NEVER_CONNECT="true")
    running = fleet.playbooks.start("site", {**bad, "update_ready_timeout": 30}, "-v", *SITE)
    running.wait_for(r"^\[robot1\] temperature: rollout")
    run = fleet.update(fleet.new_version("robot1", "add-two-ints"), *LIMIT).must(2, robot1="deferred-busy")
    assert "process" in run.host("robot1")["reason"], run
    running.finish().must(2, robot1="rolled-back")
    fleet.assert_taken_back(before)

    good = fleet.new_version("robot1", "temperature")
    run = fleet.playbooks.run("site", good, *SITE).must(0, robot1="updated")
    assert [step["name"] for step in run.steps("robot1")] == ["temperature"], run
    assert fleet.running()["robot1"]["temperature"] != before["robot1"]["temperature"]
    watch.assert_nothing_lost("robot1")
    fleet.accept(good)


@pytest.mark.promise("a run of another fleet's inventory reads and changes nothing")
def test_cluster_of_another_fleet_is_refused(fleet: Fleet) -> None:
    writes = {f"robot-{robot}/{app}" for robot in fleet.robots for app in fleet.cluster.on_trial(robot)}

    def versions() -> dict[str, str]:
        """Of what nothing else writes to: an app may still soak from the test before."""
        there = fleet.cluster.versions(fleet.robots).items()
        return {name: version for name, version in there if name.split("-update, ")[0] not in writes}

    before, pods = versions(), fleet.running()
    run = fleet.update(fleet.new_version("robot1", "temperature"), *LIMIT, fleet_name="staging")
    assert run.status != 0, run
    assert "staging" in run.output, run.output[-3000:]
    assert "temperature" not in str(run.outcomes), run
    assert versions() == before
    fleet.assert_still_running(pods)
