# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""One step: what it needs and leaves, what it takes up again, whatever was changed or cut off before it."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest
from ansible_collections.rosops.fleet.plugins.module_utils._common.errors import KubeError, RosError
from ansible_collections.rosops.fleet.plugins.module_utils._step.record import mark_of
from ansible_collections.rosops.fleet.plugins.plugin_utils._model.context import Robot
from ansible_collections.rosops.fleet.plugins.plugin_utils._objects.parts import PARTS
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.plan import wanted_deployments
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.settings import Settings
from ansible_collections.rosops.fleet.tests.unit.plugins.plugin_utils._update.scenarios import (
    INFRASTRUCTURE,
    OLD,
    SCENARIOS,
    begin,
    outcome_of,
    settings,
)
from ansible_collections.rosops.fleet.tests.unit.plugins.plugin_utils._update.simulated_robot import (
    VERSIONS,
    Process,
    image,
)
from ansible_collections.rosops.fleet.tests.unit.plugins.plugin_utils._update.simulation import (
    SimulatedCluster,
    SimulatedHost,
    Simulation,
)
from ansible_collections.rosops.fleet.tests.unit.plugins.plugin_utils._update.update_objects import addressed, app
from ansible_collections.rosops.fleet.tests.unit.robots import robot


@pytest.mark.parametrize("name", [name for name in SCENARIOS if name not in INFRASTRUCTURE])
def test_what_is_proven_needs_only_its_mark_taken_off(name: str) -> None:
    sim, wanted = begin(name, "good")
    sim.run(wanted, settings(soak=0.0))
    for at in range(1, len(sim.calls) + 1):
        sim, wanted = begin(name, "good")
        sim.run(wanted, settings(soak=0.0), "half-killed", at)
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
    for between in ("good", "half-the-rate"):
        for at in range(1, 26):
            sim, wanted = begin(name, between)
            sim.run(wanted, settings(), "killed", at)
            bad = SCENARIOS[name].robot(image("half-the-rate", 2))
            assert outcome_of(sim, bad).outcome == "rolled-back", at


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
    assert (
        there["spec"]
        == {item["metadata"]["name"]: item for item in wanted_deployments(addressed(wanted))}[app_name]["spec"]
    )
    assert outcome_of(sim, wanted).outcome == "unchanged"


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
    found = sim.run(wanted, settings(parts=PARTS))
    assert found is not None
    assert found.outcome == "updated"
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
    if not mapped:
        del sim.objects["ConfigMap", "robot-robot1", f"{changed}-update"]
    sim.undo_by_hand(("robot-robot1", changed))
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


def test_an_undo_by_hand_alone_costs_only_its_mark() -> None:
    sim, _wanted = installed("drain")
    sim.undo_by_hand(("robot-robot1", "planner"))
    assert outcome_of(sim, SCENARIOS["drain"].robot(OLD)).outcome == "updated"
    assert not {"graph", "hold", "rollout", "ready"} & {*sim.calls}
    assert outcome_of(sim, SCENARIOS["drain"].robot(OLD)).outcome == "unchanged"


