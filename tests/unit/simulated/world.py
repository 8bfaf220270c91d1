# SPDX-License-Identifier: GPL-3.0-or-later
"""The simulated world of the engine's tests: cluster, host and clock around a simulated robot, faults, what must hold.

Time passes only in calls, and every call of the engine is one point at which a fault may strike. Invariants are checked
at every event, and an outcome's word is held against what the robot shows, never against the engine's own records.
"""

from __future__ import annotations

import contextlib
import copy
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import Any

from ansible_collections.rosops.fleet.plugins.module_utils._common.errors import KubeError, NotReadyError, RosError
from ansible_collections.rosops.fleet.plugins.module_utils._common.poll import FAIL, PASS, WAIT, poll
from ansible_collections.rosops.fleet.plugins.module_utils._common.poll import Seen as Look
from ansible_collections.rosops.fleet.plugins.module_utils._ros import gate
from ansible_collections.rosops.fleet.plugins.module_utils._ros.checks import Check
from ansible_collections.rosops.fleet.plugins.module_utils._ros.conditions import Conditions, conditions_from
from ansible_collections.rosops.fleet.plugins.module_utils._ros.graph import Graph
from ansible_collections.rosops.fleet.plugins.module_utils._ros.graph_json import graph_data, graph_from
from ansible_collections.rosops.fleet.plugins.module_utils._ros.idle_robot import CONSECUTIVE, hold_when_idle
from ansible_collections.rosops.fleet.plugins.module_utils._ros.messages import Heard, check_value
from ansible_collections.rosops.fleet.plugins.module_utils._ros.names import is_meant
from ansible_collections.rosops.fleet.plugins.module_utils._step import words
from ansible_collections.rosops.fleet.plugins.module_utils._step.words import SOAKING, UPDATING
from ansible_collections.rosops.fleet.plugins.plugin_utils._kube.applied import Applied
from ansible_collections.rosops.fleet.plugins.plugin_utils._kube.client import ref_of
from ansible_collections.rosops.fleet.plugins.plugin_utils._model import names
from ansible_collections.rosops.fleet.plugins.plugin_utils._model.context import Robot
from ansible_collections.rosops.fleet.plugins.plugin_utils._objects.app import app_objects
from ansible_collections.rosops.fleet.plugins.plugin_utils._objects.master import master_objects
from ansible_collections.rosops.fleet.plugins.plugin_utils._objects.namespace import namespace_objects
from ansible_collections.rosops.fleet.plugins.plugin_utils._objects.network import network_policies
from ansible_collections.rosops.fleet.plugins.plugin_utils._objects.pod_code import code_maps
from ansible_collections.rosops.fleet.plugins.plugin_utils._objects.pod_settings import rest_maps
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.change import MAYBE_UNPROVEN
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.engine import Engine
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.hands import Settings, World
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.outcome import EVENTS_NAME, RobotOutcome, StepResult
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.plan import REMOVE
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.world import (
    AwayError,
    Calm,
    CancelledError,
    Live,
    LostError,
    Object,
    Seen,
)
from ansible_collections.rosops.fleet.tests.unit.simulated.keeper import SimulatedKeeper
from ansible_collections.rosops.fleet.tests.unit.simulated.objects import ADDRESSES, addressed, field_set
from ansible_collections.rosops.fleet.tests.unit.simulated.robot import (
    EPOCH,
    FOREVER,
    HOLD,
    INFRASTRUCTURE,
    LEAST,
    Hold,
    Process,
    SimulatedRobot,
    kubernetes_hash,
    looping,
    pod_object,
    template_of,
)

DAY = 86400.0
CONNECT = 10.0  # a call gives an API up that was away for so long, and a wait says something so often
SILENCE = 11.0  # nobody looks at a silent run for longer than ten seconds, and what a call takes to notice
KEY = tuple[str, str, str]  # kind, namespace, name
RESTARTED = "kubectl.kubernetes.io/restartedAt"
BEAT = 0.1  # seconds between two messages of a topic
RUN = "the run"
CLUSTER_CALLS = ("read", "apply", "delete", "rollout")
FAULTS = (
    "api-blip", "api-away", "api-gone", "robot-away", "robot-gone", "master-silent", "master-gone",
    "refused", "time-out", "slow", "stalled", "clock-ahead", "clock-back", "killed", "asleep",
    "cancelled", "cancelled-after", "lost-answer", "away-after", "half", "half-killed", "half-cancelled",
)  # fmt: skip

