# SPDX-License-Identifier: GPL-3.0-or-later
"""The engine in a simulated world: each phase times each fault, pairs of faults, sequences, schedules.

The simulated world holds its invariants at every moment, and each outcome's word against what is there. After the fault
the next run has to bring the robot to where a run without one would have brought it.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from typing import Any

import pytest
from ansible_collections.rosops.fleet.plugins.plugin_utils._kube.running import TODO
from ansible_collections.rosops.fleet.plugins.plugin_utils._model.context import Robot, namespace_of
from ansible_collections.rosops.fleet.plugins.plugin_utils._objects.common import (
    RECREATE_STRATEGY,
    annotate,
    pod_spec,
    workload,
)
from ansible_collections.rosops.fleet.plugins.plugin_utils._objects.parts import PARTS
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.engine import UNLABELLED
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.manifests import HISTORY_KEPT
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.outcome import StepResult
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.plan import Request, placed
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.world import Live
from ansible_collections.rosops.fleet.tests.unit.robots import robot
from ansible_collections.rosops.fleet.tests.unit.simulated import world
from ansible_collections.rosops.fleet.tests.unit.simulated.objects import app, entry, update_map
from ansible_collections.rosops.fleet.tests.unit.simulated.robot import FOREVER, image
from ansible_collections.rosops.fleet.tests.unit.simulated.scenarios import (
    ALL,
    INFRASTRUCTURE,
    MATRIX,
    OLD,
    SCENARIOS,
    begin,
    drawn,
    outcome_of,
    points,
    running,
    settings,
    strikes,
)
from ansible_collections.rosops.fleet.tests.unit.simulated.world import FAULTS, KILLS, RESTARTED_APPS, Simulation
from hypothesis import HealthCheck
from hypothesis import settings as bounds
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, precondition, rule

# all of it takes minutes: that is for ROSOPS_TEST_ALL
SHARE = 1 if ALL else 79
PAIRS = 32 if ALL else 3072


def converge(sim: Simulation, wanted: Robot, version: str, twice: bool = True) -> None:
    """What the next runs come to when nothing is in the way any more.

    Not `twice`: a bad version that went back is no better in the run after that.
    """
    good, bad = [["updated", "unchanged"], ["unchanged", "unchanged"]], [["rolled-back", "rolled-back"]]
    # what crashes once is taken back by whoever sees it, a keeper after its run, too, and proves itself to whoever does
    # not see it
    once = [["rolled-back", "updated"], ["updated", "rolled-back"], ["unchanged", "rolled-back"]]
    expected = {"good": good, "crashes-once": [*good, *bad, *once]}
    first = outcome_of(sim, wanted)
    if version != "good" and first.outcome == "deferred-busy":  # it ended, or hung, just as it was looked at
        first = outcome_of(sim, wanted)
    found = [first, outcome_of(sim, wanted)] if twice or version in expected else [first]
    words = [outcome.outcome for outcome in found]
    assert words in [row[: len(words)] for row in expected.get(version, bad)], found


def faults_of(name: str, version: str) -> Sequence[str]:
    """An app that is away for a moment shows nothing of what its next version owes. What hangs after some seconds has
    not done so when it was begun anew just before the run's last look."""
    apart = name in INFRASTRUCTURE or any(app.handoff != "overlap" for app in SCENARIOS[name].robot(OLD).apps)
    return FAULTS if apart or version == "hangs" else (*FAULTS, RESTARTED_APPS)


def begins(phases: Sequence[str]) -> list[int]:
    """The first call of each phase."""
    return [at for at in range(1, len(phases) + 1) if at == 1 or phases[at - 1] != phases[at - 2]]


def in_each_phase(name: str, version: str, calls: Sequence[str], phases: Sequence[str]) -> list[tuple[str, int]]:
    """A fault at the beginning of some phases: the versions of a scenario share those of their way back."""
    versions, found = SCENARIOS[name].versions, list[tuple[str, int]]()
    mine = begins(phases) if version == "good" else begins(phases)[versions.index(version) :: len(versions)]
    for at in mine:
        possible = [fault for fault in faults_of(name, version) if strikes(fault, calls[at - 1])]
        found.append((possible[(MATRIX.index((name, version)) + at) % len(possible)], at))
    return found


