# SPDX-License-Identifier: GPL-3.0-or-later
"""New versions under faults: what was proven, changed by hand, beside the old version, and back."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any
from unittest.mock import Mock

import pytest
from ansible_collections.rosops.fleet.plugins.module_utils._common.errors import NotReadyError, RosError
from ansible_collections.rosops.fleet.plugins.module_utils._step.record import mark_of
from ansible_collections.rosops.fleet.plugins.plugin_utils._model.context import Robot
from ansible_collections.rosops.fleet.plugins.plugin_utils._objects.parts import PARTS
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.hands import Settings
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.manifests import early
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.outcome import RobotOutcome, step_id
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.plan import Request
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.world import Calm
from ansible_collections.rosops.fleet.tests.unit.robots import robot
from ansible_collections.rosops.fleet.tests.unit.simulated.objects import app, applied, marked, planned, versions
from ansible_collections.rosops.fleet.tests.unit.simulated.robot import START, STOP, VERSIONS, Goal, Process, image
from ansible_collections.rosops.fleet.tests.unit.simulated.scenarios import (
    ALL,
    EVERY,
    INFRASTRUCTURE,
    MATRIX,
    OLD,
    SCENARIOS,
    begin,
    drawn,
    outcome_of,
    points,
    run_of,
    running,
    settings,
    spied,
)
from ansible_collections.rosops.fleet.tests.unit.simulated.world import (
    DAY,
    KILLS,
    SimulatedCluster,
    SimulatedHost,
    Simulation,
)

# of what is drawn; all of it takes minutes
SHARE = 1 if ALL else 13
BACKS = 8 if ALL else 29
DEAD = 3 * 3600.0 if ALL else 3600.0  # the keeper waits for minutes at most


@pytest.mark.parametrize("name", [name for name in SCENARIOS if name not in INFRASTRUCTURE])
def test_what_is_proven_needs_only_its_mark_taken_off(name: str) -> None:
    sim, wanted = begin(name, "good")
    sim.run(wanted, settings(soak=0.0))
    for fault, at in points(sim, ["half-killed"]):
        sim, wanted = begin(name, "good")
        assert sim.run(wanted, settings(soak=0.0), fault, at) is None
        step = [app.name for app in wanted.apps]
        if any(sim.promised(place, app).get("proven") for _kind, place, _name in [*sim.objects] for app in step):
            assert outcome_of(sim, wanted).outcome in ("updated", "unchanged")
            if name != "two-steps":
                assert not {"graph", "hold", "rollout", "ready"} & {*sim.calls}, (at, sim.calls)
            break
    else:
        pytest.fail("no run was cut off there")


@pytest.mark.parametrize("name", ["overlap", "drain", "replace", "group"])
def test_another_version_after_a_run_that_was_cut_off(name: str) -> None:
    """It has to do what the last proven one did, whatever the one between them left of the graph."""
    for turn, between in enumerate(("good", "half-the-rate"), [*SCENARIOS].index(name)):
        for at in range(1 + turn % EVERY, 26, EVERY):
            sim, wanted = begin(name, between)
            sim.run(wanted, settings(), "killed", at)
            bad = SCENARIOS[name].robot(image("half-the-rate", 2))
            assert outcome_of(sim, bad).outcome == "rolled-back", at


def test_a_new_app_is_there_or_gone() -> None:
    words = {"good": "updated", "crashes-at-once": "rolled-back", "never-connects": "rolled-back"}
    for turn, (version, word) in enumerate(words.items()):
        sim, _wanted = begin("overlap", "good")
        wanted = robot(app("sensor", OLD), app("driver", image(version), pattern=None))
        sim.run(wanted, settings())
        early = [point for point in points(sim, ["killed", "half"]) if point[1] <= 14]
        for fault, at in [("", 1), *drawn(early, EVERY, turn, ["half"])]:
            sim, _wanted = begin("overlap", "good")
            sim.run(wanted, settings(), fault, at)
            sim.restore()
            last = [outcome_of(sim, wanted).outcome for _time in range(2)][-1]
            assert last == ("unchanged" if word == "updated" else word), (version, fault, at)
            assert bool(sim.deployment(("robot-robot1", "driver"))) == (word == "updated")


@pytest.mark.parametrize(
    ("name", "version", "phases"),
    [
        ("overlap", "good", [
            "sensor: apply", "sensor: rollout", "sensor: verify", "waits until sensor is what was recorded",
            "waits until sensor is what was recorded", "sensor: finish",
        ]),
        ("drain", "half-the-rate", [
            "planner: rollout", "planner: wait", "planner waits until its new version is idle, to take it back",
            "planner: rollback", "waits until planner is as it was",
        ]),
        ("master", "good", [
            "ros-master: apply", "ros-master: rollout", "ros-master: verify", "waits until the new master answers",
            "waits until ros-master is what was recorded", "waits until ros-master is what was recorded",
            "ros-master: finish",
        ]),
    ],
)  # fmt: skip
def test_where_a_step_stands_is_told(
    name: str, version: str, phases: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    told = spied(monkeypatch, Simulation, "stands")
    outcome_of(*begin(name, version))
    assert [one["phase"] for one in told[-len(phases) :]] == phases


def test_a_rollout_ends_as_soon_as_its_pods_are_ready_and_none_of_them_has_ended(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Whether the version stays is seen on the graph meanwhile."""
    waits = spied(monkeypatch, SimulatedCluster, "wait")
    assert outcome_of(*begin("overlap", "good")).outcome == "updated"
    assert waits[0]["stay"] == 0.0


