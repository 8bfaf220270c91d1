# SPDX-License-Identifier: GPL-3.0-or-later
"""A version that its run found good, and that shows later what it is, goes back by the shipped keeper."""

from __future__ import annotations

from dataclasses import replace

import pytest
from ansible_collections.rosops.fleet.plugins.module_utils._step.objects import revision_of
from ansible_collections.rosops.fleet.plugins.module_utils._step.record import ON_TRIAL, PROVEN, answer
from ansible_collections.rosops.fleet.plugins.module_utils._step.words import SOAKING
from ansible_collections.rosops.fleet.plugins.plugin_utils._model.context import Robot
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.engine import soak
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.hands import Settings, World
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.outcome import RobotOutcome
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.world import Live
from ansible_collections.rosops.fleet.tests.unit.robots import robot
from ansible_collections.rosops.fleet.tests.unit.simulated.objects import app
from ansible_collections.rosops.fleet.tests.unit.simulated.robot import image
from ansible_collections.rosops.fleet.tests.unit.simulated.scenarios import OLD, SCENARIOS, begin, outcome_of
from ansible_collections.rosops.fleet.tests.unit.simulated.world import SimulatedCluster, SimulatedHost, Simulation

HANDOFFS = ("overlap", "drain", "replace", "launch", "group")
LATE = ("crashes-after-30", "crashes-after-90", "sends-less-after-30", "loses-its-edges-after-30")
SOAK = Settings().soak
ROBOT, WHOSE = "robot-robot1", SCENARIOS["overlap"].robot(OLD)


def apps_of(name: str) -> list[str]:
    return [one.name for one in SCENARIOS[name].robot(OLD).apps]


def images(sim: Simulation, name: str) -> set[str]:
    found = (sim.objects["Deployment", ROBOT, one]["spec"]["template"]["spec"] for one in apps_of(name))
    return {pod["containers"][0]["image"] for pod in found}


def said(sim: Simulation, name: str) -> set[str]:
    """What the versions of its apps are."""
    records = Live(maps=[item for key, item in sim.objects.items() if key[0] == "ConfigMap"]).records
    return {answer(sim.objects["Deployment", ROBOT, one], records) for one in apps_of(name)}


def after(sim: Simulation, name: str) -> tuple[set[str], set[str]]:
    """Once its time is over: what the apps are, and their images."""
    sim.settle(SOAK + 60.0)
    return said(sim, name), images(sim, name)


@pytest.mark.parametrize("name", HANDOFFS)
def test_a_good_version_soaks_for_a_while_and_changes_nothing_by_that(name: str) -> None:
    sim, wanted = begin(name, "good")
    assert outcome_of(sim, wanted).outcome == "updated"
    assert said(sim, name) == {ON_TRIAL}
    assert outcome_of(sim, wanted).outcome == "unchanged"
    sim.advance(30.0)
    newer = SCENARIOS[name].robot(image("good", 2))  # the next version may come meanwhile
    assert outcome_of(sim, newer).outcome == "updated"
    pods = [pod.uid for pod in sim.pods if not pod.gone]
    assert after(sim, name) == ({PROVEN}, {image("good", 2)})
    assert sim.keeper.said[-1].endswith(f" good for {SOAK:.0f} s: proven")
    assert [pod.uid for pod in sim.pods if not pod.gone] == pods
    assert outcome_of(sim, newer).outcome == "unchanged"


# nothing of the others has a rate
RATED = ("overlap", "replace", "group")


@pytest.mark.parametrize(
    ("name", "version"),
    [(name, late) for name in HANDOFFS for late in LATE if name in RATED or late != "sends-less-after-30"],
)
def test_one_that_goes_bad_in_that_time_is_taken_back(name: str, version: str) -> None:
    sim, wanted = begin(name, version)
    sim.prove = lambda _item: None  # type: ignore[method-assign] # it is good as far as anybody can see
    sim.is_proven = lambda *_given: None  # type: ignore[method-assign]
    assert outcome_of(sim, wanted).outcome == "updated"
    assert after(sim, name) == ({PROVEN}, {OLD})
    told = " ".join(sim.keeper.said)
    assert f", within {SOAK:.0f} s of the update" in told, told
    assert '"outcome": "rolled-back"' in sim.events(), sim.events()
    assert outcome_of(sim, SCENARIOS[name].robot(OLD)).outcome == "unchanged"