def pairs(
    name: str, version: str, calls: Sequence[str], phases: Sequence[str]
) -> list[tuple[str, int, tuple[int, str]]]:
    """Two faults in one run: each pair, the first at a phase's first call, the second at one of the next six.

    One of every `PAIRS`. Of a run that was killed nothing is left that a second one could strike.
    """
    found = [
        (first, at, (at + 1 + number % 6, second))
        for number, (first, second) in enumerate(itertools.product(faults_of(name, version), repeat=2))
        for at in begins(phases)
        if first not in KILLS and strikes(first, calls[at - 1])
    ]
    return found[MATRIX.index((name, version)) :: PAIRS]


@pytest.mark.parametrize(("name", "version"), MATRIX)
def test_one_fault_at_every_call_and_two_in_one_run(name: str, version: str) -> None:
    sim, wanted = begin(name, version)
    clean = outcome_of(sim, wanted)
    assert clean.outcome == ("updated" if version == "good" else "rolled-back"), clean
    calls, phases, wrong = [*sim.calls], [*sim.phases], []
    # one of every `SHARE`, turned by one from version to version
    one = drawn(points(sim, faults_of(name, version)), SHARE, MATRIX.index((name, version)))
    converge(sim, wanted, version)
    one += in_each_phase(name, version, calls, phases)
    two = pairs(name, version, calls, phases)
    for number, faults in enumerate((*one, *two)):
        sim, wanted = begin(name, version)
        try:
            sim.run(wanted, settings(), *faults)
            sim.restore()
            converge(sim, wanted, version, ALL or number >= len(one))
        except AssertionError as error:
            wrong.append(f"{faults} ({calls[faults[1] - 1]}): {error}".splitlines()[0])
    print(f"{name}, {version}: {len(calls)} calls, {len(one)} with a fault, {len(two)} pairs")  # shown by pytest -rP
    assert len(one) > 3
    assert not wrong, "\n".join(wrong)


@pytest.mark.parametrize(("name", "version"), MATRIX)
def test_check_mode_writes_nothing_and_tells_what_a_run_would_do(name: str, version: str) -> None:
    sim, wanted = begin(name, version)
    found = outcome_of(sim, wanted, check=True)
    assert found.outcome == "updated"
    assert sim.engine_changes
    assert outcome_of(sim, SCENARIOS[name].robot(OLD), check=True).outcome == "unchanged"
    assert not sim.engine_changes


def test_images_are_there_before_anything_is_touched() -> None:
    sim, wanted = begin("overlap", "good")
    assert outcome_of(sim, wanted).outcome == "updated"
    assert sim.calls[:7] == ["there", "read", "apply", "claim", "read", "bring", "apply"]
    assert sim.brought == [image("good")]


@pytest.mark.parametrize(("back", "check"), [(False, False), (True, True)])
def test_a_version_that_an_edge_host_lacks_is_not_begun(back: bool, check: bool) -> None:
    """Check mode says what a run would, and going back needs the image as going forth does."""
    sim = Simulation()
    old, new = (robot(app("chart", wanted)) for wanted in (OLD, image("good")))
    sim.install(old)
    lacks, has = image("good"), OLD
    if back:
        assert outcome_of(sim, new, edge_images={"edge1": [OLD, image("good")]}).outcome == "updated"
        lacks, has = OLD, image("good")
    there = running(sim, "chart")
    request = Request(to="previous") if back else Request()
    found = outcome_of(sim, new, check=check, request=request, edge_images={"edge1": [OLD, lacks], "edge2": [has]})
    assert (found.outcome, found.reason) == ("failed", f"chart: nothing was touched: the image {lacks} is not on edge2")
    assert running(sim, "chart") == there
    more = {"edge1": [OLD, lacks], "edge2": [has, lacks]}
    assert outcome_of(sim, new, check=check, request=request, edge_images=more).outcome == "updated"
    local = robot(app("chart", image("good", 7), placement="local"))  # no edge host has to have it
    assert outcome_of(sim, local, check=check, edge_images={"edge1": []}).outcome == "updated"