@pytest.mark.parametrize("check", [True, False])
def test_check_mode_says_what_a_version_may_leave_out(check: bool) -> None:
    sim, _wanted = begin("overlap", "good")
    wanted = robot(app("sensor", image("good"), update={"ignore": ["/temperature"]}))
    assert outcome_of(sim, wanted, check=check).outcome == "updated"
    assert ("sensor: /temperature may be missing or of another type" in sim.said) == check
    assert "Deployment" in {change.ref.kind for change in sim.engine_changes}


def test_a_step_says_what_it_leads_from_and_to_and_how() -> None:
    step = outcome_of(*begin("drain", "good")).steps[0]
    assert (step.name, step.handoff, [*step.before], [*step.after]) == ("planner", "drain", ["planner"], ["planner"])
    assert (step.before["planner"]["image"], step.after["planner"]["image"]) == (OLD, image("good"))


@pytest.mark.parametrize("after", ["1", "3", "5", "8", "5-once"])
@pytest.mark.parametrize("name", ["overlap", "drain", "replace"])
def test_a_version_that_ends_some_seconds_after_its_start_goes_back(name: str, after: str) -> None:
    """With what a run has by default, also if it comes up again at once."""
    sim, wanted = begin(name, f"crashes-after-{after}")
    assert outcome_of(sim, wanted, ready_timeout=Settings.ready_timeout).outcome == "rolled-back"


# --- a mark that says nothing of what runs ---------------------------------------------------------------------------


def installed(name: str, *others: dict[str, Any]) -> tuple[Simulation, Robot]:
    """By a run, so that nothing is kept beside its apps but what that leaves."""
    sim, first = Simulation(), SCENARIOS[name].robot(OLD)
    wanted = replace(first, apps=(*first.apps, *robot(*others).apps))
    assert outcome_of(sim, wanted, parts=PARTS).outcome == "updated"
    sim.watch(wanted)
    return sim, SCENARIOS[name].robot(image("good"))


@pytest.mark.parametrize("mapped", [True, False], ids=["with a record", "of a collection that left none"])
@pytest.mark.parametrize("beside", [(), (app("stats", OLD),)], ids=["alone", "beside another one"])
@pytest.mark.parametrize("version", ["good", "never-starts", "half-the-rate"])
@pytest.mark.parametrize("name", ["overlap", "drain", "replace"])
def test_an_undo_by_hand_makes_nothing_new_of_what_works(
    name: str, version: str, beside: tuple[dict[str, Any], ...], mapped: bool
) -> None:
    """`kubectl rollout undo` brings the mark of the installation back, beside an app that works."""
    sim, _wanted = installed(name, *beside)
    first = SCENARIOS[name].robot(image(version))
    wanted = replace(first, apps=(*first.apps, *robot(*beside).apps))
    (changed,) = [one.name for one in first.apps]
    sim.undo_by_hand(("robot-robot1", changed), whole=False)
    if mapped and not beside and version == "good":  # by itself it costs only its mark
        assert outcome_of(sim, SCENARIOS[name].robot(OLD)).outcome == "updated"
        assert not {"graph", "hold", "rollout", "ready"} & {*sim.calls}
        sim.undo_by_hand(("robot-robot1", changed), whole=False)
    if not mapped:
        del sim.objects["ConfigMap", "robot-robot1", f"{changed}-update"]
    goal = sim.goal("/plan", 20.0)
    sim.advance(1.0)
    found = outcome_of(sim, wanted)
    assert found.outcome == ("updated" if version == "good" else "rolled-back"), found
    assert "hold" in sim.calls or name != "drain"
    assert "graph" in sim.calls
    assert sim.deployment(("robot-robot1", changed))
    assert goal.ended or name != "drain"
    assert outcome_of(sim, wanted).outcome == ("unchanged" if version == "good" else "rolled-back")
    better = SCENARIOS[name].robot(image("good", 7))
    assert outcome_of(sim, replace(better, apps=(*better.apps, *robot(*beside).apps))).outcome == "updated"


