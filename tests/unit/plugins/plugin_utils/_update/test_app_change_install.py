# SPDX-License-Identifier: GPL-3.0-or-later
"""What site.yml does with a robot: one that runs nothing gets all at once, one at work changes through the gate."""

from __future__ import annotations

from typing import Any
from unittest.mock import Mock

import pytest
from ansible_collections.rosops.fleet.plugins.module_utils._step import update_record, words
from ansible_collections.rosops.fleet.plugins.plugin_utils._model.context import Robot
from ansible_collections.rosops.fleet.plugins.plugin_utils._objects.namespace import storage_objects
from ansible_collections.rosops.fleet.plugins.plugin_utils._objects.parts import PARTS
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.outcome import RobotOutcome
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.plan import Request
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.world import HeldError
from ansible_collections.rosops.fleet.tests.unit.robots import robot
from ansible_collections.rosops.fleet.tests.unit.simulated.objects import app
from ansible_collections.rosops.fleet.tests.unit.simulated.robot import image
from ansible_collections.rosops.fleet.tests.unit.simulated.scenarios import (
    ALL,
    drawn,
    outcome_of,
    points,
    settings,
    spied,
)
from ansible_collections.rosops.fleet.tests.unit.simulated.world import KILLS, SimulatedCluster, Simulation

GOOD, BETTER, BAD = image("good", 0), image("good", 1), image("never-connects")
SHARE = 1 if ALL else 15
NAMESPACE = "robot-robot1"
VOLUME = {"name": "logs"}
CHARGED = {"topic": "/battery", "field": "percentage", "above": 0.4}
SITE: dict[str, Any] = {"parts": PARTS, "rollout_timeout": 60.0, "verify_seconds": 1.0}


APPS = (
    app("stats", GOOD, depends_on=["sensor"]),
    app("sensor", GOOD),
    app("planner", GOOD, pattern="action", readiness={"actions": ["plan"]}),
)


def wanted(version: str = GOOD, **more: Any) -> Robot:
    """A robot with an app of each kind; the version is that of the sensor."""
    return robot(*({**one, "image": version} if one["name"] == "sensor" else one for one in APPS), **more)


ROBOT = wanted()
SHARED = robot(app("chart", GOOD, pattern="service", scope="fleet"), app("sensor", GOOD), master={"mode": "shared"})


def outcome(sim: Simulation, of: Robot, fault: str = "", at: int = 0, **more: Any) -> RobotOutcome:
    return outcome_of(sim, of, fault, at, **{**SITE, **more})


def word(sim: Simulation, of: Robot, **more: Any) -> str:
    return outcome(sim, of, **more).outcome


def marked(sim: Simulation) -> set[str]:
    return {
        key[2]
        for key, item in sim.objects.items()
        if key[0] == "Deployment" and words.UPDATING in item["metadata"]["annotations"]
    }


def test_a_robot_whose_apps_never_came_up_is_not_asked_by_their_messages() -> None:
    """The apps that would publish the answer are in the very plan, after the master's and the keeper's steps. Nor has
    it to wait for a window."""
    asked: dict[str, Any] = {"update_when": [CHARGED], "update_windows": [{"from": "00:00", "to": "00:01"}]}
    sim = Simulation()
    assert word(sim, robot(app("sensor", image("never-starts")))) == "failed"
    found = outcome(sim, robot(app("sensor", GOOD), master={"image": BETTER}, **asked))
    assert (found.outcome, [step.phases.get("wait", 0.0) for step in found.steps]) == ("updated", [0.0] * 3), found
    later = outcome(sim, robot(app("sensor", BETTER), master={"image": BETTER}, update_when=[CHARGED]))
    assert later.outcome == "deferred-busy"  # the robot works by now, and is asked
    assert "nobody publishes it; -e update_on_busy=force changes the robot without asking it" in later.reason
    promising = {"topics": [{"name": "/battery", "publishers": 1}]}
    driver = app("sensor", image("good", 2), readiness=promising)
    assert outcome(sim, robot(driver, master={"image": BETTER}, update_when=[CHARGED])).outcome == "deferred-busy"
    assert any("/battery is app sensor's, which publishes nothing; -e update_on_busy" in line for line in sim.said)


