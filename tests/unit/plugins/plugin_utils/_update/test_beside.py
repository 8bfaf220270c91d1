# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""What waits beside the old version: how long the app is away, and what becomes of it where no step follows."""

from __future__ import annotations

from collections.abc import Callable

import pytest
from ansible_collections.rosops.fleet.plugins.module_utils._common.errors import NotReadyError
from ansible_collections.rosops.fleet.plugins.plugin_utils._model.context import Robot
from ansible_collections.rosops.fleet.plugins.plugin_utils._update import app_change
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.beside import early
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.plan import update_plan
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.world import Calm
from ansible_collections.rosops.fleet.tests.unit.plugins.plugin_utils._update.scenarios import (
    OLD,
    SCENARIOS,
    outcome_of,
    run_of,
)
from ansible_collections.rosops.fleet.tests.unit.plugins.plugin_utils._update.simulated_robot import (
    START,
    STOP,
    Goal,
    image,
)
from ansible_collections.rosops.fleet.tests.unit.plugins.plugin_utils._update.simulation import (
    SimulatedCluster,
    Simulation,
)
from ansible_collections.rosops.fleet.tests.unit.plugins.plugin_utils._update.update_objects import app, applied, marked
from ansible_collections.rosops.fleet.tests.unit.robots import robot


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


def installed(name: str, version: str) -> tuple[Watched, Robot]:
    scenario = SCENARIOS[name]
    (app_name,) = [one.name for one in scenario.robot(OLD).apps]
    sim = Watched(app_name)
    sim.install(scenario.robot(OLD))
    sim.away = 0.0
    return sim, scenario.robot(image(version))


@pytest.mark.parametrize("name", ["drain", "replace"])
def test_the_app_is_away_for_less_long_than_a_container_takes_to_start(name: str) -> None:
    sim, wanted = installed(name, "good")
    found = outcome_of(sim, wanted)
    assert (found.outcome, "start" in found.steps[0].phases) == ("updated", True)
    assert 0 < sim.away < START