SECOND = ("killed", "cancelled", "api-gone", "time-out")


@pytest.mark.parametrize("second", SECOND)
@pytest.mark.parametrize("name", ["overlap", "drain"])
def test_a_refused_apply_and_then_more_leaves_what_works_known(name: str, second: str) -> None:
    """The old version gets a mark on the way back: never without what says that it was proven."""
    first, _wanted = installed(name)
    wanted = SCENARIOS[name].robot(image("half-the-rate"))
    outcome_of(first, wanted)
    (app_name,) = [one.name for one in wanted.apps]
    began = first.phases.index(f"{app_name}: {'start' if name == 'drain' else 'apply'}")
    refused = first.calls.index("apply", began) + 1
    first, _wanted = installed(name)
    first.run(wanted, settings(), "refused", refused)
    for at in range(refused + 1 + SECOND.index(second) % EVERY, len(first.calls) + 1, EVERY):
        sim, _wanted = installed(name)
        sim.run(wanted, settings(), "refused", refused, (at, second))
        assert "refused at apply" in "".join(sim.said)
        sim.restore()
        goal = sim.goal("/plan", 20.0)
        sim.advance(1.0)
        assert outcome_of(sim, wanted).outcome == "rolled-back", at
        assert goal.ended or name != "drain"


# --- beside a master that does not answer ---------------------------------------------------------------------------


def with_master(name: str, version: str, number: int = 0, **more: Any) -> Robot:
    """An app, and a master of a version of its own; the keeper stays."""
    container = {"name": "ros-master-container", "image": image("good", number)}
    overrides = {"spec": {"template": {"spec": {"containers": [container]}}}}
    return robot(app(name, version, placement="local", **more), master={"image": OLD, "overrides": overrides})


def silent(name: str, version: str, **more: Any) -> tuple[Simulation, Robot, int]:
    """Both are to change; and the call in which the master has to stop answering: the graph is to be recorded."""
    first, sim, wanted = Simulation(), Simulation(), with_master(name, image(version), 1, **more)
    for one in (first, sim):
        one.install(with_master(name, OLD, **more))
    first.run(wanted, settings())
    return sim, wanted, first.calls.index("graph") + 1


