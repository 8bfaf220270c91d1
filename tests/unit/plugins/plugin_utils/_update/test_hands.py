# SPDX-License-Identifier: GPL-3.0-or-later
"""Waiting for a robot: goals, actions nobody listed, messages, windows, looks that end and begin again."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import pytest
from ansible_collections.rosops.fleet.plugins.module_utils._ros.graph import PATIENCE
from ansible_collections.rosops.fleet.plugins.plugin_utils._model.context import Robot
from ansible_collections.rosops.fleet.plugins.plugin_utils._model.windows import Windows
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.hands import (
    Hands,
    Rest,
    Settings,
    World,
    look_seconds,
)
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.world import Calm, Object
from ansible_collections.rosops.fleet.tests.unit.robots import robot
from ansible_collections.rosops.fleet.tests.unit.simulated.robot import EPOCH, FOREVER, image
from ansible_collections.rosops.fleet.tests.unit.simulated.scenarios import (
    EVERY,
    OLD,
    SCENARIOS,
    begin,
    one,
    outcome_of,
    run_of,
    settings,
    spied,
)
from ansible_collections.rosops.fleet.tests.unit.simulated.world import SimulatedCluster, SimulatedHost, Simulation


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
    assert sim.said[0].endswith("idle, for 11 s now: busy on /planner: 1 ACTIVE"), sim.said
    sim.advance(10.0)
    assert all(goal.ended for goal in sim.goals)
    assert later.process is not None
    assert later.process.uri != sim.goals[0].process.uri  # type: ignore[union-attr]


def test_what_a_robot_sends_while_it_works_is_not_asked_of_one_at_rest() -> None:
    sim, wanted = busy(20.0)
    assert outcome_of(sim, wanted).outcome == "updated"
    topics = sim.promised("robot-robot1", "planner")["topics"]
    rates = {name: [sent["rate"] for sent in topics[name]["publishers"].values()] for name in ("/velocity", "/load")}
    assert rates == {"/velocity": [None], "/load": [100.0]}


def test_an_external_master_has_no_keeper_whatever_is_left_of_another_one() -> None:
    sim, wanted = begin("drain", "good")
    _outcome, own = run_of(sim, wanted)
    assert own.keeper.startswith("http://")
    own.robot = robot(master={"mode": "external", "uri": "http://192.0.2.5:11311"}, observability={"enabled": True})
    assert own.keeper == ""


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


@pytest.mark.parametrize(
    ("policy", "goal", "word", "least", "most"),
    [
        ("wait", 200.0, "deferred-busy", 60.0, 75.0),
        ("defer", 30.0, "deferred-busy", 0.0, 10.0),
        ("force", 15.0, "updated", 0.0, 60.0),
    ],
)
def test_for_how_long_a_goal_is_waited_for(policy: str, goal: float, word: str, least: float, most: float) -> None:
    """Whoever forces leaves it to the stop hook."""
    sim, wanted = busy(goal)
    began = sim.time
    assert outcome_of(sim, wanted, on_busy=policy).outcome == word
    assert least <= sim.time - began < most
    if policy == "force":
        assert "hold" not in sim.calls and sim.goals[0].ended
    else:
        assert sim.touched <= {("ConfigMap", "robot-robot1", "robot-updates")}


@pytest.mark.parametrize(("goal", "word"), [(45.0, "updated"), (300.0, "deferred-busy")])
def test_a_run_comes_back_to_a_robot_that_works(goal: float, word: str) -> None:
    """Looks are short, so that others have their turn; the time for which it is waited goes on meanwhile."""
    sim, wanted = busy(goal)
    since: dict[str, float] = {}
    for look in range(9):
        began = sim.time
        found, engine = run_of(sim, wanted, look_timeout=4.0 if look else 0.0, since=since)
        if found.outcome != "waiting":
            break
        assert sim.time - began < 12.0
        since = engine.waiting
        assert '"outcome": "waiting"' in sim.events()
        sim.advance(5.0)  # others
    assert (found.outcome, min(goal, 60.0) - 5.0 < found.steps[0].phases["wait"] < 75.0) == (word, True)
    assert sim.goals[0].ended == (word == "updated")


ENDS = ("killed", "cancelled", "api-away", "robot-away", "lost-answer", "master-silent")


@pytest.mark.parametrize("fault", ENDS)
def test_no_goal_is_lost_whatever_happens(fault: str) -> None:
    for at in range(1 + ENDS.index(fault) % EVERY, 20, EVERY):
        sim, wanted = busy(7.0)
        for after in (3.0, 10.0, 14.0, 30.0):
            sim.goal("/plan", 3.0, after)
        sim.run(wanted, settings(), fault, at)
        sim.restore()
        assert outcome_of(sim, wanted).outcome in ("updated", "unchanged")
        sim.advance(90.0)
        assert all(goal.ended for goal in sim.goals), (fault, at)


# --- when it is time ------------------------------------------------------------------------------------------------

NIGHT = {"from": "01:00", "to": "05:00"}


OPEN = 4 * 3600.0  # seconds


def by_day(name: str, seconds: float, version: str = "good") -> tuple[Simulation, Robot]:
    """A robot whose window opens in some seconds, or has opened before."""
    sim, wanted = begin(name, version)
    opens = Windows((NIGHT,)).opens_at(EPOCH)
    sim.skew = opens - seconds - EPOCH - sim.time
    return sim, replace(wanted, windows=Windows((NIGHT,)))


@pytest.mark.parametrize("name", ["overlap", "drain", "replace"])
def test_a_window_is_waited_for(name: str) -> None:
    sim, wanted = by_day(name, 40.0)
    found = outcome_of(sim, wanted)
    assert (found.outcome, 35.0 < found.steps[0].phases["wait"] < 45.0) == ("updated", True), found
    assert "it may be changed from" in sim.said[0]


@pytest.mark.parametrize("policy", ["wait", "defer"])
def test_before_its_window_nothing_is_begun(policy: str) -> None:
    sim, wanted = by_day("overlap", 4000.0)
    found = outcome_of(sim, wanted, on_busy=policy)
    assert (found.outcome, "it may be changed from 20" in found.reason) == ("deferred-busy", True)
    assert not sim.touched & {key for key in sim.objects if key[0] == "Deployment"}
    assert outcome_of(sim, wanted, check=True).outcome == "updated"
    assert any("busy now: it may be changed from" in line for line in sim.said)
    assert outcome_of(sim, wanted, on_busy="force").outcome == "updated"


def test_a_step_is_not_begun_after_its_window_but_the_way_back_is() -> None:
    sim, wanted = by_day("two-steps", 3.0 - OPEN)
    found = outcome_of(sim, wanted)
    assert [step.outcome for step in found.steps] == ["updated", "deferred-busy"]
    sim, wanted = by_day("drain", 9.0 - OPEN, "half-the-rate")
    found = outcome_of(sim, wanted)
    assert (found.outcome, wanted.windows.opens_at(sim.wall()) > sim.wall()) == ("rolled-back", True)


def test_all_that_was_held_in_a_step_is_let_go() -> None:
    """The way back asks for what the new version serves; what was held for the old one is held still."""
    sim, (one, other) = Simulation(), (SCENARIOS[name].robot(OLD) for name in ("drain", "launch-held"))
    both = replace(one, apps=(*one.apps, *other.apps))
    sim.install(both)
    hands = Hands(both, Settings(), SimulatedCluster(sim), World(SimulatedHost(sim), sim))
    hands.live, rest = hands.read(), Rest(hands, "defer", None)
    served = [{"name": name, "server": node} for node, process in sim.registered.items() for name in process.actions]
    rest.idle(Calm(served), "waits")
    rest.idle(Calm(served[:1]), "waits")
    assert {*sim.holds} == {"/plan", "/lift"}
    rest.release()
    assert not sim.holds
    rest.idle(Calm(served), "waits", hold=False)  # whoever only looks
    assert not (sim.holds or rest.held)


@pytest.mark.parametrize(
    ("busy_timeout", "again", "seconds"),
    [(600.0, False, 0.0), (600.0, True, 12.0), (60.0, True, 8.0), (0.0, True, 8.0)],
)
def test_the_first_look_takes_no_time_and_a_wait_has_about_fifty(
    busy_timeout: float, again: bool, seconds: float
) -> None:
    assert look_seconds(busy_timeout, again) == seconds


# --- what messages say ----------------------------------------------------------------------------------------------

CHARGED = {"topic": "/battery", "field": "percentage", "above": 0.4}
STEERED = {"topic": "/cmd_vel", "quiet": 12.0}


def battery(charged: float, empty: float = FOREVER) -> Callable[[float], Object]:
    return lambda time: {"percentage": 0.5 if charged <= time < empty else 0.1}


def charging(name: str, *said: dict[str, Any], seconds: float = 20.0) -> tuple[Simulation, Robot]:
    """A robot whose battery will do in some seconds; its first app says what has to be before."""
    sim, wanted = begin(name, "good")
    first = replace(wanted.apps[0], update=replace(wanted.apps[0].update, when=said))
    sim.messages = {"/battery": battery(sim.time + seconds)}
    return sim, replace(wanted, apps=(first, *wanted.apps[1:]))


@pytest.mark.parametrize("name", ["overlap", "drain", "replace"])
def test_messages_that_say_no_are_waited_for(name: str) -> None:
    sim, wanted = charging(name, CHARGED)
    found = outcome_of(sim, wanted)
    assert (found.outcome, 15.0 < found.steps[0].phases["wait"] < 25.0) == ("updated", True)
    assert sim.said[0].endswith("now: value /battery percentage above 0.4: is 0.1, not above 0.4"), sim.said
    sim, wanted = charging(name, CHARGED)
    later = outcome_of(sim, wanted, on_busy="defer")
    assert (later.outcome, "/battery percentage above 0.4" in later.reason) == ("deferred-busy", True)
    assert not sim.touched & {key for key in sim.objects if key[0] == "Deployment"}
    assert outcome_of(sim, wanted, on_busy="force").steps[0].phases.get("wait", 0.0) == 0.0
    sim, wanted = charging(name, CHARGED)
    assert outcome_of(sim, wanted, check=True).outcome == "updated"
    assert any("busy now: value /battery percentage above 0.4" in line for line in sim.said)


@pytest.mark.parametrize("seconds", [5.0, 11.0, 17.0])
@pytest.mark.parametrize("name", ["overlap", "drain", "replace", "group", "two-steps"])
def test_no_step_begins_against_what_messages_say(name: str, seconds: float) -> None:
    """A robot that changes what it says; between the look that finds all well and the change are some calls."""
    sim, wanted = begin(name, "good")
    sim.messages = {"/battery": lambda time: {"percentage": 0.9 if time % (2 * seconds) >= seconds else 0.1}}
    assert outcome_of(sim, replace(wanted, when=(CHARGED,))).outcome == "updated"
    assert sim.steps and all(one % (2 * seconds) >= seconds or one % (2 * seconds) < 3.0 for one in sim.steps)


@pytest.mark.parametrize("policy", ["wait", "defer"])
def test_what_has_to_be_quiet_is_listened_to_for_long_enough(policy: str) -> None:
    """Also by a run that waits for nobody: it could not be seen at once."""
    for name in ("overlap", "drain"):
        sim, wanted = charging(name, STEERED)
        found = outcome_of(sim, wanted, on_busy=policy)
        assert (found.outcome, found.steps[0].phases["wait"] >= 12.0) == ("updated", True), found


def test_what_a_robot_says_counts_for_all_of_it_but_for_no_way_back() -> None:
    sim, wanted = begin("two-steps", "good")
    sim.messages = {"/battery": battery(sim.time + 20.0)}
    found = outcome_of(sim, replace(wanted, when=(CHARGED,)))
    assert [step.phases.get("wait", 0.0) > 15.0 for step in found.steps] == [True, False]
    sim, wanted = begin("drain", "half-the-rate")
    emptied = replace(wanted, when=(CHARGED,))
    sim.messages = {"/battery": battery(0.0, sim.time + 8.0)}
    assert outcome_of(sim, emptied).outcome == "rolled-back"


def test_a_run_that_comes_back_listens_for_long_enough() -> None:
    sim, wanted = charging("overlap", STEERED)
    first, engine = run_of(sim, wanted, look_timeout=0.0)
    assert first.outcome == "waiting"
    again, _engine = run_of(sim, wanted, look_timeout=8.0, since=engine.waiting, begun=engine.begun)
    assert again.outcome == "updated"
    assert [step.id for step in again.steps] == [step.id for step in first.steps]


def test_a_look_lasts_until_a_silent_peer_is_known_and_the_graph_was_stable_after_that(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    sim, wanted = begin("overlap", "good")
    asked = spied(monkeypatch, SimulatedHost, "ready")
    assert outcome_of(sim, wanted, verify_seconds=30.0).outcome == "updated"
    (first, last) = asked  # between them only pods are watched
    assert (first["stable"], last["stable"]) == (1.0, 0.0)
    assert first["timeout"] > 1.0 + PATIENCE