def around(sim: Simulation) -> World:
    return World(SimulatedHost(sim), sim)


def waited_for(sim: Simulation, wanted: Robot) -> RobotOutcome:
    """What the next wave waits for."""
    assert outcome_of(sim, wanted).outcome == "updated"
    new = {"sensor": sim.deployment((ROBOT, "sensor"))}
    sim.quiet = lambda *_given: None  # type: ignore[method-assign] # Ansible's own process says that a task goes on
    return soak(SimulatedCluster(sim), WHOSE, {app: revision_of(one) for app, one in new.items() if one}, around(sim))


def test_the_next_wave_begins_once_it_is_proven() -> None:
    sim, wanted = begin("overlap", "good")
    assert waited_for(sim, wanted) == RobotOutcome("updated")
    assert said(sim, "overlap") == {PROVEN}
    assert soak(SimulatedCluster(sim), WHOSE, {"sensor": "another"}, around(sim)) == RobotOutcome("updated")


def test_the_next_wave_learns_that_it_was_taken_back() -> None:
    sim, wanted = begin("overlap", "crashes-after-30")
    sim.prove = lambda _item: None  # type: ignore[method-assign]
    sim.is_proven = lambda *_given: None  # type: ignore[method-assign]
    found = waited_for(sim, wanted)
    assert found.outcome == "rolled-back"
    assert found.reason.startswith("sensor: the keeper went back from "), found
    assert found.reason.endswith(": sensor ended once with exit code 1, within 120 s of the update"), found


def test_a_keeper_that_says_nothing_is_a_failure_with_words() -> None:
    sim, wanted = begin("overlap", "good")
    sim.keeper.begin = lambda: None  # type: ignore[method-assign]
    found = waited_for(sim, wanted)
    assert found.outcome == "failed"
    assert found.reason.startswith("the robot's keeper has said for 302 s neither that sensor stays good nor that")


def test_a_robot_that_is_away_meanwhile_is_not_taken_back() -> None:
    sim, wanted = begin("overlap", "good")
    assert outcome_of(sim, wanted).outcome == "updated"
    sim.robot_until = sim.time + 60.0
    sim.settle(60.0)
    assert after(sim, "overlap") == ({PROVEN}, {image("good")})


def soaking(sim: Simulation, name: str) -> set[bool]:
    """Of each of its apps whether the keeper would take it back."""
    return {SOAKING in sim.objects["Deployment", ROBOT, one]["metadata"]["annotations"] for one in apps_of(name)}


@pytest.mark.parametrize("name", ["overlap", "group"])
def test_a_version_that_was_proven_before_does_not_soak_again(name: str) -> None:
    sim, wanted = begin(name, "good")
    assert outcome_of(sim, wanted).outcome == "updated"
    assert soaking(sim, name) == {True}
    assert after(sim, name)[0] == {PROVEN}
    assert outcome_of(sim, SCENARIOS[name].robot(OLD)).outcome == "updated"
    assert said(sim, name) == {PROVEN}
    assert soaking(sim, name) == {False}


def test_of_a_step_with_one_new_version_all_soak() -> None:
    sim, wanted = begin("group", "good")
    assert outcome_of(sim, wanted).outcome == "updated"
    assert after(sim, "group")[0] == {PROVEN}
    old, newer = SCENARIOS["group"].robot(OLD), SCENARIOS["group"].robot(image("good", 2))
    assert outcome_of(sim, replace(old, apps=[old.apps[0], newer.apps[1]])).outcome == "updated"
    assert soaking(sim, "group") == {True}


def test_who_comes_first_soaks_for_nobody() -> None:
    """There is no version that the keeper could go back to."""
    sim, _wanted = begin("overlap", "good")
    more = replace(WHOSE, apps=[*WHOSE.apps, *robot(app("driver", OLD)).apps])
    assert outcome_of(sim, more).outcome == "updated"
    assert SOAKING not in sim.objects["Deployment", ROBOT, "driver"]["metadata"]["annotations"]