@pytest.mark.parametrize(
    ("name", "version", "check", "word"),
    [
        ("sensor", "half-the-rate", False, "rolled-back"),
        ("sensor", "good", False, "updated"),
        ("sensor", "good", True, "updated"),
        ("planner", "good", False, "updated"),
    ],
)
def test_after_a_master_was_mended_an_app_is_held_to_what_it_was(
    name: str, version: str, check: bool, word: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    more: Any = {"pattern": "action", "readiness": {"actions": ["plan"]}} if name == "planner" else {}
    sim, wanted, at = silent(name, version, **more)
    goal = sim.goal("/plan", 60.0) if more else None
    sim.advance(1.0)
    asked, old = spied(monkeypatch, SimulatedHost, "ready"), sim.of(("robot-robot1", name))[0].node
    found = outcome_of(sim, wanted, "master-silent", at, check=check)
    assert [(step.name, step.outcome) for step in found.steps] == [("ros-master", "updated"), (name, word)]
    assert goal is None or goal.ended  # it is waited for
    waited_for = [one["conditions"]["nodes"] for one in asked if [*one["conditions"]] == ["nodes"]]
    assert [old.startswith(node) for [node] in waited_for] == ([] if check else [True])


REFUSED = Mock(side_effect=RosError("the ROS master does not answer"))


@pytest.mark.parametrize(("policy", "word"), [("wait", "failed"), ("force", "updated")])
def test_what_no_master_tells_of_is_not_changed(policy: str, word: str, monkeypatch: pytest.MonkeyPatch) -> None:
    sim, wanted, _at = silent("sensor", "good")
    monkeypatch.setattr(SimulatedHost, "graph", REFUSED)
    found = outcome_of(sim, wanted, on_busy=policy)
    assert [(step.name, step.outcome) for step in found.steps] == [("ros-master", "updated"), ("sensor", word)]
    if policy != "force":
        assert found.reason == "sensor: nothing was touched: the graph is not known: the ROS master does not answer"
    sim, wanted = begin("overlap", "good")  # no step of a master could mend it
    for check in (True, False):
        found = outcome_of(sim, wanted, on_busy=policy, check=check)
        assert (found.outcome, len(found.steps)) == (word, policy == "force")


# --- what the graph does not show at this moment ---------------------------------------------------------------------


def ends_for_a_moment(sim: Simulation, name: str) -> None:
    """Its container is started again just now, as after a boot, and needs some seconds to be there."""
    (pod,) = sim.of(("robot-robot1", name))
    pod.restarts = 1  # the kubelet waits longer before a second time
    sim.interrupted.add(name)
    sim.crash(pod, pod.restarts)


@pytest.mark.parametrize("version", ["half-the-rate", "offers-less", "good"])
@pytest.mark.parametrize("name", ["overlap", "launch"])
def test_an_app_that_is_down_is_held_to_what_was_proven_of_it(name: str, version: str) -> None:
    sim, first = begin(name, "good")
    assert outcome_of(sim, first).outcome == "updated"
    (app_name,) = [one.name for one in first.apps]
    ends_for_a_moment(sim, app_name)
    found = outcome_of(sim, SCENARIOS[name].robot(image(version, 2)))
    assert found.outcome == ("updated" if version == "good" else "rolled-back"), found
    assert any("is held to what was proven of this one" in text for text in sim.said), sim.said


def with_a_planner(sensor: str, planner: str) -> Robot:
    return robot(
        app("sensor", sensor, placement="local"),
        app("planner", planner, placement="local", pattern="action", readiness={"actions": ["plan"]}),
    )


def with_a_proven_planner() -> Simulation:
    sim = Simulation()
    sim.install(with_a_planner(OLD, OLD))
    assert outcome_of(sim, with_a_planner(OLD, image("good", 1))).outcome == "updated"
    return sim


@pytest.mark.parametrize("sensor", [OLD, image("good", 2)], ids=["alone", "after another step"])
def test_an_action_server_that_is_down_may_be_at_work_by_now(sensor: str) -> None:
    sim = with_a_proven_planner()
    ends_for_a_moment(sim, "planner")
    goal = sim.goal("/plan", 300.0)
    wanted = with_a_planner(sensor, image("good", 2))
    found = outcome_of(sim, wanted, on_busy="wait")
    assert (found.outcome, "/plan" in found.reason) == ("deferred-busy", True), found
    sim.advance(300.0)
    assert goal.ended
    assert outcome_of(sim, wanted).outcome == "updated"


def test_an_action_server_that_crashes_for_good_keeps_nobody_waiting() -> None:
    sim = with_a_proven_planner()
    (pod,) = sim.of(("robot-robot1", "planner"))
    pod.version = VERSIONS["never-starts"]  # its image was spoilt
    pod.restarts = 5
    sim.crash(pod, pod.restarts)
    assert outcome_of(sim, with_a_planner(OLD, image("good", 2)), on_busy="defer").outcome == "updated"


def test_a_subscriber_that_comes_during_a_step_is_owed_its_messages_by_the_next() -> None:
    sim, wanted = begin("two-steps", "good")
    late = Process("/late", "http://10.42.1.2:4000/", subscriptions=["/mean"])
    sim.others.append(late)
    sim.later(8.0, lambda: sim.register(late))
    found = outcome_of(sim, wanted)
    assert [step.name for step in found.steps] == ["sensor", "stats"]
    assert found.steps[1].started - found.steps[0].started > 8.0
    assert ["/mean", "/late"] in [edge[1:] for edge in sim.promised("robot-robot1", "stats")["edges"]]


@pytest.mark.parametrize(
    ("more", "measured"),
    [
        ([], [["sensor", "stats"]]),
        (
            [
                app("planner", OLD, pattern="action", readiness={"actions": ["plan"]}, depends_on=["stats"]),
                app("chart", OLD, depends_on=["planner"]),
            ],
            [["chart", "sensor", "stats"], ["planner"]],
        ),
    ],
)
def test_rates_of_steps_that_wait_for_nobody_are_measured_at_once(
    more: list[dict[str, Any]], measured: list[list[str]], monkeypatch: pytest.MonkeyPatch
) -> None:
    """An action's server is measured in the rest that its own step waits for; nobody is measured twice."""
    before, after = versions(app("sensor"), app("stats", depends_on=["sensor"]), *more)
    asked = spied(monkeypatch, SimulatedHost, "graph")
    sim = Simulation()
    sim.install(before)
    found = outcome_of(sim, after)
    assert (found.outcome, len(found.steps)) == ("updated", 2 + len(more)), found.reason
    heard = [one["nodes"] for one in asked if one["nodes"]]
    assert len(asked) - len(heard) == len(found.steps)  # what is known is not asked again before the first one
    assert [[node.strip("/").partition("_")[0] for node in nodes] for nodes in heard] == measured


# --- rates that nobody can tell --------------------------------------------------------------------------------------


def test_a_step_waits_until_the_rate_of_very_many_messages_can_be_told() -> None:
    """Else any version would do: there is nothing to hold it to."""
    sim, wanted = begin("overlap", "half-the-rate")
    sim.uneven_until, before = sim.time + 30.0, running(sim, "sensor")
    found, engine = run_of(sim, wanted, look_timeout=0.0)
    assert (found.outcome, [*engine.waiting]) == ("waiting", ["sensor"])
    assert "sends 500 messages a second on /temperature, too unevenly to tell its rate" in found.reason
    assert running(sim, "sensor") == before
    sim.advance(30.0)
    assert outcome_of(sim, wanted, look_timeout=8.0, since=engine.waiting).outcome == "rolled-back"


@pytest.mark.parametrize(
    ("rates", "more", "word"),
    [
        ({"temperature": 400}, {}, "updated"),
        ({}, {"on_busy": "defer"}, "deferred-busy"),
        ({}, {"on_busy": "force"}, "updated"),
        ({}, {"on_busy": "defer", "check": True}, "updated"),
    ],
)
def test_whoever_does_not_wait_for_a_rate(rates: dict[str, int], more: dict[str, Any], word: str) -> None:
    sim, _wanted = begin("overlap", "good")
    sim.uneven_until = sim.time + 1e9
    wanted = robot(app("sensor", image("good"), placement="local", update={"rates": rates}))
    assert outcome_of(sim, wanted, **more).outcome == word
    told = any("WARNING: " in text and "too unevenly" in text for text in sim.said)
    assert told == (word == "updated" and not rates)


def test_what_was_recorded_for_a_version_that_was_taken_back_still_counts() -> None:
    sim, wanted = begin("overlap", "half-the-rate")
    assert outcome_of(sim, wanted).outcome == "rolled-back"
    sim.uneven_until = sim.time + 1e9
    for number, version in enumerate(("half-the-rate", "good", "half-the-rate"), 2):
        found = outcome_of(sim, SCENARIOS["overlap"].robot(image(version, number)))
        assert found.outcome == ("updated" if version == "good" else "rolled-back"), number


# --- beside the old version -------------------------------------------------------------------------------------------


class Watched(Simulation):
    """How long there was no process of the app."""

    def __init__(self, name: str) -> None:
        super().__init__()
        self.name, self.away, self.since = name, 0.0, -1.0

    def invariants(self) -> None:
        super().invariants()
        there = any(pod.app == self.name and pod.up for pod in self.pods)
        if not there and self.since < 0:
            self.since = self.time
        elif there and self.since >= 0:
            self.away, self.since = self.away + self.time - self.since, -1.0


def watched(name: str, version: str) -> tuple[Watched, Robot]:
    scenario = SCENARIOS[name]
    (app_name,) = [one.name for one in scenario.robot(OLD).apps]
    sim = Watched(app_name)
    sim.install(scenario.robot(OLD))
    sim.away = 0.0
    return sim, scenario.robot(image(version))


@pytest.mark.parametrize("name", ["drain", "replace", "launch"])
@pytest.mark.parametrize(("version", "word"), [("good", "updated"), ("never-starts", "rolled-back")])
def test_an_app_is_away_for_less_long_than_a_container_takes_to_start(name: str, version: str, word: str) -> None:
    """And never for a version that cannot be started. What overlaps, without goals to hold, gets its pod at once."""
    sim, wanted = watched(name, version)
    found = outcome_of(sim, wanted)
    assert (found.outcome, "start" in found.steps[0].phases) == (word, name != "launch")
    assert (0 < sim.away < START) if version == "good" and name != "launch" else sim.away == 0.0


def test_goals_of_a_launch_files_held_node_are_held_only_when_its_other_nodes_are_connected() -> None:
    sim, wanted = watched("launch-held", "good")
    held: dict[int, list[bool]] = {1: [], 2: []}  # by how many versions were Ready, at each goal
    whole = sim.send

    def send(goal: Goal) -> None:
        held[sum(pod.ready for pod in sim.of(("robot-robot1", "arm")))].append("/lift" in sim.holds)
        whole(goal)

    sim.send = send  # type: ignore[method-assign] # to look at the very moment
    goals = [sim.goal("/lift", 0.1, after=0.8 * number) for number in range(60)]
    found = outcome_of(sim, wanted)
    sim.settle(60.0)
    assert found.outcome == "updated"
    assert [*found.steps[0].phases] == ["wait", "record", "start", "apply", "rollout", "verify"]
    assert all(goal.ended for goal in goals)
    assert (held[2][0], held[2][-1]) == (False, True)  # at first they are served, then they wait for the old one's end
    assert len(held[2]) <= 3


def works_again(monkeypatch: pytest.MonkeyPatch, goal: Callable[[], object]) -> None:
    """The robot has got a goal when the new version waits."""
    whole = SimulatedCluster.wait

    def wait(self: SimulatedCluster, *words: Any, **more: Any) -> None:
        whole(self, *words, **more)
        if more.get("begun"):
            goal()
            self.sim.advance(0.1)

    monkeypatch.setattr(SimulatedCluster, "wait", wait)


@pytest.mark.parametrize(
    ("goal", "how", "word", "away"),
    [
        (30.0, {}, "updated", (STOP, START + 2 * STOP + 1.0)),  # waited for without a pod beside it, as ever
        (4.0, {"on_busy": "defer"}, "updated", (0.0, START)),  # whoever defers, too: it was at rest a moment ago
        (300.0, {}, "deferred-busy", None),
        (40.0, {"look_timeout": 4.0}, "waiting", None),
    ],
)
def test_a_robot_that_went_to_work_again(
    goal: float, how: Any, word: str, away: tuple[float, float] | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    sim, wanted = watched("drain", "good")
    works_again(monkeypatch, lambda: sim.goal("/plan", goal))
    found, engine = run_of(sim, wanted, **how)
    assert (found.outcome, sim.goals[0].ended, len(sim.of(("robot-robot1", "planner")))) == (word, bool(away), 1)
    if away:
        assert away[0] < sim.away < away[1]
    else:  # it is left as it was
        assert sim.away == 0.0
        assert "the new version, which had not begun, was taken back" in found.reason
        assert "updating" not in str(sim.objects["Deployment", "robot-robot1", "planner"]["metadata"]["annotations"])
        monkeypatch.undo()
        sim.advance(goal)
        assert outcome_of(sim, wanted, since=engine.waiting).outcome == "updated"


@pytest.mark.parametrize("goal", [30.0, 4.0])
def test_a_subscriber_that_comes_while_a_step_waits_is_owed_its_messages(
    goal: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of a robot at work nobody knows what came; what comes within seconds is seen by the next step."""
    sim, wanted = watched("drain", "good")
    late = Process("/late", "http://10.42.1.2:4000/", subscriptions=["/load"])
    sim.others.append(late)

    def goes() -> None:
        sim.goal("/plan", goal)
        sim.later(2.0, lambda: sim.register(late))

    works_again(monkeypatch, goes)
    assert outcome_of(sim, wanted).outcome == "updated"
    owed = [edge[1:] for edge in sim.promised("robot-robot1", "planner")["edges"]]
    assert (["/load", "/late"] in owed) == (goal > 5.0), owed


@pytest.mark.parametrize("goal", [0.0, 15.0])
def test_what_a_robot_at_work_sends_is_no_measure_of_who_is_forced(goal: float) -> None:
    sim, wanted = begin("drain", "good")
    if goal:
        sim.goal("/plan", goal)
    assert outcome_of(sim, wanted, on_busy="force").outcome == "updated"
    assert ("rates" in sim.calls) == (not goal)


@pytest.mark.parametrize("first", [0.0, 29.0])
def test_a_robot_that_rests_for_moments_only_is_not_asked_for_two_of_them(first: float) -> None:
    sim, wanted = watched("drain", "good")
    for number in range(12):
        sim.goal("/plan", 30.0, after=30.8 * number)
    sim.advance(first)
    since: dict[str, float] = {}
    for look in range(6):
        found, engine = run_of(sim, wanted, look_timeout=15.0 if look else 0.0, since=since)
        since = engine.waiting
        if found.outcome != "waiting":
            break
    assert found.outcome == "updated"
    sim.settle(500.0)
    assert all(goal.ended for goal in sim.goals)


def test_a_new_version_that_took_over_is_not_stopped_in_its_work(monkeypatch: pytest.MonkeyPatch) -> None:
    """The old one has ended by itself; whoever takes the new one back asks first what it does."""
    sim, wanted = watched("drain", "good")

    def goal() -> None:
        (old, _new) = sim.of(("robot-robot1", "planner"))
        sim.crash(old, old.restarts)
        sim.advance(3.0)
        sim.goal("/plan", 45.0)  # for longer than a pod's stop hook waits
        sim.advance(1.0)
        raise NotReadyError("the API told nothing more")

    works_again(monkeypatch, goal)
    assert outcome_of(sim, wanted).outcome == "rolled-back"
    assert [goal.ended for goal in sim.goals] == [True]


@pytest.mark.parametrize(
    ("old", "new", "starts"),
    [
        ({}, {}, True),
        ({}, {"node_name": "other"}, False),  # it would not find the old one
        ({"pattern": "pubsub"}, {}, False),  # this, too, has had another name
        ({}, {"pattern": "pubsub"}, False),  # it waits for nobody
        ({}, {"readiness": {"nodes": False}}, False),  # nobody knows the names of what it starts
        ({}, {"host_network": True}, False),
        ({}, {"hooks": "none"}, False),
        ({}, {"hooks": "sidecar"}, True),
    ],
)
def test_who_starts_beside_the_old_version(old: dict[str, object], new: dict[str, object], starts: bool) -> None:
    both: dict[str, Any] = {"placement": "local", "pattern": None}
    before, after = (robot(app("driver", image, **{**both, **more})) for image, more in (("x:1", old), ("x:2", new)))
    live = applied(before)
    (step,) = planned(after, live).steps
    assert [item["metadata"]["name"] for item in early(step, Calm())] == ["driver"] * starts
    (resumed,) = planned(after, marked(live, "driver")).steps
    assert not early(resumed, Calm())


@pytest.mark.parametrize(("kept", "starts"), [(True, ["arm"]), (False, [])])
def test_a_launch_file_waits_beside_only_where_a_keeper_holds_its_goals(kept: bool, starts: list[str]) -> None:
    """Without one Kubernetes would hand over after ten minutes, should the run have died."""

    before, after = versions(app("arm", launch={"package": "arm", "file": "arm.launch", "replace": ["arm_held"]}))
    (step,) = planned(after, applied(before)).steps
    calm = Calm([{"name": "/lift", "server": "/arm_held"}])
    assert [item["metadata"]["name"] for item in early(step, calm, kept)] == starts
    assert early(step, Calm()) == []


# --- the way back -----------------------------------------------------------------------------------------------------

UNSEEN = ("good", "crashes-once", "hangs")  # what is ready stays for the next run, and a node that hangs is


ALONE = [(name, version) for name, version in MATRIX if version not in UNSEEN and name not in INFRASTRUCTURE]


@pytest.mark.parametrize(("name", "version"), ALONE)
def test_a_refused_version_stays_refused_without_anybody(name: str, version: str) -> None:
    """The control node dies anywhere and stays dead for hours: the old version serves, and then one run converges."""
    sim, wanted = begin(name, version)
    sim.run(wanted, settings())
    apps = [app.name for app in wanted.apps]
    # one call of every SHARE, turned by one from version to version
    for fault, at in drawn(points(sim, KILLS), SHARE, ALONE.index((name, version))):
        sim, wanted = begin(name, version)
        old = {app: running(sim, app) for app in apps}
        sim.skew = (-DAY, 0.0, DAY)[at % 3]
        assert sim.run(wanted, settings(), fault, at) is None
        sim.advance(DEAD)
        assert {app: running(sim, app) for app in apps} == old, (fault, at)
        assert outcome_of(sim, wanted).outcome == "rolled-back", (fault, at)
        assert {app: running(sim, app) for app in apps} == old, (fault, at)


@pytest.mark.parametrize("name", [name for name in SCENARIOS if name not in INFRASTRUCTURE])
def test_the_way_back_by_request(name: str) -> None:
    def back(fault: str = "", at: int = 0) -> tuple[Simulation, RobotOutcome | None]:
        sim, wanted = begin(name, "good")
        assert outcome_of(sim, wanted).outcome == "updated"
        return sim, sim.run(wanted, settings(request=Request(to="previous")), fault, at)

    sim, found = back()
    assert found and found.outcome == "updated"
    faults, old = drawn(points(sim), BACKS, [*SCENARIOS].index(name)), SCENARIOS[name].robot(OLD)
    assert outcome_of(sim, old).outcome == "unchanged"
    for fault, at in faults:
        sim, _found = back(fault, at)
        sim.restore()
        assert outcome_of(sim, old).outcome in ("updated", "unchanged"), (fault, at)
        assert outcome_of(sim, old).outcome == "unchanged", (fault, at)


@pytest.mark.parametrize(
    ("goal", "fault", "word", "reason"),
    [
        (45.0, "", "rolled-back", ""),
        (200.0, "", "deferred-busy", "the new version is at work, so it was not taken back"),
        (45.0, "master-silent", "rolled-back", ""),
        (45.0, "master-gone", "failed", "nobody can tell whether its new version is at work"),
    ],
)
def test_a_bad_version_is_not_taken_back_while_it_works(goal: float, fault: str, word: str, reason: str) -> None:
    """A goal that was held went to it. It has more to do than its stop hook would wait for."""
    calls: list[str] = []
    for strikes in ("", fault):  # when the new version is to be looked at
        sim, wanted = begin("drain", "half-the-rate")
        sent = sim.goal("/plan", goal, after=8.0)  # when it is held
        at = len(calls) - calls[::-1].index("graph") if calls else 0
        found = outcome_of(sim, wanted, strikes, at)
        calls = [*sim.calls]
    assert (found.outcome, reason in found.reason) == (word, True), found
    assert any("planner waits until its new version is idle, to take it back" in text for text in sim.said) or fault
    assert sent.ended if word == "rolled-back" else "unproven" in found.reason
    sim.restore()
    sim.advance(goal)
    assert sent.ended
    assert outcome_of(sim, wanted).outcome == "rolled-back"


def test_the_record_says_that_a_run_waits_for_a_bad_version_at_work() -> None:
    """It comes back to the robot, which nobody has meanwhile: nobody closes the step."""
    sim, wanted = begin("drain", "half-the-rate")
    sim.goal("/plan", 45.0, after=8.0)
    found, engine = run_of(sim, wanted, look_timeout=0.0)
    sim.advance(15.0)
    assert found.outcome == "waiting"
    assert '"outcome": "waiting"' in sim.events() and "it was not taken back" in sim.events()
    assert outcome_of(sim, wanted, look_timeout=8.0, since=engine.waiting).outcome == "rolled-back"


@pytest.mark.parametrize(("tolerance", "word"), [(0.6, "updated"), (0.4, "rolled-back")])
def test_a_rate_may_fall_by_what_the_inventory_says(tolerance: float, word: str) -> None:
    sim, wanted = begin("overlap", "half-the-rate")
    sim.watched = set()
    sim.prove = lambda _item: None  # type: ignore[method-assign] # elsewhere it is a bad version
    sim.is_proven = lambda *_given: None  # type: ignore[method-assign]
    assert outcome_of(sim, wanted, rate_tolerance=tolerance).outcome == word


def test_a_wait_goes_on_from_where_an_earlier_look_began_it() -> None:
    sim, wanted = begin("drain", "good")
    sim.goal("/plan", 300.0)
    sim.advance(1.0)
    began = sim.time
    found, engine = run_of(sim, wanted, since={"planner": began - 50.0})
    assert (found.outcome, engine.waiting) == ("deferred-busy", {})
    assert 5.0 < sim.time - began < 30.0


def test_whoever_forces_does_not_wait_for_a_bad_version() -> None:
    sim, wanted = begin("drain", "half-the-rate")
    sim.goal("/plan", 20.0, after=20.0)
    found = outcome_of(sim, wanted, on_busy="force")
    assert (found.outcome, found.steps[0].phases.get("wait")) == ("rolled-back", None)
    assert found.steps[0].phases["rollback"] > 0.0


def test_a_new_master_that_is_reached_by_every_second_question_gets_the_registrations(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """As long as its Service knows of the old pod, too."""
    sim, wanted = begin("master", "good")
    register = Mock(side_effect=[RosError("the ROS master does not answer: no answer within 2 s"), None])
    monkeypatch.setattr(SimulatedHost, "register", register)
    assert outcome_of(sim, wanted).outcome == "updated"
    first, again = register.call_args_list
    assert again == first


@pytest.mark.parametrize("name", ["drain", "replace"])
def test_the_way_back_does_not_wait_for_registrations(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """They come with the old version again; and without it nothing serves."""
    sim, wanted = begin(name, "never-starts")
    monkeypatch.setattr(SimulatedHost, "register", REFUSED)
    assert outcome_of(sim, wanted).outcome == "rolled-back"
    assert any("the ROS master does not answer" in text for text in sim.said)


def test_the_way_back_is_about_what_this_step_changed(monkeypatch: pytest.MonkeyPatch) -> None:
    """Other nodes of the robot are none of it, and neither is what another run marked."""
    sim, wanted = begin("two-steps", "half-the-rate")
    registered, reaped = (spied(monkeypatch, SimulatedHost, name) for name in ("register", "reap"))
    written = spied(monkeypatch, Simulation, "put")
    (old,) = sim.of(("robot-robot1", "sensor"))
    found = outcome_of(sim, wanted)
    step = found.steps[-1]
    (new,) = [pod for pod in sim.pods if pod.app == "sensor" and pod is not old]
    assert (found.outcome, step.name) == ("rolled-back", "sensor")
    base, base_of_new = (pod.node.rpartition("_")[0] for pod in (old, new))
    assert [one["nodes"] for one in registered] == [[base]]
    assert [(one["nodes"], one["hosts"]) for one in reaped] == [([base_of_new], [f"10.42.0.{new.uid}"])]
    assert {mark.run for one in written if (mark := mark_of(one["item"]))} == {str(int(step.started))}


def test_what_a_bad_version_registered_goes_with_it_though_no_keeper_is_there(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Simulation, "reap", lambda _sim, _process: None)
    sim, wanted = begin("overlap", "hangs")
    assert outcome_of(sim, wanted).outcome == "rolled-back"
    assert [node for node, process in sim.registered.items() if not process.alive] == []


def test_whether_a_version_runs_unproven_is_said_as_far_as_it_is_known() -> None:
    """The API goes for good: what is written whole runs; of an apply that it cut off nobody knows."""
    sim, wanted = begin("overlap", "good")
    sim.run(wanted, settings())
    for phase, words in (("apply", "; it may run unproven"), ("rollout", "; it runs unproven")):
        again, at = begin("overlap", "good")[0], sim.phases.index(f"sensor: {phase}") + 1
        found = outcome_of(again, wanted, "api-gone", at)
        assert words in found.reason, (phase, found.reason)
        (step,) = found.steps
        assert step.id == step_id("robot1", ["sensor"], step.started)
