# SPDX-License-Identifier: GPL-3.0-or-later
"""Updates that go well: the whole fleet, groups, dry runs, the way back."""

from __future__ import annotations

from typing import Any

import pytest
from fleet import ALL_AT_ONCE, LIMIT, ROBOTS, Fleet

NEXT: dict[str, Any] = {"scenario_image": "lab/apps:1.1", "lab_apps_version": "1.1"}
CLIENTS = {"temperature-stats", "add-two-ints-client", "prime-factors-client"}
APPS = {"temperature", "add-two-ints", "prime-factors", *CLIENTS}


@pytest.mark.promise("a second run changes nothing")
def test_what_site_brought_is_unchanged(fleet: Fleet) -> None:
    before = fleet.running()
    fleet.playbooks.run("site", fleet.variables).must(0, **dict.fromkeys(ROBOTS, "unchanged")).must_change_nothing()
    fleet.assert_still_running(before)


@pytest.mark.promise("check mode tells the truth and touches nothing")
def test_check_mode_says_what_would_change_and_changes_nothing(fleet: Fleet) -> None:
    before = fleet.running()
    told = dict.fromkeys(ROBOTS, "updated")
    run = fleet.update(fleet.variables, "--check", "--diff", **NEXT, **ALL_AT_ONCE).must(0, **told)
    assert run.report["check_mode"], run
    for robot in ROBOTS:
        assert {app for step in run.steps(robot) for app in step["apps"]} == APPS, run
    assert "lab/apps:1.1" in run.output, "--diff does not show the new image"
    # each robot's actions are idle or busy just now, and which of it is said
    assert run.output.count("idle now") + run.output.count("busy now") >= len(ROBOTS), run.output[-4000:]
    fleet.assert_still_running(before)


@pytest.mark.promise("an update of a whole fleet loses nothing, and a second one changes nothing")
def test_twelve_apps_on_two_robots_in_one_run(fleet: Fleet) -> None:
    watch = fleet.watch()
    run = fleet.update({**fleet.variables, **NEXT}, update_waves=[1, "100%"], update_soak=5).must(
        0, **dict.fromkeys(ROBOTS, "updated")
    )
    for robot, pods in fleet.pods().items():
        steps = [step["name"] for step in run.steps(robot)]
        assert set(steps) == APPS, run
        # providers first, though the inventory names the client before its server
        assert steps.index("add-two-ints") < steps.index("add-two-ints-client"), steps
        assert all(step["from"] != step["to"] for step in run.steps(robot)), run
        images = {app: [(pod.image, pod.ended) for pod in pods[app]] for app in APPS}
        assert images == {app: [("lab/apps:1.1", "")] for app in APPS}
    watch.assert_nothing_lost()

    before = fleet.running()
    fleet.update(fleet.variables).must(0, **dict.fromkeys(ROBOTS, "unchanged")).must_change_nothing()
    fleet.assert_still_running(before)


def test_group_is_one_step(fleet: Fleet) -> None:
    """Publisher and subscriber together: the dissertation's simultaneous update."""
    changes = fleet.changed("robot1", "temperature", update={"group": "sensing"})
    changes = fleet.changed("robot1", "temperature-stats", on=changes, update={"group": "sensing"})
    for app in ("temperature", "temperature-stats"):
        changes = fleet.new_version("robot1", app, on=changes)
    watch = fleet.watch()
    run = fleet.update(changes, *LIMIT).must(0)
    assert [(step["name"], sorted(step["apps"])) for step in run.steps("robot1")] == [
        ("sensing", ["temperature", "temperature-stats"])
    ], run
    watch.assert_nothing_lost()


@pytest.mark.promise("rollback.yml brings an earlier version back")
def test_rollback_to_the_previous_and_to_a_named_revision(fleet: Fleet) -> None:
    one = {**fleet.variables, "update_apps": ["temperature"]}
    limit = ("--limit", "robot1")
    newer = fleet.pods()["robot1"]["temperature"][0]
    others = {app: there for app, there in fleet.running()["robot1"].items() if app != "temperature"}
    watch = fleet.watch()

    fleet.playbooks.run("rollback", one, *limit).must(0, robot1="updated")
    assert fleet.pods()["robot1"]["temperature"][0].revision != newer.revision

    nowhere = fleet.playbooks.run("rollback", {**one, "update_to": "00000000"}, *limit).must(2, robot1="failed")
    assert newer.revision in nowhere.host("robot1")["reason"], f"what there is, is not named: {nowhere}"

    fleet.playbooks.run("rollback", {**one, "update_to": newer.revision}, *limit).must(0)
    assert fleet.pods()["robot1"]["temperature"][0].revision == newer.revision

    fleet.update(fleet.variables, *limit).must_change_nothing()
    assert {app: there for app, there in fleet.running()["robot1"].items() if app != "temperature"} == others
    watch.assert_nothing_lost("robot1")
