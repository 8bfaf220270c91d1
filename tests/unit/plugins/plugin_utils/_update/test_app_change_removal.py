# SPDX-License-Identifier: GPL-3.0-or-later
"""Apps that were taken out of the inventory go where that is asked for, through the gate, and nothing else does."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest
from ansible_collections.rosops.fleet.plugins.module_utils._common.poll import WAIT
from ansible_collections.rosops.fleet.plugins.plugin_utils._model.context import Robot
from ansible_collections.rosops.fleet.plugins.plugin_utils._objects.parts import PARTS
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.outcome import RobotOutcome
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.plan import Request
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.world import Seen
from ansible_collections.rosops.fleet.tests.unit.robots import robot
from ansible_collections.rosops.fleet.tests.unit.simulated.objects import app, applied, planned
from ansible_collections.rosops.fleet.tests.unit.simulated.robot import VERSIONS, image
from ansible_collections.rosops.fleet.tests.unit.simulated.scenarios import (
    ALL,
    OLD,
    drawn,
    outcome_of,
    points,
    settings,
    spied,
)
from ansible_collections.rosops.fleet.tests.unit.simulated.world import KILLS, SimulatedHost, Simulation

SHARE = 1 if ALL else 16
ALL = Request(remove=("all",))
SENSOR = app("sensor", OLD)
WHOLE = {"ports": [{"name": "web", "port": 80}], "files": [{"path": "/etc/stats.yaml", "content": "a"}]}
KINDS: dict[str, dict[str, Any]] = {
    "overlap": app("stats", OLD, depends_on=["sensor"], **WHOLE),
    "drain": app("planner", OLD, pattern="action", readiness={"actions": ["plan"]}),
    "replace": app("driver", OLD, pattern=None),
    "launch": app("base", OLD, pattern=None, readiness={"nodes": False}),
}


def fleet(*apps: dict[str, Any]) -> tuple[Simulation, Robot]:
    """A robot with a sensor and these, each updated once, and the robot with the sensor alone."""
    sim = Simulation()
    sim.install(robot(SENSOR, *apps))
    if apps:
        newer = [{**one, "image": image("good")} for one in apps]
        assert outcome_of(sim, robot(SENSOR, *newer)).outcome == "updated"
    return sim, robot(SENSOR)


def there(sim: Simulation, name: str) -> list[str]:
    """What there is of an app."""
    pods = [pod.app for pod in sim.pods if pod.app == name and not pod.gone]
    nodes = [node for node in sim.registered if node.startswith(f"/{name}")]
    return sorted([*pods, *nodes, *(f"{kind} {key}" for kind, _namespace, key in sim.objects if key.startswith(name))])


def ended(sim: Simulation, wanted: Robot, **more: Any) -> tuple[str, list[str]]:
    found = outcome_of(sim, wanted, **{"request": ALL, **more})
    return found.outcome, [step.name for step in found.steps]


@pytest.mark.parametrize("kind", KINDS)
def test_all_of_it_goes_and_nothing_else_is_touched(kind: str) -> None:
    gone = KINDS[kind]
    sim, wanted = fleet(gone)
    pods = [pod.uid for pod in sim.pods if pod.app != gone["name"]]
    assert ended(sim, wanted, check=True) == ("updated", [gone["name"]])
    assert {change.ref.name for change in sim.engine_changes if change.after is None} >= {gone["name"]}
    assert there(sim, gone["name"])
    assert ended(sim, wanted) == ("updated", [gone["name"]])
    assert there(sim, gone["name"]) == []
    assert [pod.uid for pod in sim.pods if not pod.gone] == pods
    assert ended(sim, wanted) == ("unchanged", [])
    assert not sim.engine_changes


@pytest.mark.parametrize("kind", KINDS)
def test_whatever_ends_it_one_more_run_is_enough(kind: str) -> None:
    gone = KINDS[kind]
    sim, wanted = fleet(gone)
    ended(sim, wanted)
    for fault, at in drawn(points(sim), SHARE, [*KINDS].index(kind), KILLS):
        sim, wanted = fleet(gone)
        sim.run(wanted, settings(request=ALL), fault, at)
        sim.restore()
        assert ended(sim, wanted)[0] in ("updated", "unchanged"), (fault, at)
        sim.settle()
        assert there(sim, gone["name"]) == [], (fault, at)
        assert ended(sim, wanted)[0] == "unchanged", (fault, at)


def test_a_robot_at_work_is_waited_for() -> None:
    sim, wanted = fleet(KINDS["drain"])
    goal = sim.goal("/plan", 40.0)
    assert ended(sim, wanted, on_busy="defer") == ("deferred-busy", ["planner"])
    assert ended(sim, wanted, busy_timeout=5.0) == ("deferred-busy", ["planner"])
    assert ended(sim, wanted) == ("updated", ["planner"])
    assert goal.ended
    assert not sim.holds


def told(sim: Simulation, wanted: Robot, *remove: str, **more: Any) -> RobotOutcome:
    return outcome_of(sim, wanted, request=Request(remove=remove, **more))


def test_only_what_is_named_goes() -> None:
    sim, wanted = fleet(KINDS["overlap"], KINDS["replace"])
    found = told(sim, wanted, "stats", "of-another-robot")
    assert [step.told().split(" in ")[0] for step in found.steps] == [f"stats {image('good')} -> removed"]
    assert there(sim, "driver")
    assert sim.said[0] == "not in the inventory, left as they are (update_remove_apps takes them away): driver"
    assert told(sim, wanted, "stats").outcome == "unchanged"


@pytest.mark.parametrize(
    ("more", "how"), [({"own": False}, {}), ({}, {"parts": ("namespace", "master")}), ({"to": "previous"}, {})]
)
def test_another_request_takes_nothing_away(more: dict[str, Any], how: dict[str, Any]) -> None:
    sim, wanted = fleet(KINDS["overlap"])
    outcome_of(sim, wanted, request=Request(remove=("all",), **more), **how)
    assert there(sim, "stats")


def test_what_the_inventory_has_still_is_an_error() -> None:
    sim, _wanted = fleet(KINDS["overlap"])
    found = told(sim, robot(SENSOR, KINDS["replace"]), "sensor", "stats")
    assert found.outcome == "failed"
    assert found.reason == (
        "nothing was touched: update_remove_apps names sensor, which robot1 is to have: take it out of ros_apps first"
    )


def test_a_robot_that_is_to_have_none_at_all_may_be_a_mistake() -> None:
    sim, _wanted = fleet()
    found = told(sim, robot(), "all")
    assert found.outcome == "failed"
    assert "the inventory has no app for robot1" in found.reason
    assert found.reason.endswith("name what goes: sensor")
    assert there(sim, "sensor")
    assert told(sim, robot(), "sensor").outcome == "updated"
    assert sim.deployment(("robot-robot1", "ros-master"))


def test_the_master_stays_and_what_is_the_fleets() -> None:
    shared = app("chart", OLD, pattern="service", scope="fleet")
    sim = Simulation()
    sim.install(robot(SENSOR, shared, master={"mode": "shared", "image": OLD}))
    assert ended(sim, robot(SENSOR, master={"mode": "shared", "image": OLD})) == ("unchanged", [])
    sim, _wanted = fleet()
    external = robot(SENSOR, master={"mode": "external", "uri": "http://10.0.0.1:11311"})
    found = told(sim, external, "all")
    assert {step.name for step in found.steps} <= {"sensor"}, found
    assert sim.deployment(("robot-robot1", "ros-master"))


def test_of_a_master_that_was_the_robots_own_all_goes_but_what_shows_the_external_one() -> None:
    external = robot(
        master={"mode": "external", "uri": "http://10.0.0.1:11311"}, observability={"enabled": True}, volumes=[]
    )
    own = [{**item, "kind": "Service"} for item in applied(robot()).deployments]
    live = replace(applied(external), services=own)
    plan = planned(external, live, Request(remove=["ros-master", "ros-keeper"]))
    assert (plan.steps, plan.orphans) == ([], [])
    assert [(item["kind"], item["metadata"]["name"]) for item in plan.remnants] == [("Service", "ros-master")]


@pytest.mark.parametrize(
    "shared",
    [{"node_name": "driver"}, {"devices": ["/dev/ttyUSB0"]}, {"ports": [{"name": "w", "port": 80, "host_port": 80}]}],
    ids=["name", "device", "port"],
)
def test_what_is_in_the_way_goes_first_and_all_else_last(shared: dict[str, Any]) -> None:
    sim, _wanted = fleet(app("driver", OLD, pattern=None, placement="local", **shared), KINDS["overlap"])
    heir = app("chart", OLD, pattern=None, placement="local", **shared)
    found = told(sim, robot(SENSOR, heir), "all")
    assert (found.outcome, [step.name for step in found.steps]) == ("updated", ["driver", "chart", "stats"])


def test_a_robot_whose_new_version_is_refused_has_what_it_had() -> None:
    sim, _wanted = fleet(KINDS["replace"])
    found = told(sim, robot({**SENSOR, "image": image("never-starts")}), "all")
    assert found.outcome == "rolled-back"
    assert "1 further step not begun" in found.reason
    assert there(sim, "driver")


def test_a_pod_that_does_not_end_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    sim, wanted = fleet(KINDS["replace"])
    monkeypatch.setattr(sim, "stop", lambda _pod: None)
    began, grace = sim.time, 30.0  # that each pod has, and then `update_ready_timeout`
    found = told(sim, wanted, "all")
    assert (found.outcome, sim.time - began > grace + 30.0) == ("failed", True)
    assert found.reason.startswith("driver: still there: driver-")
    assert any("waits until driver has ended, for " in text for text in sim.said)


def test_a_node_that_still_answers_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    sim, wanted = fleet(KINDS["replace"])
    ready = SimulatedHost.ready

    def answers(host: SimulatedHost, master: str, conditions: Any, *more: Any) -> Seen:
        seen = ready(host, master, conditions, *more)
        return Seen(WAIT, "/driver: still registered, and answers") if conditions.get("absent") else seen

    monkeypatch.setattr(SimulatedHost, "ready", answers)
    found = told(sim, wanted, "all")
    assert (found.outcome, "/driver: still registered" in found.reason) == ("failed", True)


def test_what_a_killed_process_registered_goes_with_its_app_though_no_keeper_is_there(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    sim, wanted = fleet(KINDS["replace"])
    monkeypatch.setattr(Simulation, "reap", lambda _sim, _process: None)
    (pod,) = sim.of(("robot-robot1", "driver"))
    pod.version, pod.restarts = VERSIONS["never-starts"], 5
    sim.crash(pod, pod.restarts)
    assert "/driver" in sim.registered
    assert ended(sim, wanted) == ("updated", ["driver"])
    assert there(sim, "driver") == []


def test_who_answers_is_not_taken_out_of_the_graph_with_an_app(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of no host it is known here that it is gone, so each node that answers is left."""
    sim, wanted = fleet(KINDS["replace"])
    reaped, stood = spied(monkeypatch, SimulatedHost, "reap"), spied(monkeypatch, Simulation, "stands")
    assert ended(sim, wanted) == ("updated", ["driver"])
    assert [(one["nodes"], one["hosts"]) for one in reaped] == [(["/driver"], ())]
    assert "waits until driver has left the graph" in [one["phase"] for one in stood]


