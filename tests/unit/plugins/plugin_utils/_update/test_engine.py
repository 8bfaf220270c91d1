# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Every way to hand over, with every kind of version, and every fault at every call of a run.

The simulated world holds its invariants at every moment, and each outcome's word against what is there. After the fault
the next run has to bring the robot to where a run without one would have brought it.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import pytest
from ansible_collections.rosops.fleet.plugins.plugin_utils._model.context import Robot
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.engine import Engine, Settings
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.outcome import RobotOutcome, StepResult
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.plan import Request, wanted_deployments
from ansible_collections.rosops.fleet.tests.unit.plugins.plugin_utils._update.simulated_robot import VERSIONS, image
from ansible_collections.rosops.fleet.tests.unit.plugins.plugin_utils._update.simulation import DAY, FAULTS, Simulation
from ansible_collections.rosops.fleet.tests.unit.plugins.plugin_utils._update.update_objects import app
from ansible_collections.rosops.fleet.tests.unit.robots import robot

OLD = image("good", 0)
APP_VERSIONS = (
    "good", "crashes-once", "never-starts", "never-connects", "half-the-rate", "offers-less", "crashes-at-once",
    "crashes-when-ready", "hangs",
)  # fmt: skip
MASTER_VERSIONS = ("good", "never-starts", "crashes-at-once", "crashes-when-ready")


@dataclass(frozen=True)
class Scenario:
    """A robot by the image of what is changed."""

    robot: Callable[[str], Robot]
    versions: Sequence[str] = APP_VERSIONS


def one(name: str, **more: Any) -> Callable[[str], Robot]:
    return lambda wanted: robot(app(name, wanted, placement="local", **more))


def master(wanted: str) -> Robot:
    container = {"name": "ros-master-container", "image": wanted}
    overrides = {"spec": {"template": {"spec": {"containers": [container]}}}}
    return robot(app("sensor", OLD), master={"image": OLD, "overrides": overrides})


def keeper_and_master(wanted: str) -> Robot:
    return robot(app("sensor", OLD), master={"image": wanted})


def group(wanted: str) -> Robot:
    update = {"group": "temperature"}
    return robot(app("stats", wanted, depends_on=["sensor"], update=update), app("sensor", wanted, update=update))


def two(wanted: str) -> Robot:
    return robot(app("stats", wanted, depends_on=["sensor"]), app("sensor", wanted))


def fleet(wanted: str) -> Robot:
    return robot(app("chart", wanted, pattern="service", scope="fleet"), master={"mode": "shared", "image": OLD})


SCENARIOS = {
    "overlap": Scenario(one("sensor")),
    "drain": Scenario(one("planner", pattern="action", readiness={"actions": ["plan"]})),
    "replace": Scenario(one("driver", pattern=None)),
    "master": Scenario(master, versions=MASTER_VERSIONS),
    "keeper-and-master": Scenario(keeper_and_master, versions=MASTER_VERSIONS),
    "group": Scenario(group),
    "two-steps": Scenario(two),
    "fleet": Scenario(fleet),
}
INFRASTRUCTURE = ("master", "keeper-and-master")  # whoever takes steps back for others
# all of it takes minutes: that is for ROSOPS_TEST_ALL
SHARE = 1 if os.environ.get("ROSOPS_TEST_ALL") else 16
MATRIX = [(name, version) for name, scenario in SCENARIOS.items() for version in scenario.versions]


def settings(**more: Any) -> Settings:
    return Settings(**{"ready_timeout": 30.0, "verify_seconds": 5.0, "busy_timeout": 60.0, **more})


def begin(name: str, version: str) -> tuple[Simulation, Robot]:
    """A robot on its old version, and the one that is wanted."""
    scenario, sim = SCENARIOS[name], Simulation()
    sim.install(scenario.robot(OLD))
    return sim, scenario.robot(image(version))


def converge(sim: Simulation, wanted: Robot, version: str) -> None:
    """What the next runs come to when nothing is in the way any more."""
    found = [sim.run(wanted, settings()) for _time in range(2)]
    words = [outcome.outcome for outcome in found if outcome]
    if VERSIONS[version].late and words[0] == "deferred-busy":  # it ended just as it was looked at
        words = [words[1], outcome.outcome if (outcome := sim.run(wanted, settings())) else ""]
    good, bad = [["updated", "unchanged"], ["unchanged", "unchanged"]], [["rolled-back", "rolled-back"]]
    # what crashes once is taken back by whoever sees it, and proves itself afterwards to whoever does not
    once = [["rolled-back", "updated"]]
    assert words in {"good": good, "crashes-once": [*good, *bad, *once]}.get(version, bad), found