def selectors(sim: Simulation) -> dict[str, list[str]]:
    """App -> the labels that choose its node."""
    there = [item for (kind, _space, _name), item in sim.objects.items() if kind == "Deployment"]
    return {one["metadata"]["name"]: [*one["spec"]["template"]["spec"]["nodeSelector"]] for one in there}


@pytest.mark.parametrize("name", ["overlap", "replace", "keeper-and-master", "fleet"])
def test_a_robot_of_1_0_is_as_it_should_be_and_its_next_version_gets_the_new_selector(name: str) -> None:
    scenario, sim = SCENARIOS[name], Simulation()
    wanted = scenario.robot(OLD)
    former = placed(wanted, Live(), unlabelled=True)
    sim.install(former)
    before = selectors(sim)
    assert {label for labels in before.values() for label in labels} <= {"rosops.fleet/robot", "deploymentType"}
    ready = Request(parts=PARTS)
    assert outcome_of(sim, wanted, request=ready).outcome == "unchanged"
    assert selectors(sim) == before
    sim.unlabelled = True
    changed = scenario.robot(image("good"))
    assert outcome_of(sim, changed, request=ready).outcome == "updated"
    assert selectors(sim) == before and UNLABELLED in sim.said
    sim.unlabelled = False
    assert outcome_of(sim, changed, request=ready).outcome == "unchanged"
    assert outcome_of(sim, wanted, request=ready).outcome == "updated"
    moved = {app: labels for app, labels in selectors(sim).items() if labels != before[app]}
    assert moved and all(label.startswith("node-restriction.kubernetes.io/") for [label] in moved.values())
    assert outcome_of(sim, wanted, request=ready).outcome == "unchanged"


@pytest.mark.parametrize("wanted_image", [OLD, image("good")])
@pytest.mark.parametrize("name", ["ros-master", "ros-keeper"])
def test_a_service_that_is_gone_comes_back_before_the_graph_is_read(wanted_image: str, name: str) -> None:
    sim, _wanted = begin("overlap", "good")
    wanted, key = robot(app("sensor", wanted_image)), ("Service", "robot-robot1", name)
    there = sim.objects.pop(key)
    found = outcome_of(sim, wanted)
    assert found.outcome == "updated"
    assert sim.objects[key]["spec"] == there["spec"]
    assert f"Service {name} is gone or was changed by hand" in sim.said
    assert sim.engine.live.service_uri(name, "robot-robot1")  # what is held back, is held there
    assert outcome_of(sim, wanted).outcome == "unchanged"


@pytest.mark.parametrize("version", ["good", "never-starts"])
def test_the_exporter_of_an_earlier_collection_goes_once_the_keeper_does_its_work(version: str) -> None:
    scenario, sim = SCENARIOS["keeper-and-master"], Simulation()
    pod = pod_spec([{"name": "ros-exporter", "image": OLD}])
    notes = {"rosops.fleet/spec-hash": "1"}
    sim.put(annotate(workload("ros-exporter", "robot-robot1", "robot1", pod, notes, RECREATE_STRATEGY)))
    sim.install(scenario.robot(OLD))
    wanted = scenario.robot(image(version))
    assert outcome_of(sim, wanted, check=True).outcome == "updated"
    assert [change.ref.name for change in sim.engine_changes if change.after is None] == ["ros-exporter"]
    found, good = outcome_of(sim, wanted), version == "good"
    assert [step.name for step in found.steps] == (["ros-keeper", "ros-master"] if good else ["ros-keeper"])
    assert (("Deployment", "robot-robot1", "ros-exporter") in sim.objects) == (not good)