def test_another_master_is_refused_while_apps_work_and_the_way_there_works() -> None:
    """Out with the apps, then the other master, the old one away, and the apps again."""
    shared = {"mode": "shared", "image": OLD}
    apps = [app("sensor", OLD, placement="local")]
    sim = Simulation()
    sim.install(robot(*apps))
    found = outcome_of(sim, robot(*apps, master=shared))
    assert (found.outcome, sim.touched) == ("failed", set())
    assert found.reason.startswith("nothing was touched: robot1's apps run with ros_master_mode robot (")
    assert "take the apps out first" in found.reason

    assert told(sim, robot(), "sensor").outcome == "updated"
    sim.watched = set()
    assert outcome_of(sim, robot(master=shared), parts=PARTS).outcome == "updated"
    assert sim.said[0].startswith("not in the inventory, left as they are (update_remove_apps takes them away): ros-")
    assert told(sim, robot(master=shared), "ros-keeper", "ros-master").outcome == "updated"
    assert {name for kind, space, name in sim.objects if (kind, space) == ("Deployment", "robot-robot1")} == set()
    assert outcome_of(sim, robot(*apps, master=shared), parts=PARTS).outcome == "updated"
    assert outcome_of(sim, robot(*apps, master=shared)).outcome == "unchanged"