def points(name: str, version: str, calls: Sequence[str]) -> list[tuple[str, int]]:
    """Faults and calls at which they strike; one of every `SHARE`, turned by one from version to version."""
    shift = MATRIX.index((name, version))
    found = [(fault, at) for at in range(1, len(calls) + 1) for fault in FAULTS]
    return [point for number, point in enumerate(found, shift) if number % SHARE == 0]


@pytest.mark.parametrize(("name", "version"), MATRIX)
def test_faults_at_every_call(name: str, version: str) -> None:
    sim, wanted = begin(name, version)
    clean = sim.run(wanted, settings())
    assert clean is not None
    assert clean.outcome == ("updated" if version == "good" else "rolled-back"), clean
    calls, runs = [*sim.calls], 3
    converge(sim, wanted, version)
    wrong = []
    for fault, at in points(name, version, calls):
        sim, wanted = begin(name, version)
        try:
            sim.run(wanted, settings(), fault, at)
            sim.restore()
            converge(sim, wanted, version)
        except AssertionError as error:
            wrong.append(f"{fault} at {at} ({calls[at - 1]}): {error}".splitlines()[0])
        runs += 3
    print(f"{name}, {version}: {len(calls)} calls, {runs} runs")  # shown by pytest -rP
    assert runs >= 40
    assert not wrong, "\n".join(wrong)


UNSEEN = ("good", "crashes-once", "hangs")  # what is ready stays for the next run, and a node that hangs is
ALONE = [(name, version) for name, version in MATRIX if version not in UNSEEN and name not in INFRASTRUCTURE]


@pytest.mark.parametrize(("name", "version"), ALONE)
def test_a_refused_version_stays_refused_without_anybody(name: str, version: str) -> None:
    """The control node dies anywhere and stays dead for hours: the old version serves, and then one run converges."""
    sim, wanted = begin(name, version)
    sim.run(wanted, settings())
    apps = [app.name for app in wanted.apps]
    for at in range(1, len(sim.calls) + 1):
        for fault in ("killed", "half-killed"):
            sim, wanted = begin(name, version)
            old = {app: running(sim, app) for app in apps}
            sim.skew = (-DAY, 0.0, DAY)[at % 3]
            sim.run(wanted, settings(), fault, at)
            sim.advance(3 * 3600.0)
            assert {app: running(sim, app) for app in apps} == old, (fault, at)
            assert outcome_of(sim, wanted).outcome == "rolled-back", (fault, at)
            assert {app: running(sim, app) for app in apps} == old, (fault, at)


def running(sim: Simulation, app: str) -> list[str]:
    """The versions of an app that are part of the graph."""
    return [
        pod.template for pod in sim.pods if pod.app == app and pod.up and sim.registered.get(pod.node) is pod.process
    ]


@pytest.mark.parametrize("name", [name for name in SCENARIOS if name not in INFRASTRUCTURE])
def test_what_is_proven_needs_only_its_mark_taken_off(name: str) -> None:
    sim, wanted = begin(name, "good")
    sim.run(wanted, settings())
    for at in range(1, len(sim.calls) + 1):
        sim, wanted = begin(name, "good")
        sim.run(wanted, settings(), "half-killed", at)
        step = [app.name for app in wanted.apps]
        if any(sim.promised(place, app).get("proven") for _kind, place, _name in [*sim.objects] for app in step):
            assert outcome_of(sim, wanted).outcome in ("updated", "unchanged")
            if name != "two-steps":
                assert not {"graph", "hold", "rollout", "ready"} & {*sim.calls}, (at, sim.calls)
            break
    else:
        pytest.fail("no run was cut off there")


