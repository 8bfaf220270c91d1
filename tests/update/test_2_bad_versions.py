# SPDX-License-Identifier: GPL-3.0-or-later
"""Bad versions: refused before anything is touched, or taken back while the old one works on."""

from __future__ import annotations

from typing import Any

import pytest
from fleet import ALL_AT_ONCE, LIMIT, Fleet

# A version that never gets ready is given up after this time.
PATIENCE: dict[str, Any] = {"update_ready_timeout": 30}


def test_image_that_is_nowhere_is_refused(fleet: Fleet) -> None:
    """One robot lacks it on itself, the other one at the edge."""
    before, watch = fleet.running(), fleet.watch()
    bad = fleet.changed("robot1", "temperature", image="lab/apps:nowhere")
    bad = fleet.changed("robot2", "temperature-stats", on=bad, image="lab/apps:nowhere")
    run = fleet.update(bad, **ALL_AT_ONCE).must(2, robot1="failed", robot2="failed")
    for robot in ("robot1", "robot2"):
        assert "nothing was touched" in run.host(robot)["reason"], run
        assert "lab/apps:nowhere" in run.host(robot)["reason"], run
    fleet.assert_still_running(before)
    watch.assert_nothing_lost(goals=False)


def test_image_whose_programs_cannot_start(fleet: Fleet) -> None:
    before, watch = fleet.running(), fleet.watch()
    bad = {**fleet.changed("robot1", "temperature", image="lab/apps:broken"), "lab_apps_version": "broken"}
    fleet.update(bad, *LIMIT, **PATIENCE).must(2, robot1="rolled-back")
    fleet.assert_taken_back(before)
    watch.assert_nothing_lost("robot1", goals=False)


def test_action_server_whose_program_is_not_there(fleet: Fleet) -> None:
    """It shows beside the old one, which is never stopped for it."""
    before, watch = fleet.running(), fleet.watch()
    bad = fleet.changed("robot1", "prime-factors", command=["/nowhere/server"])
    run = fleet.update(bad, *LIMIT, **PATIENCE).must(2, robot1="rolled-back")
    assert "/nowhere/server" in run.host("robot1")["reason"], run
    fleet.assert_taken_back(before)
    watch.assert_nothing_lost("robot1")


@pytest.mark.promise("a version that goes bad later is taken back, and ends the waves")
def test_version_that_crashes_later(fleet: Fleet) -> None:
    """The run finds it good. The robot's keeper watches on, and the second robot's wave waits for what it sees."""
    before = fleet.revisions()
    both = fleet.new_version("robot1", "add-two-ints", CRASH_AFTER=30)
    both = fleet.new_version("robot2", "add-two-ints", on=both)
    run = fleet.update(both, update_waves=[1, "100%"], update_failure_budget=0).must(
        2, robot1="rolled-back", robot2="unchanged"
    )
    assert "add-two-ints ended once with exit code 1, within 120 s of the update" in run.host("robot1")["reason"], run
    assert "not begun: robot1 failed" in run.host("robot2")["reason"], run
    fleet.wait_settled()
    assert fleet.revisions() == before
    fleet.watch().assert_nothing_lost("robot1", goals=False)


def test_service_that_crashes_after_it_registered(fleet: Fleet) -> None:
    """The last registration wins in ROS 1, so a request may meet the new server just as it dies. That is not hidden."""
    before, revisions = fleet.running(), fleet.revisions()["robot1"]
    watch = fleet.watch()
    bad = fleet.new_version("robot1", "add-two-ints", CRASH_AFTER=0.7)  # while both run
    fleet.update(bad, *LIMIT, **PATIENCE, update_verify_seconds=10).must(2, robot1="rolled-back")
    fleet.wait_settled()
    assert fleet.revisions()["robot1"] == revisions
    [losses] = watch.losses("robot1", goals=False).values()
    assert losses.lost == 0, losses
    fleet.watch().assert_nothing_lost("robot1", goals=False)  # the old version answers again
    if fleet.running()["robot1"]["add-two-ints"] == before["robot1"]["add-two-ints"]:
        # until the old one is registered again, requests go to the dead one
        assert len(losses.failed) <= 600, losses
