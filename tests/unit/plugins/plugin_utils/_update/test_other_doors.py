# SPDX-License-Identifier: GPL-3.0-or-later
"""Changes that no run makes: `kubectl rollout restart`, `set image`, `rollout undo`, `scale`. Fleets from before."""

from __future__ import annotations

import json

import pytest
from ansible_collections.rosops.fleet.plugins.module_utils._ros import gate
from ansible_collections.rosops.fleet.plugins.module_utils._ros.contract import Contract
from ansible_collections.rosops.fleet.plugins.module_utils._ros.graph import Graph
from ansible_collections.rosops.fleet.plugins.plugin_utils._model import names
from ansible_collections.rosops.fleet.plugins.plugin_utils._model.context import Robot
from ansible_collections.rosops.fleet.plugins.plugin_utils._objects.app import app_objects
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.world import Object
from ansible_collections.rosops.fleet.tests.unit.simulated.objects import addressed
from ansible_collections.rosops.fleet.tests.unit.simulated.robot import image
from ansible_collections.rosops.fleet.tests.unit.simulated.scenarios import OLD, SCENARIOS, begin, outcome_of, settings
from ansible_collections.rosops.fleet.tests.unit.simulated.world import SimulatedHost, Simulation

OVERLAP = ("overlap", "overlap-shared", "group", "launch", "launch-held")
OTHERS = ("drain", "replace")


def proven(name: str) -> tuple[Simulation, Robot]:
    sim, wanted = begin(name, "good")
    assert outcome_of(sim, wanted, soak=0.0).outcome == "updated"
    return sim, wanted


def assert_at_rest(sim: Simulation) -> None:
    """Each app has one pod, which is all that is registered of it; nobody was taken back."""
    sim.settle(120.0)
    there = [pod for key in sim.apps() for pod in sim.of(key)]
    assert sorted(pod.key for pod in there) == sorted(sim.apps())
    assert all(pod.ready and not pod.restarts for pod in there)
    own = {process.node for pod in there for process in pod.processes} | {"/listener"}
    assert {*sim.registered} == own
    assert not [line for line in sim.keeper.said if "taken back" in line]


@pytest.mark.parametrize("name", [*OVERLAP, *OTHERS])
def test_a_restart_by_hand_is_no_change_and_loses_nothing_of_what_overlaps(name: str) -> None:
    sim, wanted = proven(name)
    for _time in range(3):
        before = {pod.node for key in sim.apps() for pod in sim.of(key)}
        sim.restart_by_hand()  # of a group both at once
        assert_at_rest(sim)
        after = {pod.node for key in sim.apps() for pod in sim.of(key)}
        assert not before & after if name in OVERLAP else before == after
        assert outcome_of(sim, wanted).outcome == "unchanged"
    better = SCENARIOS[name].robot(image("good", 7))
    assert outcome_of(sim, better).outcome == "updated"
    bad = SCENARIOS[name].robot(image("half-the-rate", 8))
    assert outcome_of(sim, bad).outcome == "rolled-back"
    assert outcome_of(sim, better).outcome == "unchanged"


@pytest.mark.parametrize("name", OVERLAP)
def test_a_version_that_was_found_good_is_restarted_by_hand_in_its_soak(name: str) -> None:
    sim, wanted = begin(name, "good")
    assert outcome_of(sim, wanted).outcome == "updated"
    sim.advance(30.0)
    sim.restart_by_hand()
    assert_at_rest(sim)
    sim.settle(600.0)
    assert sim.keeper.said[-1].endswith(": proven"), sim.keeper.said
    assert outcome_of(sim, wanted).outcome == "unchanged"


@pytest.mark.parametrize("name", [*OVERLAP, *OTHERS])
def test_another_image_by_hand_is_put_right_through_a_step(name: str) -> None:
    sim, wanted = proven(name)
    sim.change_by_hand(image("good", 77))
    assert_at_rest(sim)
    assert outcome_of(sim, wanted).outcome == "updated"
    assert all(f"{app} was changed by hand" in sim.said for _namespace, app in sim.apps())
    assert "graph" in sim.calls  # through the gate
    assert_at_rest(sim)
    assert outcome_of(sim, wanted).outcome == "unchanged"


@pytest.mark.parametrize("version", ["never-starts", "never-connects", "crashes-at-once", "offers-less"])
@pytest.mark.parametrize("name", OVERLAP)
def test_a_bad_image_by_hand_takes_nobodys_place(name: str, version: str) -> None:
    """No contract of a step tells its pod what it owes: what the pod has that it would replace does."""
    sim, wanted = proven(name)
    before = {pod.uid for key in sim.apps() for pod in sim.of(key)}
    sim.change_by_hand(image(version, 77))
    sim.settle(300.0)
    assert before == {pod.uid for key in sim.apps() for pod in sim.of(key) if pod.ready}
    assert outcome_of(sim, wanted).outcome == "updated"
    assert_at_rest(sim)