KILLS = ("killed", "half-killed")
RESTARTED_APPS = "restarted"  # by hand, of which only apps that overlap feel nothing


class Killed(BaseException):
    """The control node is gone, in the middle of whatever it did."""


class Simulation(SimulatedRobot):
    """`fault` strikes at the call of number `at`, counted from 1 in every run, and one more where `then` says so; the
    count goes on in `calls`."""

    def __init__(self) -> None:
        super().__init__()
        self.skew = 0.0
        self.api_until = -1.0
        self.holder, self.renewed = "", FOREVER  # of the Lease; when it was renewed last, if nobody does any more
        self.claims = 0  # of the Lease, so far
        self.unlabelled = False  # nodes have the labels of 1.0 alone
        self.keeper = SimulatedKeeper(self)
        self.faults: dict[int, str] = {}  # at which call
        self.phase, self.phases = "", list[str]()  # where the run stands, and where it stood at each of its calls
        self.calls: list[str] = []
        self.said: list[str] = []
        self.brought: list[str] | None = None  # by the last run that brought any
        self.engine_changes: list[Applied] = []
        self.left = False  # the last run left the robot for its wave
        self.silent = 0.0
        self.last: tuple[str, object] = ("", None)
        self.checking = False
        self.touched: set[KEY] = set()  # what a run changed
        self.proven: set[tuple[tuple[str, str], str]] = set()  # a Deployment and its template
        self.watched: set[str] = set()  # apps that hand over by overlap
        self.interrupted: set[str] = set()  # those that are without one for a reason
        self.verify_seconds = 0.0
        self.cancelled, self.begun = False, 0.0
        self.before: dict[KEY, dict[str, Any]] = {}  # the Deployments at the run's beginning
        self.messages: dict[str, Callable[[float], Object | None]] = {}  # topic -> its message then
        self.steps: list[float] = []  # when a Deployment was changed for a version that is to be proven
        self.disturbed = False  # somebody else changed what the run changes
        self.unheld = True  # no call that lets goals go has met a fault
        # the Deployment of each ReplicaSet, which has its template and its annotations; the latest one last
        self.replica_sets: dict[tuple[str, str], dict[str, dict[str, Any]]] = {}

    def keeper_sees(self) -> bool:
        return super().keeper_sees() and max(self.api_until, self.robot_until) <= self.time

    # --- an operator ------------------------------------------------------------------------------------------------

    def install(self, robot: Robot) -> None:
        """What a first installation leaves, and other nodes that listen to all of it."""
        robot = addressed(robot)
        self.install_objects(robot, app_objects(robot))

    def install_objects(self, robot: Robot, apps: Sequence[Object]) -> None:
        ground = [*namespace_objects(robot), *network_policies(robot), *code_maps(robot, {}), *rest_maps(robot)]
        first = [*ground, *master_objects(robot), *apps]
        for item in first:
            self.put(item)
            if item["kind"] == "Deployment":
                self.proven.add((deployment_key(item), template_of(item)))
        self.advance(10.0)
        self.watch(robot)

    def watch(self, robot: Robot) -> None:
        """Others listen to all of it, and what overlaps is never away."""
        self.watched = {app.name for app in robot.apps if app.handoff == "overlap"}
        everything = [topic for process in self.living() for topic in process.topics]
        self.others.append(Process("/listener", "http://10.42.1.1:4000/", subscriptions=everything))
        for process in self.others:
            self.register(process)
        self.touched = set()

    def run(
        self, robot: Robot, settings: Settings, fault: str = "", at: int = 0, then: tuple[int, str] = (0, "")
    ) -> RobotOutcome | None:
        """One run with the truth of its word; None where the control node was killed."""
        self.calls, self.said, self.touched, self.silent, self.checking = [], [], set(), 0.0, settings.check
        self.faults, self.verify_seconds = {at: fault, then[0]: then[1]}, settings.verify_seconds
        self.phase, self.phases, self.disturbed = "", [], False
        self.unheld, self.cancelled, self.begun = True, False, self.time
        before = self.before = {key: obj for key, obj in self.objects.items() if key[0] == "Deployment"}
        engine = self.engine = Engine(
            robot, settings, SimulatedCluster(self), World(SimulatedHost(self), self, self.say, self.stands)
        )
        try:
            outcome = engine.run()
        except Killed:
            return None
        self.faults, self.engine_changes, self.left = {}, engine.changes, engine.left
        self.truth(engine, outcome, before)
        return outcome

    def change_by_hand(self, what: str) -> None:
        """`kubectl set image`, `kubectl scale` of all apps: the annotations stay as they are."""
        for key in self.apps():
            item = copy.deepcopy(self.objects["Deployment", *key])
            if what in ("0", "1"):
                item["spec"]["replicas"] = int(what)
            else:
                item["spec"]["template"]["spec"]["containers"][0]["image"] = what
            self.write(item, {**item, "applied": {}})

    def restart_by_hand(self) -> None:
        """`kubectl rollout restart` of all apps: a note at the template, of another manager, and nothing else."""
        for key in self.apps():
            item = copy.deepcopy(self.objects["Deployment", *key])
            item["spec"]["template"]["metadata"]["annotations"][RESTARTED] = f"{self.time:.1f}"
            self.write(item, item)

    def apps(self) -> list[tuple[str, str]]:
        found = [key[1:] for key in self.objects if key[0] == "Deployment"]
        return [key for key in found if key[1] not in INFRASTRUCTURE]

    def undo_by_hand(self, key: tuple[str, str], whole: bool = True) -> None:
        """`kubectl rollout undo`: the template of the ReplicaSet before.

        The controller copies the Deployment's annotations to its ReplicaSet, and back, and takes none of them away.
        Not `whole`: after a `kubectl set image` that came to nothing, so what runs is as it was.
        """
        item, known = copy.deepcopy(self.objects["Deployment", *key]), self.replica_sets[key]
        before = [one for name, one in known.items() if (name != kubernetes_hash(item)) == whole][-1]
        item["metadata"]["annotations"] |= before["metadata"]["annotations"]
        item["spec"]["template"] = before["spec"]["template"]
        self.write(item, {**item, "applied": {}})

    def events(self) -> str:
        return str(self.objects["ConfigMap", "robot-robot1", EVENTS_NAME]["data"])

    def now(self) -> float:
        """The clock that nobody sets."""
        return self.time

    def wall(self) -> float:
        """The control node's idea of the time; the robot's own is right."""
        return EPOCH + self.time + self.skew

    def sleep(self, seconds: float) -> None:
        self.advance(seconds)

    def say(self, text: str) -> None:
        assert text
        self.silent = 0.0
        self.said.append(text)

    def stands(self, phase: str) -> None:
        self.phase = phase

    # --- faults -----------------------------------------------------------------------------------------------------

    def restore(self) -> None:
        """The faults are over; what they did is not undone."""
        self.api_until = self.robot_until = self.master_until = -1.0
        self.skew, self.faults = 0.0, {}

    @contextlib.contextmanager
    def call(self, name: str, seconds: float, loud: bool = False, what: object = None) -> Iterator[str]:
        """One call of the engine; what it gets is the fault that strikes in its middle."""
        self.calls.append(name)
        self.phases.append(self.phase)
        fault = self.faults.get(len(self.calls), "")
        began = self.time
        if fault and name == "release":
            self.unheld = False
        try:
            self.strike(fault, name)
            self.advance(seconds)
            yield fault
            self.after(fault, name)
        finally:
            self.invariants()
            ticks = name not in CLUSTER_CALLS and self.time - began > SILENCE  # modules say that they are under way
            self.quiet((name, what), 0.0 if loud or ticks or fault else self.time - began)

    def quiet(self, call: tuple[str, object], seconds: float) -> None:
        """A call says itself that it lasts; but to call again and again is a wait, and takes words in between."""
        again, self.last = call == self.last, call
        self.silent = self.silent + seconds if again else seconds
        assert not again or self.silent <= SILENCE, f"silent for {self.silent:.0f} s at {call[0]}"

    def strike(self, fault: str, name: str) -> None:
        """What comes before the call does anything."""
        now, cluster = self.time, name in CLUSTER_CALLS
        self.api_until = {"api-blip": now + 5, "api-away": now + 45, "api-gone": FOREVER}.get(fault, self.api_until)
        self.robot_until = {"robot-away": now + 30, "robot-gone": FOREVER}.get(fault, self.robot_until)
        self.master_until = {"master-silent": now + 20, "master-gone": FOREVER}.get(fault, self.master_until)
        self.skew += {"clock-ahead": DAY, "clock-back": -DAY}.get(fault, 0.0)
        if fault == "killed":
            raise Killed(name)
        if fault == RESTARTED_APPS:
            self.disturbed = True
            self.restart_by_hand()
        if fault == "cancelled":
            raise self.cancel()
        if fault == "asleep":  # the control node, so that nobody renews the Lease
            self.renewed = self.time
            self.advance(600.0)
            self.renewed = FOREVER
        self.advance({"slow": 50.0, "stalled": 600.0}.get(fault, 0.0))
        if fault in ("refused", "time-out"):
            self.advance(40.0 if fault == "time-out" else 0.0)
            raise (KubeError if cluster else RosError)(f"{fault} at {name}")
        if cluster and self.api_until > self.time:
            self.advance(min(CONNECT, self.api_until - self.time))
            if self.api_until > self.time:
                raise KubeError("the API cannot be reached")
        if not cluster and self.robot_until > self.time:
            self.advance(5.0)
            raise AwayError("no route to host")

    def cancel(self) -> CancelledError:
        self.cancelled = True
        return CancelledError("the run was cancelled")

    def after(self, fault: str, name: str) -> None:
        """What comes when the call has done its work, and before anybody knows."""
        cluster = name in CLUSTER_CALLS
        if fault == "cancelled-after":
            raise self.cancel()
        if fault == "lost-answer":
            raise (KubeError if cluster else RosError)("the answer was lost")
        if fault == "away-after" and not cluster:
            raise AwayError("the connection broke")

    # --- what must hold at every moment -----------------------------------------------------------------------------

    def invariants(self) -> None:
        for action in [*self.holds]:
            self.expire(action)
        for app in self.watched:
            if self.serves(app):
                self.interrupted.discard(app)
            elif app not in self.interrupted:
                assert self.excused(app), f"nothing good serves {app}"
                self.interrupted.add(app)
        assert not self.cut, f"goals were cut off: {self.cut}"

    def serves(self, app: str) -> bool:
        """Whether a version is there that was proven, or that has shown its own pod all that is asked for."""
        same_master = sum(pod.app == names.MASTER_NAME for pod in self.pods) == 1  # a new one has to learn of it first
        return any(
            pod.app == app and pod.up and pod.met and (pod.version.good or (pod.key, pod.template) in self.proven)
            and (self.registered.get(pod.node) is pod.process or not same_master)
            for pod in self.pods
        )  # fmt: skip

    def excused(self, app: str) -> bool:
        """No gate sees what happens later; and somebody may want none of it."""
        late = any(pod.version.late for pod in self.pods if pod.app == app and not pod.gone)
        wanted = [item for key, item in self.objects.items() if key[0] == "Deployment" and key[2] == app]
        return late or any(item["spec"].get("replicas", 1) == 0 for item in wanted)

    def prove(self, item: Object) -> None:
        """The engine says that this version is proven; what its pods show says whether it may."""
        key, template = deployment_key(item), template_of(item)
        if words.UPDATING in item["metadata"]["annotations"] or (key, template) in self.proven:
            return
        pods = self.of(key)
        bad = f"{key} is no proven version"
        if self.disturbed:  # by then there may be another pod of it, at which nobody has looked
            pods = [pod for pod in pods if pod.template == template]
        else:
            there = self.objects["Deployment", *key]
            assert [pod.hash for pod in pods] == [kubernetes_hash(there)], f"{bad}: there are {pods}"
            assert all(pod.ready for pod in pods), f"{bad}, for it is not ready"
            assert all(self.time - pod.since >= self.verify_seconds for pod in pods), f"{bad}, for nobody looked at it"
        assert all(pod.version.good for pod in pods), f"{bad}, for it is a bad one"
        self.proven.add((key, template))

    # --- the truth of a word ----------------------------------------------------------------------------------------

    def truth(self, engine: Engine, outcome: RobotOutcome, before: Mapping[KEY, Object]) -> None:
        """What the outcome says against what is there."""
        word, away = outcome.outcome, self.robot_until > self.time
        if engine.settings.check:
            assert not self.touched, f"check mode wrote {self.touched}"
            assert not self.mine(), "check mode holds goals"
            return
        if word == "unchanged":
            assert not {key for key in self.touched if key[2] != EVENTS_NAME}, f"unchanged, and {self.touched} was"
        # whoever has it now may hold goals, too, or a server that somebody else replaced; they go after a minute
        lost = "had this robot" in outcome.reason or self.disturbed
        if self.unheld and word != "deferred-offline" and not (away or lost):
            assert not self.mine(), f"{word}, and goals of {self.mine()} are held still"
        for result, step in zip(outcome.steps, engine.plan.steps):
            gone = step.previous.values() if step.kind == REMOVE else ()
            deployments = [("Deployment", *deployment_key(item)) for item in [*step.workloads, *gone]]
            touched = self.touched & {*deployments, *(("ConfigMap", key[1], f"{key[2]}-update") for key in deployments)}
            busy = result.outcome == "deferred-busy" and "taken back" not in result.reason
            if "nothing was touched" in result.reason or busy:
                assert not touched, f"{result.outcome}: {result.reason}, and {touched} was"
            elif result.outcome == "deferred-offline" and MAYBE_UNPROVEN not in result.reason:
                assert touched, f"{result.reason}: but nothing was"
            for key, item in zip(deployments, step.workloads):
                self.word(result, key, item, before.get(key))
            if gone and result.outcome == "updated":
                heirs = {node for other in engine.plan.steps for node in other.new_nodes.values()}
                old = [node for node in self.registered if is_meant(node, [*step.old_nodes.values()])]
                left = [*self.of(deployments[0][1:]), *(node for node in old if not is_meant(node, heirs))]
                assert deployments[0] not in self.objects and not left, f"removed, and there is {left}"

    def word(self, result: StepResult, key: KEY, wanted: Object, before: Object | None) -> None:
        there = self.objects.get(key)
        if result.outcome == "updated":
            assert there and template_of(there) == template_of(wanted), f"updated, and {key} is not as wanted"
            self.is_proven(key, there, "its mark could not be taken off" in result.reason)
        elif result.outcome == "rolled-back":
            if there is None:
                assert before is None, f"rolled back, and {key} is gone"
                return
            assert template_of(there) != template_of(wanted) or before is None, f"rolled back, and {key} is the new one"
            self.is_proven(key, there, False)

    def is_proven(self, key: KEY, there: Object, marked: bool) -> None:
        pods = [pod for pod in self.of(key[1:]) if not (self.disturbed and pod.stopping)]
        assert self.disturbed or [kubernetes_hash(there)] == [pod.hash for pod in pods], f"of {key} there are {pods}"
        assert all(pod.version.good for pod in pods), f"{key} is proven, and it is a bad version"
        assert marked or words.UPDATING not in there["metadata"]["annotations"], f"{key} is marked still"
        assert marked or ((key[1], key[2]), template_of(there)) in self.proven, f"{key} was never proven"

    def mine(self) -> list[str]:
        """Actions whose goals a step of this run holds; a pod that ends holds them, too."""
        return [action for action, hold in self.holds.items() if hold.asked and hold.until - HOLD >= self.begun]

    # --- the API server ---------------------------------------------------------------------------------------------

    def put(self, item: Object, dry_run: bool = False) -> Applied:
        """Server-side apply by our manager: what it no longer says goes away, what others have stays."""
        kind, metadata = item["kind"], item["metadata"]
        key = (kind, metadata.get("namespace", ""), metadata["name"])
        before = self.objects.get(key)
        if before is not None and before["applied"] == item:
            return Applied(ref_of(item), before, before, False)
        after: dict[str, Any] = {**item, "applied": item}
        after["metadata"] = {**metadata, "uid": "1", "managedFields": [field_set(item)]}
        if kind == "Service":
            after["spec"] = {"clusterIP": ADDRESSES.get(metadata["name"], "10.43.0.1"), **item["spec"]}
        if kind == "Deployment":
            annotations = {**metadata["annotations"], "deployment.kubernetes.io/revision": "1"}
            after["metadata"]["annotations"] = annotations
            after["status"] = {}
            after["spec"] = with_note(item["spec"], before)
        if not dry_run:
            if self.time:
                new = kind == "Namespace" and before is None
                assert new or self.holder == RUN, f"{key} is changed by a run that has no Lease"
            if kind == "Deployment" and self.time:
                assert not self.cancelled, "a run that was cancelled goes on"
                if "--keep" not in item["spec"]["template"]["spec"]["containers"][0].get("command", ()):
                    self.prove(item)
            self.touched.add(key)
            if kind == "Deployment" and before and template_of(item) != template_of(before) and self.is_unproven(item):
                self.steps.append(self.time)
            self.write(item, after)
        return Applied(ref_of(item), before, after, True)

    def keep_replica_set(self, item: dict[str, Any]) -> None:
        known = self.replica_sets.setdefault(deployment_key(item), {})
        before = known.pop(kubernetes_hash(item), {"metadata": {"annotations": {}}})
        notes = {**before["metadata"]["annotations"], **item["metadata"]["annotations"]}
        known[kubernetes_hash(item)] = {**item, "metadata": {**item["metadata"], "annotations": notes}}

    def is_unproven(self, item: Object) -> bool:
        return (deployment_key(item), template_of(item)) not in self.proven

    def write(self, item: Object, after: dict[str, Any] | None = None) -> None:
        """Whoever it is that writes it."""
        key = (item["kind"], item["metadata"].get("namespace", ""), item["metadata"]["name"])
        self.objects[key] = after or {**self.objects[key], **item, "applied": item}
        self.changed()
        if item["kind"] == "Deployment":
            self.keep_replica_set(self.objects[key])
            self.reconcile(deployment_key(item))
            if {UPDATING, SOAKING} & {*item["metadata"]["annotations"]}:
                self.keeper.begin()