def test_a_run_that_lost_its_lease_ends() -> None:
    """The control node sleeps for longer than a Lease lasts, and the keeper goes back meanwhile."""
    sim, wanted = begin("overlap", "never-connects")
    sim.run(wanted, settings())
    at = sim.calls.index("rollout") + 1
    sim, wanted = begin("overlap", "never-connects")
    old = running(sim, "sensor")
    found = sim.run(wanted, settings(), "asleep", at)
    assert found is not None
    assert (found.outcome, "ros-keeper had this robot" in found.reason) == ("failed", True)
    assert running(sim, "sensor") == old
    assert outcome_of(sim, wanted).outcome == "rolled-back"


def run_of(sim: Simulation, wanted: Robot, **more: Any) -> tuple[RobotOutcome, Engine]:
    found = sim.run(wanted, settings(**more))
    assert found is not None
    return found, sim.engine


def outcome_of(sim: Simulation, wanted: Robot, **more: Any) -> RobotOutcome:
    found = sim.run(wanted, settings(**more))
    assert found is not None
    return found


@pytest.mark.parametrize("name", ["overlap", "drain", "replace", "group"])
def test_another_version_after_a_run_that_was_cut_off(name: str) -> None:
    """It has to do what the last proven one did, whatever the one between them left of the graph."""
    for between in ("good", "half-the-rate"):
        for at in range(1, 19):
            sim, wanted = begin(name, between)
            sim.run(wanted, settings(), "killed", at)
            bad = SCENARIOS[name].robot(image("half-the-rate", 2))
            assert outcome_of(sim, bad).outcome == "rolled-back", at


@pytest.mark.parametrize("name", [name for name in SCENARIOS if name not in INFRASTRUCTURE])
def test_the_way_back_by_request(name: str) -> None:
    back, calls = Request(to="previous"), range(1, 16)
    for fault, at in [
        ("", 1),
        *((fault, at) for fault in FAULTS for at in calls if (at + FAULTS.index(fault)) % 8 == 0),
    ]:
        sim, wanted = begin(name, "good")
        assert outcome_of(sim, wanted).outcome == "updated"
        found = sim.run(wanted, settings(request=back), fault, at)
        if not fault:
            assert found is not None
            assert found.outcome == "updated"
            assert outcome_of(sim, SCENARIOS[name].robot(OLD)).outcome == "unchanged"
        sim.restore()
        assert outcome_of(sim, SCENARIOS[name].robot(OLD)).outcome in ("updated", "unchanged"), (fault, at)
        assert outcome_of(sim, SCENARIOS[name].robot(OLD)).outcome == "unchanged", (fault, at)


@pytest.mark.parametrize(("name", "version"), MATRIX)
def test_check_mode_writes_nothing_and_tells_what_a_run_would_do(name: str, version: str) -> None:
    sim, wanted = begin(name, version)
    found = outcome_of(sim, wanted, check=True)
    assert found.outcome == "updated"
    assert sim.engine_changes
    assert outcome_of(sim, SCENARIOS[name].robot(OLD), check=True).outcome == "unchanged"
    assert not sim.engine_changes


def test_what_the_inventory_does_not_know_is_told_and_left() -> None:
    sim, _wanted = begin("two-steps", "good")
    assert outcome_of(sim, robot(app("sensor", OLD))).outcome == "unchanged"
    assert sim.said == ["not in the inventory, left as they are: stats"]
    assert sim.deployment(("robot-robot1", "stats"))


def test_images_are_there_before_anything_is_touched() -> None:
    sim, wanted = begin("overlap", "good")
    assert outcome_of(sim, wanted).outcome == "updated"
    assert sim.calls[:7] == ["there", "read", "apply", "claim", "read", "bring", "apply"]
    assert sim.brought == [image("good")]


def test_a_new_app_is_there_or_gone() -> None:
    for version, word in (("good", "updated"), ("crashes-at-once", "rolled-back"), ("never-connects", "rolled-back")):
        for fault, at in [("", 1), *(("killed", at) for at in range(1, 15)), *(("half", at) for at in range(1, 15))]:
            sim, _wanted = begin("overlap", "good")
            wanted = robot(app("sensor", OLD), app("driver", image(version), pattern=None))
            sim.run(wanted, settings(), fault, at)
            sim.restore()
            last = [outcome_of(sim, wanted).outcome for _time in range(2)][-1]
            assert last == ("unchanged" if word == "updated" else word), (version, fault, at)
            assert bool(sim.deployment(("robot-robot1", "driver"))) == (word == "updated")