@pytest.mark.parametrize("name", ["drain", "replace"])
def test_without_it_the_app_is_away_for_that_long(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(app_change, "early", lambda *_given: [])
    sim, wanted = installed(name, "good")
    found = outcome_of(sim, wanted)
    assert (found.outcome, "start" in found.steps[0].phases) == ("updated", False)
    assert sim.away >= START


@pytest.mark.parametrize("name", ["drain", "replace"])
def test_the_app_is_never_away_for_a_version_that_cannot_be_started(name: str) -> None:
    sim, wanted = installed(name, "never-starts")
    assert outcome_of(sim, wanted).outcome == "rolled-back"
    assert sim.away == 0.0


def test_goals_of_a_launch_files_held_node_are_held_only_when_its_other_nodes_are_connected() -> None:
    sim, wanted = installed("launch-held", "good")
    held: dict[int, list[bool]] = {1: [], 2: []}  # by how many versions were Ready, at each goal
    whole = sim.send

    def send(goal: Goal) -> None:
        held[sum(pod.ready for pod in sim.of(("robot-robot1", "arm")))].append("/lift" in sim.holds)
        whole(goal)

    sim.send = send  # type: ignore[method-assign] # to look at the very moment
    goals = [sim.goal("/lift", 0.1, after=0.8 * number) for number in range(60)]
    found = outcome_of(sim, wanted)
    sim.settle(60.0)
    assert (found.outcome, "start" in found.steps[0].phases) == ("updated", True)
    assert all(goal.ended for goal in goals)
    assert (held[2][0], held[2][-1]) == (False, True)  # at first they are served, then they wait for the old one's end
    assert len(held[2]) <= 3


def test_a_launch_file_without_goals_to_hold_gets_its_pod_at_once() -> None:
    sim, wanted = installed("launch", "good")
    found = outcome_of(sim, wanted)
    assert (found.outcome, "start" in found.steps[0].phases) == ("updated", False)


def works_again(monkeypatch: pytest.MonkeyPatch, goal: Callable[[], object]) -> None:
    """The robot has got a goal when the new version waits."""
    whole = SimulatedCluster.begin

    def begin(self: SimulatedCluster, *words: object) -> None:
        whole(self, *words)  # type: ignore[arg-type] # as they come
        goal()
        self.sim.advance(0.1)

    monkeypatch.setattr(SimulatedCluster, "begin", begin)


def test_a_robot_that_went_to_work_again_is_waited_for_without_a_pod_beside_it(monkeypatch: pytest.MonkeyPatch) -> None:
    sim, wanted = installed("drain", "good")
    works_again(monkeypatch, lambda: sim.goal("/plan", 30.0))
    assert outcome_of(sim, wanted).outcome == "updated"
    assert [goal.ended for goal in sim.goals] == [True]
    assert STOP < sim.away < START + 2 * STOP + 1.0  # as without


def test_a_short_goal_that_came_meanwhile_is_no_reason_to_begin_anew(monkeypatch: pytest.MonkeyPatch) -> None:
    """Neither for who defers: the robot was at rest a moment ago."""
    sim, wanted = installed("drain", "good")
    works_again(monkeypatch, lambda: sim.goal("/plan", 4.0))
    assert outcome_of(sim, wanted, on_busy="defer").outcome == "updated"
    assert 0 < sim.away < START


@pytest.mark.parametrize("first", [0.0, 29.0])
def test_a_robot_that_rests_for_moments_only_is_not_asked_for_two_of_them(first: float) -> None:
    sim, wanted = installed("drain", "good")
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


def test_a_robot_that_went_to_work_for_long_is_left_as_it_was(monkeypatch: pytest.MonkeyPatch) -> None:
    sim, wanted = installed("drain", "good")
    works_again(monkeypatch, lambda: sim.goal("/plan", 300.0))
    found = outcome_of(sim, wanted)
    assert found.outcome == "deferred-busy"
    assert "the new version, which had not begun, was taken back" in found.reason
    assert sim.away == 0.0
    there = sim.deployment(("robot-robot1", "planner"))
    assert there is not None
    assert "updating" not in str(there["metadata"]["annotations"])


def test_a_look_ends_with_nothing_beside_the_old_version(monkeypatch: pytest.MonkeyPatch) -> None:
    sim, wanted = installed("drain", "good")
    works_again(monkeypatch, lambda: sim.goal("/plan", 40.0))
    found, engine = run_of(sim, wanted, look_timeout=4.0)
    assert (found.outcome, len(sim.of(("robot-robot1", "planner")))) == ("waiting", 1)
    monkeypatch.undo()
    sim.advance(50.0)
    assert run_of(sim, wanted, since=engine.waiting)[0].outcome == "updated"


def test_a_new_version_that_took_over_is_not_stopped_in_its_work(monkeypatch: pytest.MonkeyPatch) -> None:
    """The old one has ended by itself; whoever takes the new one back asks first what it does."""
    sim, wanted = installed("drain", "good")
    whole = SimulatedCluster.begin

    def begin(self: SimulatedCluster, *words: object) -> None:
        whole(self, *words)  # type: ignore[arg-type] # as they come
        (old, _new) = self.sim.of(("robot-robot1", "planner"))
        self.sim.crash(old, old.restarts)
        self.sim.advance(3.0)
        self.sim.goal("/plan", 20.0)
        self.sim.advance(1.0)
        raise NotReadyError("the API told nothing more")

    monkeypatch.setattr(SimulatedCluster, "begin", begin)
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
    def of(image: str, more: dict[str, object]) -> Robot:
        return robot(app("driver", image, placement="local", **{"pattern": None, **more}))

    live = applied(of("x:1", old))
    (step,) = update_plan(of("x:2", new), live).steps
    assert [item["metadata"]["name"] for item in early(step, Calm())] == ["driver"] * starts
    (resumed,) = update_plan(of("x:2", new), marked(live, "driver")).steps
    assert not early(resumed, Calm())


@pytest.mark.parametrize(("kept", "starts"), [(True, ["arm"]), (False, [])])
def test_a_launch_file_waits_beside_only_where_a_keeper_holds_its_goals(kept: bool, starts: list[str]) -> None:
    """Without one Kubernetes would hand over after ten minutes, should the run have died."""

    def of(image: str) -> Robot:
        return robot(app("arm", image, launch={"package": "arm", "file": "arm.launch", "replace": ["arm_held"]}))

    (step,) = update_plan(of("x:2"), applied(of("x:1"))).steps
    calm = Calm([{"name": "/lift", "server": "/arm_held"}])
    assert [item["metadata"]["name"] for item in early(step, calm, kept)] == starts
    assert early(step, Calm()) == []