def with_note(spec: dict[str, Any], before: Mapping[str, Any] | None) -> dict[str, Any]:
    """What we apply, with the note of another manager on the pod's template that was there before."""
    noted = ((before or {}).get("spec") or {}).get("template", {}).get("metadata", {}).get("annotations") or {}
    template, kept = spec["template"], {key: text for key, text in noted.items() if key == RESTARTED}
    annotations = {**(template["metadata"].get("annotations") or {}), **kept}
    return {**spec, "template": {**template, "metadata": {**template["metadata"], "annotations": annotations}}}


def deployment_key(item: Object) -> tuple[str, str]:
    return item["metadata"]["namespace"], item["metadata"]["name"]


class SimulatedCluster:
    """The engine's Cluster."""

    def __init__(self, sim: Simulation) -> None:
        self.sim, self.claimed = sim, False
        self.earlier: dict[int, int] = {}  # by pod, restarts that are not this run's

    def unlabelled(self, _robot: Robot) -> bool:
        return self.sim.unlabelled

    def door(self, _robot: Robot) -> None:
        """The simulated host answers for the keeper, too."""

    def read(self, namespaces: Iterable[str]) -> Live:
        with self.sim.call("read", 0.2):
            kinds = ("Deployment", "ConfigMap", "Service", "NetworkPolicy")
            found: dict[str, list[Object]] = {kind: [] for kind in kinds}
            for (kind, namespace, _name), item in self.sim.objects.items():
                if kind in found and namespace in namespaces:
                    found[kind].append({key: value for key, value in item.items() if key != "applied"})
            pods = [pod_object(pod) for pod in self.sim.pods if not pod.gone]
            return Live(found["Deployment"], found["ConfigMap"], found["Service"], pods, found["NetworkPolicy"])

    @contextlib.contextmanager
    def claim(self, _namespace: str) -> Iterator[None]:
        sim = self.sim
        with sim.call("claim", 0.1):
            assert not sim.checking
        sim.holder, sim.renewed, self.claimed = RUN, FOREVER, True
        sim.claims += 1
        try:
            yield
        except Killed:
            sim.renewed = sim.time
            raise
        sim.holder, self.claimed = "", False
        sim.claims += 1

    def confirm(self) -> None:
        if self.claimed and self.sim.holder != RUN:
            raise LostError("ros-keeper had this robot")

    def apply(self, objects: Sequence[Object], dry_run: bool = False) -> Sequence[Applied]:
        sim = self.sim
        if not objects:
            return ()
        with sim.call("apply", 0.1) as fault:
            self.confirm()
            half = len(objects) // 2 if fault.startswith("half") else len(objects)
            changes = [sim.put(item, dry_run) for item in objects[:half]]
            if fault == "half-cancelled":
                raise sim.cancel()
            if fault.startswith("half"):
                raise {"half": KubeError, "half-killed": Killed}[fault]("half way")
            return changes

    def delete(self, objects: Sequence[Object], dry_run: bool = False) -> Sequence[Applied]:
        sim, done = self.sim, list[Applied]()
        if not objects:
            return done
        with sim.call("delete", 0.1):
            assert dry_run or not sim.checking
            assert dry_run or self.claimed, "it is deleted by a run that has no Lease"
            self.confirm()
            for item in objects:
                key = (item["kind"], *deployment_key(item))
                done.append(Applied(ref_of(item), sim.objects.get(key), None, key in sim.objects))
                former = item["metadata"]["name"] == names.EXPORTER_NAME  # of an earlier collection
                removed = former or sim.engine.settings.request.remove or item["kind"] != "Deployment"
                assert dry_run or removed or key not in sim.before, f"{key} was there before this run, which deletes it"
                assert removed or item["metadata"]["uid"] == "1", f"{key} is deleted, whichever one that is"
                if not dry_run and sim.objects.pop(key, None) is not None:
                    sim.touched.add(key)
                    sim.watched -= {key[2]} if sim.engine.settings.request.remove else set()
                    sim.reconcile(deployment_key(item))
        return done

    def wait(self, objects: Sequence[Object], timeout: float, stay: float | None = None, begun: bool = False) -> None:
        """`whole`: what ends before it is over, or has ended since the run began, is bad."""
        sim, whole, seconds = self.sim, begun or stay is not None, stay or 0.0
        with sim.call("rollout", 0.1, loud=True):
            end, well = sim.time + timeout, FOREVER
            for pod in sim.pods:
                self.earlier.setdefault(pod.uid, pod.restarts if pod.ready else 0)
            rows, seen = list[tuple[str, str]](), -1
            while True:
                if sim.version != seen:
                    rows, seen = [self.verdict(item, whole, begun) for item in objects], sim.version
                bad = [why for verdict, why in rows if verdict == FAIL]
                there = all(verdict == PASS for verdict, _why in rows)
                well = min(well, sim.time) if there else FOREVER
                if bad or (sim.time >= end and not there):
                    raise NotReadyError("; ".join(why for verdict, why in rows if verdict != PASS))
                if sim.time >= well + seconds and sim.api_until <= sim.time:
                    return
                if sim.time >= max(end, well + seconds):
                    raise NotReadyError("no news of the cluster")
                sim.advance(min(0.25, max(end, well + seconds if there else 0.0) - sim.time))

    def verdict(self, item: Object, whole: bool, begun: bool) -> tuple[str, str]:
        sim, key = self.sim, deployment_key(item)
        if item["kind"] != "Deployment":
            return (PASS, "") if (item["kind"], *key) in sim.objects else (WAIT, f"{key} is not there")
        there, pods = sim.deployment(key), sim.of(key)
        if there is None:
            return WAIT, f"{key} is not there"
        wanted = kubernetes_hash(there)
        for pod in pods:
            started_again = whole and pod.restarts > self.earlier.get(pod.uid, 0)
            if pod.hash == wanted and (pod.hopeless or started_again or looping(pod)):
                return FAIL, pod.hopeless or f"{key} crashes"
        if [pod.hash for pod in pods] == [wanted] and pods[0].ready:
            return PASS, ""
        ready_only = "minReadySeconds" in there["spec"]
        new = [pod for pod in pods if pod.hash == wanted]
        if begun and any(pod.ready or (not ready_only and (pod.waits or pod.up)) for pod in new):
            return PASS, ""
        return WAIT, f"{key} is not rolled out"