@pytest.mark.parametrize("name", [*OVERLAP, *OTHERS])
def test_an_undo_by_hand_brings_the_version_before_which_the_next_run_replaces(name: str) -> None:
    sim, wanted = proven(name)
    for key in sim.apps():
        sim.undo_by_hand(key)
    assert_at_rest(sim)
    images = {pod.version for key in sim.apps() for pod in sim.of(key)}
    assert len(images) == 1
    assert outcome_of(sim, SCENARIOS[name].robot(OLD)).outcome in ("updated", "unchanged")  # it is what was proven
    assert outcome_of(sim, wanted).outcome == "updated"
    assert_at_rest(sim)


@pytest.mark.parametrize("name", [*OVERLAP, *OTHERS])
def test_none_by_hand_ends_cleanly_and_one_is_as_it_was(name: str) -> None:
    sim, wanted = proven(name)
    sim.change_by_hand("0")
    sim.settle(60.0)
    assert {*sim.registered} == {"/listener"}
    sim.change_by_hand("1")
    assert_at_rest(sim)
    assert outcome_of(sim, wanted).outcome == "unchanged"
    sim.change_by_hand("0")
    sim.settle(60.0)
    assert outcome_of(sim, wanted).outcome == "updated"
    assert_at_rest(sim)


def test_the_way_back_registers_the_old_node_by_the_name_that_it_has_in_its_pod(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    sim, _wanted = proven("overlap")
    (pod,), given = sim.of(("robot-robot1", "sensor")), list[Graph]()
    monkeypatch.setattr(SimulatedHost, "register", lambda _host, _master, graph, _nodes: given.append(graph))
    bad = SCENARIOS["overlap"].robot(image("half-the-rate", 8))
    assert outcome_of(sim, bad).outcome == "rolled-back"
    (graph,) = given
    assert pod.node in graph.names and graph.node(pod.node).services == ("/calibrate",)


# ---- fleets of collections up to 1.0


def from_before(robot: Robot) -> list[Object]:
    """Its Deployments with names by the revision alone, which was another one."""
    found = []
    for item in app_objects(addressed(robot)):
        container = item["spec"]["template"]["spec"]["containers"][0]
        container["env"] = [one for one in container["env"] if one["name"] != names.TEMPLATE_ENV]
        revision = item["spec"]["template"]["metadata"]["labels"][names.LABEL_REVISION]
        text = json.dumps(item).replace(f"_$({names.TEMPLATE_ENV})", "").replace(revision, revision[::-1])
        found.append(json.loads(text))
    return found


def before(name: str) -> Simulation:
    sim, robot = Simulation(), addressed(SCENARIOS[name].robot(OLD))
    sim.install_objects(robot, from_before(robot))
    assert all("_$(" not in json.dumps(item) for item in sim.objects.values())
    return sim


@pytest.mark.parametrize("name", OVERLAP)
def test_one_gated_step_an_app_brings_a_fleet_there(name: str) -> None:
    sim, wanted = before(name), SCENARIOS[name].robot(OLD)
    found = outcome_of(sim, wanted)
    assert (found.outcome, {step.outcome for step in found.steps}) == ("updated", {"updated"})
    assert len(found.steps) == 1 and "graph" in sim.calls and "rates" in sim.calls
    sim.settle(600.0)  # the keeper proves it
    assert outcome_of(sim, wanted).outcome == "unchanged"
    sim.restart_by_hand()
    assert_at_rest(sim)


@pytest.mark.parametrize("name", OVERLAP)
def test_a_keeper_that_is_from_before_itself_proves_what_it_is_told_of(
    name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It begins anew with the run's code when the robot rests: not before it has seen the version through its soak."""
    sim, wanted = before(name), SCENARIOS[name].robot(OLD)
    assert outcome_of(sim, wanted).outcome == "updated"
    with monkeypatch.context() as patched:
        patched.setattr(gate, "as_registered", lambda _ros, _state, conditions: conditions)
        patched.setattr(Contract, "called", lambda contract, _new: contract)
        sim.settle(600.0)
    assert sim.keeper.said[-1].endswith(": proven"), sim.keeper.said
    assert outcome_of(sim, wanted).outcome == "unchanged"


@pytest.mark.parametrize("fault", ["", "killed", "half-killed"])
@pytest.mark.parametrize("version", ["half-the-rate", "crashes-at-once"])
def test_the_way_back_leads_to_a_version_from_before(version: str, fault: str) -> None:
    wanted = SCENARIOS["overlap"].robot(image(version))
    for at in range(1, 30, 3) if fault else (1,):
        sim = before("overlap")
        sim.run(wanted, settings(), fault, at)
        sim.restore()
        sim.settle(600.0)
        sim.run(wanted, settings())
        (pod,) = sim.of(("robot-robot1", "sensor"))
        assert pod.version.good and "_" + pod.hash not in pod.node