def services_of(sim: Simulation) -> list[str]:
    return sorted(name for kind, _namespace, name in sim.objects if kind == "Service")


def test_a_service_comes_with_ports_and_goes_with_them() -> None:
    def with_ports(*numbers: int) -> Robot:
        ports = [{"name": f"p{number}", "port": number} for number in numbers]
        return robot(app("sensor", OLD, placement="local", ports=ports))

    sim = Simulation()
    sim.install(with_ports())
    before = services_of(sim)
    for numbers, more in (((80,), ["sensor"]), ((80, 81), ["sensor"]), ((), [])):
        assert outcome_of(sim, with_ports(*numbers), check=True).outcome == "updated"
        assert outcome_of(sim, with_ports(*numbers)).outcome == "updated"
        assert services_of(sim) == sorted([*before, *more])
        assert outcome_of(sim, with_ports(*numbers)).outcome == "unchanged"


def test_the_ports_of_the_version_before_lead_there_until_the_next_one_is_proven() -> None:
    def of(version: str, *ports: str) -> Robot:
        named = [{"name": name, "port": 80 + number} for number, name in enumerate(ports)]
        return robot(app("sensor", version, placement="local", ports=named))

    sim = Simulation()
    sim.install(of(OLD))
    assert outcome_of(sim, of(OLD, "a", "b")).outcome == "updated"
    leads = [("Service", "robot-robot1", "sensor"), ("NetworkPolicy", "robot-robot1", "sensor.ports")]
    before = [sim.objects[key]["spec"] for key in leads]
    assert outcome_of(sim, of(image("never-starts"), "b")).outcome == "rolled-back"
    assert [sim.objects[key]["spec"] for key in leads] == before
    assert outcome_of(sim, of(image("good"), "b"), check=True).outcome == "updated"
    assert {change.ref.kind for change in sim.engine_changes} >= {kind for kind, _space, _name in leads}
    assert outcome_of(sim, of(image("good"), "b")).outcome == "updated"
    assert [one["name"] for one in sim.objects[leads[0]]["spec"]["ports"]] == ["b"]
    assert outcome_of(sim, of(image("good"), "b")).outcome == "unchanged"


def test_the_ports_of_an_app_of_the_fleet_are_none_of_a_robot_s_own_turn() -> None:
    def of(*ports: int) -> Robot:
        named = [{"name": f"p{number}", "port": number} for number in ports]
        return robot(app("chart", OLD, scope="fleet", ports=named), master={"mode": "shared", "image": OLD})

    sim = Simulation()
    sim.install(of(80))
    assert outcome_of(sim, of(80)).outcome == "updated"  # its Service
    assert outcome_of(sim, of(81), request=Request(shared=False)).outcome == "unchanged"
    assert outcome_of(sim, of(81), request=Request(own=False)).outcome == "updated"
    assert [one["port"] for one in sim.objects["Service", "fleet", "chart"]["spec"]["ports"]] == [81]


def with_file(content: str) -> Robot:
    files = [{"path": "/etc/sensor.yaml", "content": content}]
    return robot(app("sensor", OLD, placement="local", files=files))


def file_maps_of(sim: Simulation) -> list[str]:
    """What is in them."""
    maps = [item for key, item in sim.objects.items() if key[0] == "ConfigMap" and key[2].startswith("sensor-files-")]
    return [text for item in maps for text in item["data"].values()]


def test_files_are_a_version_s_and_are_kept_for_as_long_as_its_way_back() -> None:
    sim = Simulation()
    sim.install(with_file("0"))
    versions = [str(number) for number in range(1, HISTORY_KEPT + 4)]
    for content in versions:
        assert outcome_of(sim, with_file(content), check=True).outcome == "updated"
        assert outcome_of(sim, with_file(content)).outcome == "updated"
    assert sorted(file_maps_of(sim)) == versions[-HISTORY_KEPT - 1 :]
    assert outcome_of(sim, with_file(versions[-1])).outcome == "unchanged"
    assert outcome_of(sim, with_file(versions[-1]), request=Request(to="previous")).outcome == "updated"
    assert sorted(file_maps_of(sim)) == versions[-HISTORY_KEPT:]