class SimulatedHost:
    """The engine's Host."""

    def __init__(self, sim: Simulation) -> None:
        self.sim = sim

    def by(self, _door: None, _trace: Callable[[str], None]) -> SimulatedHost:
        return self

    def there(self) -> None:
        with self.sim.call("there", 0.2):
            pass

    def bring(self, images: Sequence[str]) -> None:
        with self.sim.call("bring", 0.5):
            self.sim.brought = [*images]

    def graph(self, master: str, rate_seconds: float = 0.0, nodes: Sequence[str] = ()) -> Graph:
        sim = self.sim
        with sim.call("rates" if nodes else "graph", 0.7):
            assert master
            assert rate_seconds or not nodes
            heard = sim.graph().heard(nodes)
            rates = sim.rates(heard, dict.fromkeys(heard.topics, rate_seconds)) if nodes else {}
            return graph_from(graph_data(sim.graph().measured(rates, {})))

    def hold(self, master: str, keeper: str, calm: Calm, seconds: float, timeout: float) -> Seen:
        sim, actions = self.sim, calm.actions
        assert seconds <= HOLD
        with sim.call("hold", 0.7) as fault:
            names_ = [{"name": action["name"], "state": "idle"} for action in actions]
            keeping = KeeperOf(sim, conditions_from({"actions": names_, "values": calm.when}), seconds)
            servers = {str(action["name"]): str(action["server"]) for action in actions if action.get("server")}
            only_look, looks = sim.checking or not (keeper and seconds), CONSECUTIVE if seconds else 1
            ended = hold_when_idle(keeping, {} if only_look else servers, timeout, 0.5, looks, sim.now, sim.advance)
            del master, fault
            unmet = [str(check) if check.kind == "value" else check.reason for check in ended.last.unmet]
            return Seen(ended.verdict, "; ".join(unmet))

    def release(self, keeper: str, actions: Sequence[Object]) -> None:
        with self.sim.call("release", 0.7):
            assert not self.sim.checking
            for action in actions if keeper else ():
                self.sim.let_go(str(action["name"]))

    def ready(self, master: str, conditions: Object, timeout: float, stable: float = 0.0) -> Seen:
        sim, wanted = self.sim, conditions_from({**conditions, "timeout": timeout, "stable": stable})
        with sim.call("ready", 0.7, what=id(conditions)):
            assert master

            seen: dict[tuple[int, bool], gate.Look] = {}

            def look() -> Look:
                sim.advance(LEAST)  # a look takes time, else a poll could go on for ever at one moment
                now = (sim.version, sim.master_until > sim.time)
                found = seen[now] if now in seen and seen[now].verdict != PASS else gate.look(sim, wanted)
                seen[now] = found
                return Look(found.verdict, found)

            ended = poll(look, timeout, 0.5, now=sim.now, sleep=sim.advance, stable=stable)
            return Seen(ended.verdict, "; ".join(map(str, ended.last.unmet)))

    def register(self, master: str, graph: Graph, nodes: Sequence[str] = ()) -> None:
        sim = self.sim
        with sim.call("register", 0.7):
            assert master
            sim.ask_master()
            for process in sim.living():
                known = process.node in graph.names and (not nodes or is_meant(process.node, nodes))
                if known and not sim.registered_whole(process):
                    sim.register(process)

    def reap(self, master: str, nodes: Sequence[str], hosts: Sequence[str]) -> None:  # noqa: ARG002 - it knows the dead
        sim = self.sim
        with sim.call("reap", 0.7):
            assert master
            sim.ask_master()
            for node, process in [*sim.registered.items()]:
                if is_meant(node, nodes) and not process.alive:
                    sim.unregister(node)