@pytest.mark.parametrize("second", ["killed", "cancelled", "api-gone", "time-out"])
@pytest.mark.parametrize("name", ["overlap", "drain"])
def test_a_refused_apply_and_then_more_leaves_what_works_known(
    name: str, second: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The old version gets a mark on the way back: never without what says that it was proven."""
    first, _wanted = installed(name)
    wanted = SCENARIOS[name].robot(image("half-the-rate"))
    refuse = Refuse(monkeypatch)
    outcome_of(first, wanted)
    for at in range(refuse.at, len(first.calls) + 1):
        sim, _wanted = installed(name)
        refuse.again()
        sim.run(wanted, settings(), second, at)
        sim.restore()
        refuse.over()
        goal = sim.goal("/plan", 20.0)
        sim.advance(1.0)
        assert outcome_of(sim, wanted).outcome == "rolled-back", at
        assert goal.ended or name != "drain"


class Refuse:
    """The API server refuses the first apply of a version that is to be proven; `at` is the call after it."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.at, self.due = 0, True
        apply = SimulatedCluster.apply

        def refusing(cluster: SimulatedCluster, objects: Any, dry_run: bool = False) -> Any:
            new = any(mark_of(item) is not None for item in objects)
            if self.due and new:
                self.due, self.at = False, len(cluster.sim.calls) + 1
                raise KubeError("denied by a webhook")
            return apply(cluster, objects, dry_run)

        monkeypatch.setattr(SimulatedCluster, "apply", refusing)

    def again(self) -> None:
        self.due = True

    def over(self) -> None:
        self.due = False


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


@pytest.mark.parametrize(("version", "word"), [("half-the-rate", "rolled-back"), ("good", "updated")])
def test_after_a_master_was_mended_an_app_is_held_to_what_it_was(version: str, word: str) -> None:
    sim, wanted, at = silent("sensor", version)
    found = sim.run(wanted, settings(), "master-silent", at)
    assert found is not None
    assert [(step.name, step.outcome) for step in found.steps] == [("ros-master", "updated"), ("sensor", word)]


def test_after_a_master_was_mended_a_goal_is_waited_for() -> None:
    sim, wanted, at = silent("planner", "good", pattern="action", readiness={"actions": ["plan"]})
    goal = sim.goal("/plan", 60.0)
    sim.advance(1.0)
    found = sim.run(wanted, settings(), "master-silent", at)
    assert found is not None
    assert (found.outcome, goal.ended) == ("updated", True)


@pytest.mark.parametrize(("policy", "word"), [("wait", "failed"), ("defer", "failed"), ("force", "updated")])
def test_what_no_master_tells_of_is_not_changed(policy: str, word: str, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_unused: object) -> None:
        raise RosError("the ROS master does not answer")

    sim, wanted, _at = silent("sensor", "good")
    monkeypatch.setattr(SimulatedHost, "graph", refuse)
    found = outcome_of(sim, wanted, on_busy=policy)
    assert [(step.name, step.outcome) for step in found.steps] == [("ros-master", "updated"), ("sensor", word)]
    if policy != "force":
        assert found.reason == "sensor: nothing was touched: the graph is not known: the ROS master does not answer"


def test_check_mode_foresees_a_master_that_is_mended() -> None:
    sim, wanted, at = silent("sensor", "good")
    found = sim.run(wanted, settings(check=True), "master-silent", at)
    assert found is not None
    assert [step.outcome for step in found.steps] == ["updated", "updated"]


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


@pytest.mark.parametrize("sensor", [OLD, image("good", 2)], ids=["alone", "after another step"])
def test_an_action_server_that_is_down_may_be_at_work_by_now(sensor: str) -> None:
    sim = Simulation()
    sim.install(with_a_planner(OLD, OLD))
    assert outcome_of(sim, with_a_planner(OLD, image("good", 1))).outcome == "updated"
    ends_for_a_moment(sim, "planner")
    goal = sim.goal("/plan", 300.0)
    wanted = with_a_planner(sensor, image("good", 2))
    found = outcome_of(sim, wanted, on_busy="wait")
    assert (found.outcome, "/plan" in found.reason) == ("deferred-busy", True), found
    sim.advance(300.0)
    assert goal.ended
    assert outcome_of(sim, wanted).outcome == "updated"


def test_an_action_server_that_comes_back_at_rest_is_held_and_updated() -> None:
    sim = Simulation()
    sim.install(with_a_planner(OLD, OLD))
    assert outcome_of(sim, with_a_planner(OLD, image("good", 1))).outcome == "updated"
    ends_for_a_moment(sim, "planner")
    goal = sim.goal("/plan", 2.0, after=20.0)
    assert outcome_of(sim, with_a_planner(OLD, image("good", 2))).outcome == "updated"
    sim.advance(60.0)
    assert goal.ended


def test_an_action_server_that_crashes_for_good_keeps_nobody_waiting() -> None:
    sim = Simulation()
    sim.install(with_a_planner(OLD, OLD))
    assert outcome_of(sim, with_a_planner(OLD, image("good", 1))).outcome == "updated"
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