@pytest.mark.parametrize("of", [wanted(), SHARED, robot()], ids=["robot", "shared", "no apps"])
def test_all_at_once_and_then_nothing(of: Robot) -> None:
    sim = Simulation()
    found = outcome(sim, of)
    assert (found.outcome, len(found.steps)) == ("updated", 1)
    assert sorted(found.steps[0].apps) == sorted(["ros-keeper", "ros-master", *(one.name for one in of.apps)])
    assert sim.brought == []  # archives alone, and names that are always wanted
    assert sim.engine.graph_told["verdict"] == "pass"  # the report tells that
    # the master's Services, whose addresses its pods and the apps' are told; then one apply, one wait, one look at the
    # graph; the second wait only sees that nothing was started again
    assert sim.calls == [
        "there", "read", "apply", "apply", "claim", "read", "apply", "read", "bring", "apply", "apply", "rollout",
        "ready", "rollout", "apply",
    ]  # fmt: skip
    assert not marked(sim)
    told = [item for key, item in sim.objects.items() if key[2] == update_record.NAME]
    events = [event for record in told for event in update_record.events_of(record)]
    assert {event["app"]: event["outcome"] for event in events} == dict.fromkeys(found.steps[0].apps, "updated")
    assert word(sim, of) == "unchanged"
    assert not sim.engine_changes
    assert sim.calls == ["there", "read", "apply", "rollout", "ready"]
    sim = Simulation()
    sim.run(of, settings(**SITE), "killed", 13)  # all of it is up, and nobody has proven it
    found = outcome(sim, of)
    assert ([step.name for step in found.steps], "graph" in sim.calls) == (["install"], False)


@pytest.mark.parametrize("of", [ROBOT, SHARED], ids=["robot", "shared"])
def test_whatever_ends_it_one_more_run_is_enough(of: Robot) -> None:
    sim = Simulation()
    outcome(sim, of)
    for fault, at in drawn(points(sim), SHARE, len(of.apps), KILLS):
        sim = Simulation()
        # what was cut off is no version to go back to, and nothing is asked: another one is wanted by now
        first = wanted(BAD) if fault == "killed" and of is ROBOT else of
        sim.run(first, settings(**SITE), fault, at)
        sim.restore()
        assert word(sim, of) in ("updated", "unchanged"), (fault, at)
        assert not marked(sim), (fault, at)
        assert word(sim, of) == "unchanged", (fault, at)


def test_what_does_not_come_up_stays_and_is_told_and_the_rest_is_at_work() -> None:
    sim = Simulation()
    found = outcome(sim, wanted(BAD))
    assert found.outcome == "failed"
    assert (
        "what came up stays as it is; the next run goes on from there; up: ros-keeper, ros-master, stats, planner"
        in found.reason
    )
    assert "sensor" in found.reason
    assert marked(sim) == {"sensor"}
    # from here on something is at work: the next version comes through the gate; there is none to go back to
    found = outcome(sim, wanted(BAD))
    assert found.outcome == "failed"
    assert "no version of it was ever proven, so it stays as it is" in found.reason
    assert sim.deployment((NAMESPACE, "sensor"))
    assert word(sim, wanted(GOOD)) == "updated"
    assert word(sim, wanted(GOOD)) == "unchanged"
    assert not marked(sim)


def test_an_app_that_came_up_and_does_not_keep_what_it_promised_is_not_proven() -> None:
    sim, promise = Simulation(), {"topics": [{"name": "/battery", "publishers": 1}]}
    of = wanted()
    found = outcome(sim, robot(*APPS[:1], app("sensor", GOOD, readiness=promise), *APPS[2:]))
    assert found.outcome == "failed"
    assert str(found.reason).endswith("; up: ros-keeper, ros-master, stats, planner")
    assert marked(sim) == {"sensor"}
    assert word(sim, of) == "updated"