def test_what_the_keeper_did_is_told_once_and_recorded() -> None:
    sim, wanted = begin("overlap", "never-connects")
    sim.run(wanted, settings())
    at = sim.calls.index("rollout") + 1
    sim, wanted = begin("overlap", "never-connects")
    sim.run(wanted, settings(), "killed", at)
    sim.advance(600.0)
    found = outcome_of(sim, SCENARIOS["overlap"].robot(OLD))
    assert found.outcome == "unchanged"
    assert found.reason.startswith("sensor: the keeper went back from ")
    assert found.reason in sim.said
    assert '"outcome": "rolled-back"' in sim.events()
    assert "it does not get ready" in sim.events()
    assert outcome_of(sim, SCENARIOS["overlap"].robot(OLD)).reason == ""


@pytest.mark.parametrize("by_hand", ["image", "replicas"])
@pytest.mark.parametrize("name", ["overlap", "drain", "replace"])
def test_what_somebody_changed_by_hand_is_put_right_through_a_step(name: str, by_hand: str) -> None:
    sim, wanted = begin(name, "good")
    assert outcome_of(sim, wanted).outcome == "updated"
    (app_name,) = [one.name for one in wanted.apps]
    sim.change_by_hand(("robot-robot1", app_name), by_hand)
    found = outcome_of(sim, wanted)
    assert (found.outcome, f"{app_name} was changed by hand" in sim.said) == ("updated", True)
    there = sim.deployment(("robot-robot1", app_name))
    assert there is not None
    assert there["spec"] == {item["metadata"]["name"]: item for item in wanted_deployments(wanted)}[app_name]["spec"]
    assert outcome_of(sim, wanted).outcome == "unchanged"


# --- a busy robot ---------------------------------------------------------------------------------------------------


def busy(seconds: float) -> tuple[Simulation, Robot]:
    sim, wanted = begin("drain", "good")
    sim.goal("/plan", seconds)
    sim.advance(1.0)
    return sim, wanted


def test_a_goal_is_waited_for_and_those_that_come_meanwhile_are_kept_for_the_next_server() -> None:
    sim, wanted = busy(20.0)
    later = sim.goal("/plan", 2.0, after=21.5)  # when it is held
    found = outcome_of(sim, wanted)
    assert found.outcome == "updated"
    assert found.steps[0].phases["wait"] >= 15.0
    assert sim.said[0].endswith("idle, for 9 s now: busy on /planner: 1 ACTIVE"), sim.said
    sim.advance(10.0)
    assert all(goal.ended for goal in sim.goals)
    assert later.process is not None
    assert later.process.uri != sim.goals[0].process.uri  # type: ignore[union-attr]


def test_what_a_robot_sends_while_it_works_is_not_asked_of_one_at_rest() -> None:
    sim, wanted = busy(20.0)
    assert outcome_of(sim, wanted).outcome == "updated"
    assert sim.promised("robot-robot1", "planner")["topics"]["/velocity"]["rate"] is None
    assert sim.promised("robot-robot1", "planner")["topics"]["/load"]["rate"] == 100.0


@pytest.mark.parametrize("pattern", ["action", "service", None])
def test_actions_that_the_inventory_does_not_list_are_waited_for(pattern: str | None) -> None:
    scenario, sim = one("planner", pattern=pattern), Simulation()
    sim.install(scenario(OLD))
    sim.goal("/plan", 20.0)
    sim.advance(1.0)
    found = outcome_of(sim, scenario(image("good")))
    assert (found.outcome, found.steps[0].phases["wait"] >= 15.0) == ("updated", True)
    assert all(goal.ended for goal in sim.goals)


def test_a_server_that_tells_nothing_is_busy() -> None:
    sim, wanted = busy(20.0)
    sim.deaf_until = sim.time + 15.0
    assert outcome_of(sim, wanted, on_busy="defer").outcome == "deferred-busy"
    assert outcome_of(sim, wanted).outcome == "updated"
    assert all(goal.ended for goal in sim.goals)


def test_a_bad_version_is_not_taken_back_while_it_works() -> None:
    """A goal that was held went to it. It has more to do than its stop hook would wait for."""
    sim, wanted = begin("drain", "half-the-rate")
    sim.goal("/plan", 45.0, after=3.0)  # when it is held
    found = outcome_of(sim, wanted)
    assert (found.outcome, found.steps[0].phases["wait"] > 10.0) == ("rolled-back", True)
    assert all(goal.ended for goal in sim.goals)