@pytest.mark.parametrize("scope", ["robot", "fleet"])
def test_a_record_of_another_app_of_the_same_name_is_none_of_its_own(scope: str) -> None:
    """The fleet's, of another robot, or the one that it left when it moved."""

    def of(version: str, scope: str = scope) -> Robot:
        return robot(app("sensor", version, scope=scope), master={"mode": "shared", "image": OLD})

    sim, other = Simulation(), of(image("good", 9), "fleet" if scope == "robot" else "robot")
    sim.install(of(OLD))
    space = namespace_of(other.apps[0], other)
    record = update_map("sensor", [entry(other, "sensor")], revision="12345678")
    record["metadata"]["namespace"] = space
    wanted = of(image("good"))
    assert outcome_of(sim, wanted).outcome == "updated"
    sim.objects["ConfigMap", space, "sensor-update"] = {**record, "kind": "ConfigMap", "applied": {}}
    assert outcome_of(sim, wanted, request=Request(to="previous")).outcome == "updated"
    assert ("Deployment", space, "sensor") not in sim.objects
    assert outcome_of(sim, of(OLD)).outcome == "unchanged"


# --- what a run tells -------------------------------------------------------------------------------------------------


def test_a_run_that_lost_its_lease_ends() -> None:
    """The control node sleeps for longer than a Lease lasts, and the keeper goes back meanwhile."""
    sim, wanted = begin("overlap", "never-connects")
    sim.run(wanted, settings())
    at = sim.calls.index("rollout") + 1
    sim, wanted = begin("overlap", "never-connects")
    old = running(sim, "sensor")
    found = outcome_of(sim, wanted, "asleep", at)
    assert (found.outcome, "ros-keeper had this robot" in found.reason) == ("failed", True)
    assert running(sim, "sensor") == old
    assert outcome_of(sim, wanted).outcome == "rolled-back"


def test_what_the_keeper_did_is_told_once_and_recorded() -> None:
    sim, wanted = begin("overlap", "never-connects")
    sim.run(wanted, settings())
    at = sim.calls.index("rollout") + 1
    sim, wanted = begin("overlap", "never-connects")
    sim.run(wanted, settings(), "killed", at)
    assert '"outcome": "running"' in sim.events()
    sim.advance(600.0)
    assert '"outcome": "rolled-back"' in sim.events()  # whoever looks meanwhile knows it, too
    found = outcome_of(sim, SCENARIOS["overlap"].robot(OLD))
    assert found.outcome == "unchanged"
    assert found.reason.startswith("sensor: the keeper went back from ")
    assert found.reason in sim.said
    assert '"outcome": "rolled-back"' in sim.events()
    assert "after the run that began it had gone" in sim.events()
    assert outcome_of(sim, SCENARIOS["overlap"].robot(OLD)).reason == ""