@pytest.mark.parametrize(("mounts", "claims"), [(True, ["logs-pvc"]), (False, [])])
def test_a_claim_is_waited_for_where_a_pod_binds_it(
    mounts: bool, claims: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """It is bound by the first pod that mounts it, and a robot without apps has none."""
    apps = [app("sensor", GOOD, volumes=[VOLUME])] if mounts else []
    waits = spied(monkeypatch, SimulatedCluster, "wait")
    assert word(Simulation(), robot(*apps, volumes=[VOLUME])) == "updated"
    waited = [item["metadata"]["name"] for one in waits for item in one["objects"] if item["kind"] != "Deployment"]
    assert waited == claims


def test_what_was_cancelled_stays_and_is_told() -> None:
    sim = Simulation()
    outcome(sim, wanted())
    at = sim.calls.index("rollout") + 1
    found = outcome(Simulation(), wanted(), "cancelled", at)
    assert found.outcome == "failed"
    assert found.reason.endswith("what came up stays as it is; the next run goes on from there")


def test_a_master_that_does_not_come_up() -> None:
    sim = Simulation()
    bad, good = wanted(master={"image": image("never-starts")}), wanted(master={"image": GOOD})
    found = outcome(sim, bad)
    assert (found.outcome, "; up:" in str(found.reason)) == ("failed", False)
    assert marked(sim) >= {"ros-master", "sensor", "stats", "planner"}
    assert word(sim, good) == "updated"
    assert word(sim, good) == "unchanged"


def test_part_by_part() -> None:
    """As the roles do it, and tags."""
    sim, of = Simulation(), wanted(volumes=[VOLUME])
    refused = outcome(sim, of, parts=["apps"])
    assert "robot1 has no ROS master" in refused.reason
    sim = Simulation()
    for part in ("namespace", "storage", "master", "apps"):
        assert word(sim, of, parts=[part]) == "updated", part
        assert "graph" not in sim.calls, part  # nobody is at work yet
    for part in PARTS:
        assert word(sim, of, parts=[part]) == "unchanged", part
    del sim.objects["Service", NAMESPACE, "ros-keeper"]
    assert [word(sim, of, parts=[part]) for part in ("apps", "master")] == ["unchanged", "updated"]


def test_without_ros_the_keeper_is_there_before_it_is_asked() -> None:
    """By the first run, and by one that changes it and an app at once."""

    def of(version: str) -> Robot:
        return robot(app("sensor", version, readiness={"command": ["ask"]}), master={"mode": "none", "image": version})

    sim = Simulation()
    assert "robot1 has no ROS master" in outcome(sim, of(GOOD), parts=["apps"]).reason
    sim = Simulation()
    assert word(sim, of(GOOD), check=True) == "updated"
    assert [word(sim, of(version)) for version in (GOOD, BETTER, BETTER)] == ["updated", "updated", "unchanged"]


def test_check_mode_names_all_of_it_and_makes_nothing() -> None:
    sim = Simulation()
    assert word(sim, wanted(volumes=[VOLUME]), check=True) == "updated"
    assert {"Namespace", "PersistentVolumeClaim", "Deployment", "Service", "ConfigMap"} <= {
        change.ref.kind for change in sim.engine_changes
    }
    # as they are once all of it is proven
    made = [change.after for change in sim.engine_changes if change.ref.kind == "Deployment" and change.after]
    assert not [item for item in made if words.UPDATING in item["metadata"]["annotations"]]
    assert not sim.objects


# --- a robot at work ------------------------------------------------------------------------------------------------


def working(of: Robot | None = None) -> Simulation:
    sim = Simulation()
    sim.install(of or wanted())
    outcome(sim, of or wanted())  # claims and secrets, too
    return sim


@pytest.mark.parametrize("keeps", [True, False], ids=["by its keeper", "by the run"])
def test_a_new_master_gets_back_what_was_registered(keeps: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    if not keeps:
        monkeypatch.setattr(Simulation, "remember", lambda _sim: None)
    sim = working()
    found = outcome(sim, wanted(master={"image": BETTER}))
    assert (found.outcome, [step.name for step in found.steps]) == ("updated", ["ros-keeper", "ros-master"])
    assert sim.calls.index("graph") < sim.calls.index("rollout")  # through the gate
    assert sim.calls[-1] == "ready"  # and then the whole graph is what it was


HELD = Mock(side_effect=HeldError("control-2, process 7 changes this robot"))


def test_another_run_that_changes_the_robot_is_left_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    """And the robot is looked at all the same, where nothing is to be changed."""
    for sim, untouched in ((working(), "nothing"), (Simulation(), "no app")):
        monkeypatch.setattr(SimulatedCluster, "claim", HELD)
        found = outcome(sim, wanted(BETTER))
        assert found.outcome == "deferred-busy"
        assert found.reason == f"{untouched} was touched: control-2, process 7 changes this robot"
        assert {key[0] for key in sim.touched} <= {"Namespace"}  # the Lease lives there
        monkeypatch.undo()
    sim = working()
    monkeypatch.setattr(SimulatedCluster, "claim", HELD)
    assert word(sim, wanted()) == "unchanged"
    found = outcome(sim, wanted(quota={"pods": 20}))
    assert (found.outcome, sim.touched) == ("deferred-busy", set())


@pytest.mark.parametrize("lives", [True, False])
def test_the_record_of_a_run_that_waits_is_left_to_it(lives: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    """By a run that finds nothing to do, as its inventory is another one."""
    planner = app("planner", BETTER, pattern="action", readiness={"actions": ["plan"]})
    changed = robot(*(one for one in APPS if one["name"] != "planner"), planner)
    sim, other = working(), working()
    for one in (sim, other):
        one.goal("/plan", 200.0)
        one.advance(1.0)
    outcome(other, changed)
    at = len(other.calls) - other.calls[::-1].index("hold")
    assert sim.run(changed, settings(**SITE), "killed", at) is None
    assert '"outcome": "waiting"' in sim.events()
    if lives:
        monkeypatch.setattr(SimulatedCluster, "claim", HELD)
    assert word(sim, wanted()) == "unchanged"
    assert ('"outcome": "waiting"' in sim.events()) == lives
    assert (sim.touched == set()) == lives


def test_before_its_wave_a_robot_at_work_is_only_looked_at() -> None:
    sim = working()
    assert word(sim, wanted(BETTER), at_work=False) == "unchanged"
    assert sim.left
    assert not sim.touched
    assert word(sim, wanted(), at_work=False) == "unchanged"
    assert (sim.left, sim.calls[-1]) == (False, "ready")
    fresh = Simulation()
    assert word(fresh, wanted(), at_work=False) == "updated"


def test_what_disturbs_no_pod_takes_no_step() -> None:
    sim = working()
    more = wanted(quota={"pods": 20}, volumes=[VOLUME])
    found = outcome(sim, more, check=True)
    assert (found.outcome, found.steps) == ("updated", ())
    assert not sim.touched
    found = outcome(sim, more)
    assert (found.outcome, found.steps) == ("updated", ())
    assert found.reason == f"ResourceQuota {NAMESPACE}/robot, PersistentVolumeClaim {NAMESPACE}/logs-pvc"
    assert {key[0] for key in sim.touched} == {"ResourceQuota", "PersistentVolumeClaim"}
    assert word(sim, more) == "unchanged"


def test_what_a_robot_has_beside_others_in_the_fleets_namespace_is_its_own(monkeypatch: pytest.MonkeyPatch) -> None:
    """With the fleet's Lease all robots of a wave would be in each other's way."""
    sim = working(robot(APPS[1], master={"mode": "shared"}, admits=["192.0.2.0/24"]))
    claims = spied(monkeypatch, SimulatedCluster, "claim")
    found = outcome(sim, robot(APPS[1], master={"mode": "shared"}))
    assert (found.outcome, "NetworkPolicy fleet/robot-robot1" in found.reason) == ("updated", True)
    assert [one["_namespace"] for one in claims] == [NAMESPACE]


def test_the_whole_graph_is_looked_at_though_nothing_was_changed() -> None:
    sim = working()
    sim.watched = set()
    sim.hang(sim.of((NAMESPACE, "sensor"))[0], 0)
    found = outcome(sim, wanted())
    assert (found.outcome, found.steps) == ("failed", ())
    assert "sensor" in found.reason
    assert sim.engine.graph_told["verdict"] == "fail"


def test_a_claim_goes_when_that_is_confirmed_and_nobody_mounts_it() -> None:
    mounting = robot(app("sensor", GOOD, volumes=[VOLUME]), volumes=[VOLUME])
    sim, claim = working(mounting), ("PersistentVolumeClaim", NAMESPACE, "logs-pvc")
    assert storage_objects(mounting)[0]["metadata"]["name"] == "logs-pvc"
    gone = robot(app("sensor", GOOD))
    refused = outcome(sim, gone, remove_claims=["logs"])
    assert "would delete the data of logs" in refused.reason
    # the version that mounts it is kept, for the other one does not come up
    kept = outcome(sim, robot(app("sensor", BAD)), remove_claims=["logs"], remove_confirm=True)
    assert kept.outcome == "rolled-back"
    only = outcome(sim, gone, parts=["storage"], remove_claims=["logs"], remove_confirm=True)
    assert (only.outcome, claim in sim.objects) == ("failed", True)
    assert "no claim is deleted while an app runs that mounts it: logs-pvc sensor" in only.reason
    # a turn for what is the fleet's, or for other parts, is none for the robot's data
    for other in ({"request": Request(own=False)}, {"parts": ["apps"]}):
        assert word(sim, gone, remove_claims=["logs"], remove_confirm=True, check=True, **other) != "failed"
        assert claim[0] not in [change.ref.kind for change in sim.engine_changes]
    assert word(sim, gone, remove_claims=["logs"], remove_confirm=True, check=True) == "updated"
    assert claim in sim.objects
    assert word(sim, gone, remove_claims=["logs"], remove_confirm=True) == "updated"
    assert claim not in sim.objects
    assert word(sim, gone, remove_claims=["logs"], remove_confirm=True) == "unchanged"