def test_a_bad_version_that_stays_at_work_stays_marked() -> None:
    sim, wanted = begin("drain", "half-the-rate")
    goal = sim.goal("/plan", 200.0, after=3.0)
    found = outcome_of(sim, wanted)
    assert found.outcome == "deferred-busy"
    assert "at work, so it was not taken back" in found.reason
    assert "unproven" in found.reason
    sim.advance(200.0)
    assert goal.ended
    assert outcome_of(sim, wanted).outcome == "rolled-back"


def test_whoever_forces_does_not_wait_for_a_bad_version() -> None:
    sim, wanted = begin("drain", "half-the-rate")
    sim.goal("/plan", 20.0, after=20.0)
    found = outcome_of(sim, wanted, on_busy="force")
    assert (found.outcome, found.steps[0].phases["wait"]) == ("rolled-back", 0.0)


def test_a_robot_that_does_not_become_idle_is_deferred_and_as_it_was() -> None:
    sim, wanted = busy(200.0)
    found = outcome_of(sim, wanted)
    assert (found.outcome, sim.touched) == ("deferred-busy", {("ConfigMap", "robot-robot1", "robot-updates")})
    assert sim.time >= 60.0


def test_a_run_comes_back_to_a_robot_that_works() -> None:
    """Looks are short, so that others have their turn; the time for which it is waited goes on meanwhile."""
    sim, wanted = busy(45.0)
    since: dict[str, float] = {}
    for look in range(9):
        began = sim.time
        found, engine = run_of(sim, wanted, look_timeout=4.0 if look else 0.0, since=since)
        if found.outcome != "waiting":
            break
        assert sim.time - began < 12.0
        since = engine.waiting
        assert '"outcome": "running"' in sim.events()
        sim.advance(5.0)  # others
    assert (found.outcome, found.steps[0].phases["wait"] > 40.0) == ("updated", True)
    assert all(goal.ended for goal in sim.goals)


def test_a_robot_that_works_too_long_is_deferred_when_its_time_is_over() -> None:
    sim, wanted = busy(300.0)
    since: dict[str, float] = {}
    words = []
    for _look in range(20):
        found, engine = run_of(sim, wanted, look_timeout=4.0, since=since)
        words.append(found.outcome)
        since = engine.waiting
        sim.advance(5.0)
        if found.outcome != "waiting":
            break
    assert words[-1] == "deferred-busy"
    assert 4 <= len(words) <= 8
    assert 60.0 <= found.steps[0].phases["wait"] < 75.0


def test_steps_that_had_ended_before_it_waited_are_told_with_the_rest() -> None:
    sim, wanted = begin("two-steps", "good")
    first = outcome_of(sim, wanted, request=Request(only=["sensor"]))
    both = outcome_of(sim, wanted, earlier=[StepResult.from_dict(step.as_dict()) for step in first.steps])
    assert (both.outcome, [step.name for step in both.steps]) == ("updated", ["sensor", "stats"])


def test_whoever_defers_does_not_wait() -> None:
    sim, wanted = busy(30.0)
    began = sim.time
    assert outcome_of(sim, wanted, on_busy="defer").outcome == "deferred-busy"
    assert sim.time - began < 10.0


def test_whoever_forces_leaves_the_goal_to_the_stop_hook() -> None:
    sim, wanted = busy(15.0)
    assert outcome_of(sim, wanted, on_busy="force").outcome == "updated"
    assert all(goal.ended for goal in sim.goals)
    assert "hold" not in sim.calls


@pytest.mark.parametrize("fault", ["killed", "cancelled", "api-away", "robot-away", "lost-answer", "master-silent"])
def test_no_goal_is_lost_whatever_happens(fault: str) -> None:
    for at in range(1, 14):
        sim, wanted = busy(7.0)
        for after in (3.0, 10.0, 14.0, 30.0):
            sim.goal("/plan", 3.0, after)
        sim.run(wanted, settings(), fault, at)
        sim.restore()
        assert outcome_of(sim, wanted).outcome in ("updated", "unchanged")
        sim.advance(90.0)
        assert all(goal.ended for goal in sim.goals), (fault, at)