@pytest.mark.parametrize("check", [False, True])
def test_an_app_that_runs_another_image_than_its_name_means_by_now_is_told(
    check: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It is unchanged, as its Deployment is; what its pod keeps only a look at images shows."""
    sim, wanted = begin("overlap", "good")
    ref, plain = "docker.io/lab/sensor:1", world.pod_object

    def pod_object(pod: Any) -> dict[str, Any]:
        container = {"name": "ros-app", "imageID": "sha256:01d", "state": {"running": {}}}
        spec = {"nodeName": "robot1", "containers": [{"name": "ros-app", "image": ref}]}
        made = plain(pod)
        mine = made["metadata"]["labels"]["rosops.fleet/app"] == "sensor"
        return {**made, "spec": spec, "status": {**made["status"], "containerStatuses": [container]}} if mine else made

    monkeypatch.setattr(world, "pod_object", pod_object)
    known = {("robot1", ref): {"sha256:4e3"}}
    found = outcome_of(sim, SCENARIOS["overlap"].robot(OLD), check=check, known=lambda *asked: known.get(asked, ()))
    told = f"sensor runs another image than {ref} is by now on robot1: its pod keeps the old one; {TODO}"
    assert (found.outcome, found.reason) == ("unchanged", told)
    assert told in sim.said
    # whose pods are replaced by a step anyway is not
    assert outcome_of(sim, wanted, check=True, known=lambda *asked: known.get(asked, ())).reason.count("another") == 0


def test_steps_that_had_ended_before_it_waited_are_told_with_the_rest() -> None:
    sim, wanted = begin("two-steps", "good")
    first = outcome_of(sim, wanted, request=Request(only=["sensor"]))
    both = outcome_of(sim, wanted, earlier=[StepResult.from_dict(step.as_dict()) for step in first.steps])
    assert (both.outcome, [step.name for step in both.steps]) == ("updated", ["sensor", "stats"])


# --- whoever works on it, and whatever happens to it ------------------------------------------------------------------

EXAMPLES = 2000 if ALL else 60
calls = st.integers(1, 20)
faults = st.sampled_from(("", *FAULTS))


class Operators(RuleBasedStateMachine):
    """One robot, whoever works on it, and whatever happens to it."""

    @initialize(name=st.sampled_from(sorted(SCENARIOS)))
    def install(self, name: str) -> None:
        self.sim, self.scenario, self.number = Simulation(), SCENARIOS[name], 0
        self.version, self.image = "good", OLD
        self.sim.install(self.robot)

    @property
    def robot(self) -> Any:
        return self.scenario.robot(self.image)

    @rule(data=st.data())
    def want(self, data: st.DataObject) -> None:
        self.version = data.draw(st.sampled_from(self.scenario.versions), "version")
        self.number += 1
        self.image = image(self.version, self.number)

    @rule()
    def want_the_first_again(self) -> None:
        self.version, self.image = "good", OLD

    @rule(fault=faults, at=calls, then=st.tuples(calls, faults))
    def run_it(self, fault: str, at: int, then: tuple[int, str]) -> None:
        self.sim.run(self.robot, settings(), fault, at, then)

    @rule(fault=faults, at=calls)
    def run_it_back(self, fault: str, at: int) -> None:
        self.sim.run(self.robot, settings(request=Request(to="previous")), fault, at)

    @rule()
    def only_look(self) -> None:
        self.sim.run(self.robot, settings(check=True))

    @rule(seconds=st.sampled_from((1.0, 10.0, 70.0, 300.0)))
    def time_passes(self, seconds: float) -> None:
        self.sim.advance(seconds)

    @precondition(lambda self: "planner" in {app.name for app in self.robot.apps})
    @rule(seconds=st.sampled_from((1.0, 8.0, 20.0)), after=st.sampled_from((0.0, 5.0)))
    def a_goal_comes(self, seconds: float, after: float) -> None:
        self.sim.goal("/plan", seconds, after)

    @rule()
    def the_robot_leaves(self) -> None:
        self.sim.robot_until = FOREVER

    @rule()
    def the_api_goes(self) -> None:
        self.sim.api_until = FOREVER

    @rule()
    def all_is_well(self) -> None:
        self.sim.restore()

    def teardown(self) -> None:
        if not hasattr(self, "sim"):
            return
        self.sim.restore()
        self.sim.advance(60.0)  # what was sent is done
        words = [outcome.outcome for _time in range(3) if (outcome := self.sim.run(self.robot, settings()))]
        expected = {"good": ["unchanged"], "crashes-once": ["unchanged", "rolled-back"]}
        assert words[-1] in expected.get(self.version, ["rolled-back"]), words


TestOperators = Operators.TestCase
TestOperators.settings = bounds(
    max_examples=EXAMPLES,
    stateful_step_count=12,
    deadline=None,
    derandomize=True,
    database=None,
    print_blob=False,
    suppress_health_check=list(HealthCheck),
)