class KeeperOf:
    """What `hold_when_idle` looks at and asks of the keeper."""

    def __init__(self, sim: Simulation, conditions: Conditions, seconds: float) -> None:
        self.sim, self.conditions, self.seconds = sim, conditions, seconds
        self.heard_until = sim.time
        self.heard = [Heard(condition, sim.time) for condition in conditions.values]

    def look(self) -> Look:
        found = gate.look(self.sim, self.conditions, ears=self.checks)
        return Look(found.verdict, found)

    def checks(self, graph: Graph) -> list[Check]:
        """What messages say, to whoever listens since the call began."""
        sim = self.sim
        while self.heard_until <= sim.time:
            for one in self.heard:
                message = sim.messages.get(one.condition.topic, lambda _time: None)(self.heard_until)
                if message is not None:
                    one.take(message, self.heard_until)
            self.heard_until += BEAT
        return [check_value(graph, one, sim.time) for one in self.heard]

    def hold(self, servers: Mapping[str, str]) -> Mapping[str, str]:
        return {action: self._hold(action, server) for action, server in servers.items()}

    def _hold(self, action: str, server: str) -> str:
        sim = self.sim
        if not sim.is_up(names.KEEPER_NAME):
            return "there is no keeper"
        now = next((one for one in sim.state().servers(action) if is_meant(one, [server])), server)
        sim.holds[action] = Hold(sim.registered.get(now), sim.time + self.seconds, asked=True)
        sim.later(self.seconds, lambda: sim.expire(action))
        return ""

    def isolate(self, servers: Mapping[str, str]) -> None:
        """Nothing that is simulated."""

    def release(self, actions: Iterable[str]) -> Mapping[str, str]:
        for action in actions:
            self.sim.let_go(action)
        return dict.fromkeys(actions, "")
