# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""What happens to one robot, from "what differs" to its outcome. The world is handed in.

    plan      what differs from the inventory; nothing does: `unchanged`
    prepare   images on the node, namespace, claims, code for the pods, while the robot works

then, where no app is at work, all that is new at once: applied, awaited, and the graph is what the apps promised; else

    record    the graph, once for all steps
    and for every step
    gate      what has to hold, and whether anything forbids the step
    hold      idle, new goals held back, idle still; now the rates of what the step replaces are those of rest
    apply     record, way back and new version, marked as not proven
    hand over by the pods themselves; awaited
    verify    the graph is what was recorded
    finish    the mark comes off
    or back   once the new version is idle or dead: the old version, under the same proof

and in the end, where that is asked for, the graph of the whole robot is what its apps promise.

What has to be remembered is in the cluster before it is needed: the mark on the Deployment, and the contract and the
way back in a ConfigMap beside it. So a run may end at any line, and the next one goes on from there.
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace

from ansible_collections.rosops.fleet.plugins.module_utils._common.errors import FleetError, NotReadyError, RosError
from ansible_collections.rosops.fleet.plugins.module_utils._common.poll import FAIL, PASS, WAIT
from ansible_collections.rosops.fleet.plugins.plugin_utils._kube.applied import Applied
from ansible_collections.rosops.fleet.plugins.plugin_utils._model import names
from ansible_collections.rosops.fleet.plugins.plugin_utils._model.context import Robot, master_uri
from ansible_collections.rosops.fleet.plugins.plugin_utils._model.outcomes import (
    BUSY,
    FAILED,
    OFFLINE,
    ROLLED_BACK,
    UNCHANGED,
    UPDATED,
)
from ansible_collections.rosops.fleet.plugins.plugin_utils._objects.namespace import (
    needs_fleet_namespace,
    removed_claims,
    storage_objects,
)
from ansible_collections.rosops.fleet.plugins.plugin_utils._objects.parts import (
    NAMESPACE,
    PARTS,
    READY,
    ground_objects,
    workload_objects,
)
from ansible_collections.rosops.fleet.plugins.plugin_utils._update import step as decide
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.drift import suspects
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.events import (
    EVENTS_NAME,
    REASON_KEPT,
    back_in_words,
    events_map,
    known_events,
    step_id,
    ways_back,
)
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.install import (
    INSTALL,
    SERVING,
    claim_users,
    members,
    promised,
    with_install,
)
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.outcome import (
    WAITING,
    RobotOutcome,
    StepResult,
    robot_outcome,
)
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.plan import (
    Plan,
    Request,
    Step,
    deployments_of,
    update_plan,
    wanted_deployments,
)
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.world import (
    AwayError,
    CancelledError,
    Graph,
    HeldError,
    Live,
    LostError,
    Object,
    Seen,
    World,
)

SLICE = 8.0  # seconds of one wait on the robot; what is open is said after each
HOLD_SECONDS = 60.0  # the keeper lets held goals go then by itself, if the step never comes to its end
MASTER_SECONDS = 30.0
VERIFY_EXTRA = 20.0
LOOK_SECONDS = 2.0  # of a look at what has had its time
UNPROVEN = "it runs unproven beside the way back; the next run takes this step up again"
NO_MASTER = "run the stage master of rosops.fleet.site first"
UNFINISHED = "what came up stays as it is; the next run goes on from there"


class BusyError(FleetError):
    """The robot works, and the run does not wait any longer."""


@dataclass(frozen=True)
class Settings:
    """How a run goes. Times are in seconds."""

    request: Request = field(default_factory=Request)
    on_busy: str = "wait"  # wait, defer or force
    busy_timeout: float = 600.0
    look_timeout: float | None = None  # of waiting in this run of the engine; then it is `waiting`. None: as above
    since: Mapping[str, float] = field(default_factory=dict)  # step -> when it began to wait, by the clock's `now`
    earlier: Sequence[StepResult] = ()  # steps that have ended before, in this run of the playbook
    ready_timeout: float = 120.0
    verify_seconds: float = 1.0
    rate_tolerance: float = 0.1
    rate_seconds: float = 1.0
    check: bool = False
    code: Mapping[str, str] = field(default_factory=dict)  # what runs in the pods, file name -> content
    parts: Collection[str] = tuple(part for part in PARTS if part != READY)
    pull_secrets: Sequence[Mapping[str, object]] = ()  # items of robot_namespace_pull_secrets
    remove_claims: Sequence[str] = ()  # names of volumes whose claims go, with their data
    remove_confirm: bool = False
    rollout_timeout: float = 300.0  # of what is installed, whose images may have to be pulled
    at_work: bool = True  # whether a robot at work may be changed; else it is only looked at
    edge_images: Mapping[str, Sequence[str]] = field(default_factory=dict)  # edge host -> names of images there


@dataclass
class _Now:
    """The step at hand, for as long as it lasts."""

    step: Step
    started: float
    phases: dict[str, float] = field(default_factory=dict)
    graph: Graph = field(default_factory=lambda: decide.NO_GRAPH)  # in the names that the steps before it have given
    gate: decide.Gate | None = None
    maps: Sequence[Object] = ()  # the contracts and the way back, as they were applied
    held: Sequence[Mapping[str, str]] = ()  # actions whose new goals are, or may be, held back
    applied: bool = False
    patient: bool = False  # the time for which a busy robot is waited for is not over


class Engine:
    """One robot, one run."""

    def __init__(self, robot: Robot, settings: Settings, world: World) -> None:
        self.robot, self.settings = robot, settings
        self.cluster, self.host, self.clock = world.cluster, world.host, world.clock
        self.say, self.trace = world.say, world.trace
        self.live, self.plan, self.graph = Live(), Plan(), decide.NO_GRAPH
        self.recorded = self.over = False
        self.waiting: dict[str, float] = {}  # step -> since when it has waited for the robot, by the clock's `now`
        self.rated: set[str] = set()  # nodes
        self.graph_told: dict[str, object] = {}  # of what the whole robot promises: verdict, and elapsed seconds
        self.left = False  # it is at work and has to be changed, which this run may not
        self.results: list[StepResult] = []
        self.changes: list[Applied] = []

    # --- the robot --------------------------------------------------------------------------------------------------

    def run(self) -> RobotOutcome:
        """From what differs to the outcome. Whatever goes wrong with this robot is its outcome, and no error."""
        try:
            gone = removed_claims(self.robot, self.settings.remove_claims, self.settings.remove_confirm)
            self.host.there()
            self._plan()
            self.left = not self.settings.at_work and any(step.kind != INSTALL for step in self.plan.steps)
            if self.left:
                return RobotOutcome(UNCHANGED, "at work: it is changed in its wave")
            if self.settings.check or not self.plan.steps:
                self._change()
            else:
                self._apply_all(self._ground([NAMESPACE]))
                with contextlib.ExitStack() as claims:
                    claims.enter_context(self.cluster.claim(self.robot.namespace))
                    self._plan()  # the run that had it may have ended just now
                    if self._is_shared():
                        claims.enter_context(self.cluster.claim(names.FLEET_NAMESPACE))
                        self._plan()
                    self._change()
        except FleetError as error:
            if not self.results:
                word = {HeldError: BUSY, LostError: BUSY, AwayError: OFFLINE}.get(type(error), FAILED)
                before = tuple(self.settings.earlier)
                return RobotOutcome(word, str(error) if before else f"nothing was touched: {error}", before)
        earlier = self.settings.earlier
        outcome = robot_outcome([*earlier, *self.results], len(earlier) + len(self.plan.steps))
        found = self._conclude(outcome, gone)
        return replace(found, reason="; ".join(filter(None, [found.reason, *self._news()])))

    def _news(self) -> list[str]:
        """What the keeper did that no run has told yet."""
        known = {str(event.get("reason")) for event in known_events(self.live.maps, self.robot.name)}
        told = {app: back_in_words(one) for app, one in ways_back(self.live.deployments).items()}
        return [f"{app}: {text}" for app, text in told.items() if text[:REASON_KEPT] not in known]

    def _conclude(self, outcome: RobotOutcome, gone: Sequence[Object]) -> RobotOutcome:
        """What comes after all steps, if they went well: claims go, and the whole graph is looked at."""
        if outcome.outcome not in (UPDATED, UNCHANGED):
            return outcome
        try:
            self._remove(gone)
            installed = any(step.kind == INSTALL for step in self.plan.steps)  # that was looked at just now
            if READY in self.settings.parts and not (self.settings.check or installed):
                self._all_ready()
        except FleetError as error:
            word = OFFLINE if isinstance(error, AwayError) else FAILED
            return replace(outcome, outcome=word, reason="; ".join(filter(None, [outcome.reason, str(error)])))
        if outcome.outcome == UNCHANGED and self.changes:
            return replace(outcome, outcome=UPDATED, reason=", ".join(str(change.ref) for change in self.changes))
        return outcome

    def _change(self) -> None:
        """Take the steps. What goes wrong before the first of them is an error, afterwards it is the step's result."""
        if self.plan.orphans:
            self.say(f"not in the inventory, left as they are: {', '.join(self.plan.orphans)}")
        for news in self._news():
            self.say(news)
        gated = [step for step in self.plan.steps if step.kind != INSTALL and not step.proven]
        self._prepare(gated)
        if gated:
            self._record()
        for step in self.plan.steps:
            now = self._begun(step)
            take = self._finish if step.proven else self._install if step.kind == INSTALL else self._step
            self.results.append(take(now))
            if self.results[-1].outcome != UPDATED or self.over:
                break
        self._tell()

    def _begun(self, step: Step) -> _Now:
        """The step, at its beginning or where it waits again."""
        waited = self.clock.now() - self.settings.since.get(step.name, self.clock.now())
        return _Now(step, self.clock.wall() - waited, {"wait": round(waited, 3)} if waited else {})

    def _read(self) -> Live:
        shared = [names.FLEET_NAMESPACE] if needs_fleet_namespace(self.robot) else []
        return self.cluster.read([self.robot.namespace, *shared])

    def _plan(self) -> None:
        self.live = self._read()
        request = replace(self.settings.request, parts=self.settings.parts)
        plan = update_plan(self.robot, self.live, request, self._drifted())
        self.plan = with_install(plan, self.robot, self.live)

    def _drifted(self) -> set[tuple[str, str]]:
        """Deployments that are not what they say. The API server knows whether a difference is one."""
        suspected = suspects(wanted_deployments(self.robot), self.live.deployments)
        found = [one.ref for one in self.cluster.apply(suspected, dry_run=True) if one.changed] if suspected else []
        for ref in found:
            self.say(f"{ref.name} was changed by hand")
        return {(ref.namespace, ref.name) for ref in found}

    def _is_shared(self) -> bool:
        """Whether a step changes what is the whole fleet's. To make what is not there is anybody's."""
        gated = [step for step in self.plan.steps if step.kind != INSTALL]
        places = {item["metadata"].get("namespace") for step in gated for item in step.objects}
        return names.FLEET_NAMESPACE in places

    def _ground(self, parts: Collection[str]) -> list[Object]:
        """What the pods stand on: of the parts that are asked for, these."""
        wanted = [part for part in self.settings.parts if part in parts]
        return list(ground_objects(self.robot, wanted, self.settings.pull_secrets, self.settings.code))

    def _prepare(self, gated: Sequence[Step]) -> None:
        """What all of it stands on, and what the steps need, while the robot works."""
        self.trace("prepare")
        if gated:  # what is installed has its images pulled by the node, all at the same time
            self.host.bring(sorted({image for step in gated for image in decide.local_images(step)}))
        there = self.plan.steps and not self.settings.check  # the namespace, by now
        self._apply_all(self._ground([part for part in PARTS if part != NAMESPACE or not there]))

    def _record(self) -> None:
        """Once for all steps. The update of a master that does not answer is how to mend it."""
        self.trace("record")
        try:
            self.graph, self.recorded = self.host.graph(self.master), True
        except (AwayError, CancelledError):
            raise
        except FleetError:
            mending = [step for step in self.plan.steps if step.kind == "master"]
            if self.settings.on_busy != "force" and not mending:
                raise
            # a new keeper has nobody to ask: it waits for a master that answers
            self.plan = replace(self.plan, steps=[*mending, *(step for step in self.plan.steps if step not in mending)])

    @property
    def master(self) -> str:
        """The address of the robot's ROS master, as its hosts reach it."""
        if self.robot.master.mode == "external":
            return master_uri(self.robot)
        return self.live.service_uri(names.MASTER_NAME)

    @property
    def keeper(self) -> str:
        return self.live.service_uri(names.KEEPER_NAME)

    # --- where no app is at work ------------------------------------------------------------------------------------

    def _install(self, now: _Now) -> StepResult:
        """All at once. There is nothing to go back to: what does not come up stays, and is told."""
        step = now.step
        if not (self.master or names.MASTER_NAME in step.apps):
            return self._result(now, FAILED, f"nothing was touched: {self.robot.name} has no ROS master; {NO_MASTER}")
        try:
            with self._phase(now, "apply"):
                now.applied = not self.settings.check
                self._apply_all(decide.marked(step.objects, str(int(now.started))) if now.applied else step.objects)
            if self.settings.check:
                return self._result(now, UPDATED)
            with self._phase(now, "rollout"):
                claims = storage_objects(self.robot) if set(step.apps) - set(SERVING) else []
                self.cluster.wait([*claims, *step.workloads], self.settings.rollout_timeout)
            with self._phase(now, "verify"):
                self._promised(step.conditions, self.settings.verify_seconds)
                self.cluster.wait(step.workloads, 5.0, fail_on_restart=True)
            result = self._result(now, UPDATED)
            self._apply_all([*step.workloads, self._events(None, [result])])
            return result
        except (AwayError, CancelledError, LostError) as error:
            return self._broken_off(now, error)
        except FleetError as error:
            return self._result(now, FAILED, f"{error}; {UNFINISHED}{self._half(now)}")

    def _half(self, now: _Now) -> str:
        """Prove each app that came up all the same, so that it is at work from now on; what to say of that."""
        proven, timeout = list[str](), self.settings.verify_seconds + LOOK_SECONDS
        try:
            for app, workloads in members(now.step).items():
                with contextlib.suppress(NotReadyError):
                    self.cluster.wait(workloads, LOOK_SECONDS)
                    self._promised(promised(self.robot, [app]), self.settings.verify_seconds, timeout)
                    self._apply_all(workloads)
                    proven.append(app)
        except FleetError as error:
            self.say(f"{now.step.name}: {error}")
        return f"; up: {', '.join(proven)}" if proven else ""

    def _promised(self, conditions: Object, stable: float, timeout: float | None = None) -> None:
        """The graph is what the apps promised."""
        if not self.master:  # it was made just now
            self.live = replace(self.live, services=self._read().services)
        if not self.master:
            raise NotReadyError(f"{self.robot.name} has no ROS master; {NO_MASTER}")
        began, self.graph_told = self.clock.now(), {"verdict": FAIL}
        limit = float(conditions["timeout"]) if timeout is None else timeout
        try:
            self._ready(conditions, limit, "the graph is what the apps promised", stable)
            self.graph_told["verdict"] = PASS
        finally:
            self.graph_told["elapsed"] = round(self.clock.now() - began, 3)

    def _all_ready(self) -> None:
        """All of the robot is rolled out, and its graph is what its apps promise, whether or not they were changed."""
        wanted = [*storage_objects(self.robot), *deployments_of(workload_objects(self.robot, PARTS))]
        self.cluster.wait(wanted, self.settings.rollout_timeout)
        self._promised(promised(self.robot, [app.name for app in self.robot.apps]), 0.0)

    def _remove(self, claims: Sequence[Object]) -> None:
        """The claims, with their data; none of them while something runs that mounts it."""
        if not claims:
            return
        leaving = [app for step in self.plan.steps for app in step.apps] if self.settings.check else []
        users = claim_users(self._read(), claims, leaving)
        if users:
            raise NotReadyError(f"no claim is deleted while an app runs that mounts it: {', '.join(users)}")
        self.changes += [done for done in self.cluster.delete(claims, self.settings.check) if done.changed]

    # --- a step -----------------------------------------------------------------------------------------------------

    def _step(self, now: _Now) -> StepResult:
        try:
            with self._phase(now, "gate"):
                gate = self._gate(now)
            with self._phase(now, "wait"):
                self._hold(now, gate)
            with self._phase(now, "record"):
                gate = self._rates(now, gate)
            with self._phase(now, "apply"):
                self._apply(now, gate)
            if self.settings.check:
                return self._result(now, UPDATED)
            with self._phase(now, "rollout"):
                self.cluster.wait(now.step.workloads, self.settings.ready_timeout, fail_on_restart=True)
            with self._phase(now, "verify"):
                self._verify(now, gate)
            return self._finish(now)
        except (BusyError, AwayError, CancelledError, LostError) as error:
            return self._broken_off(now, error)
        except FleetError as error:
            return self._failed(now, error)

    def _gate(self, now: _Now) -> decide.Gate:
        """Refuse what cannot go well, before anything is touched."""
        now.graph = decide.renamed_graph(self.graph, self.plan.steps[: len(self.results)])
        gate = now.gate = decide.step_gate(now.step, now.graph, self.live, self.settings.edge_images)
        for warning in gate.warnings:
            self.say(f"WARNING: {now.step.name}: {warning}")
        if gate.problems:
            raise NotReadyError("; ".join(gate.problems))
        return gate

    def _rates(self, now: _Now, gate: decide.Gate) -> decide.Gate:
        """What the nodes send when the robot rests is what the next version has to send, too.

        Steps that wait for nobody have theirs measured together. One that is forced may find the robot at work.
        """
        missing = {*gate.nodes} - self.rated
        at_work = self._policy(now) == "force" and decide.at_work(now.graph, gate.rest)
        if missing and self.recorded and not at_work:
            if not gate.rest:
                later = [decide.step_gate(step, self.graph, self.live) for step in self.plan.steps[len(self.results) :]]
                missing |= {node for other in later if not other.rest for node in other.nodes} - self.rated
            measured = self.host.graph(self.master, self.settings.rate_seconds, sorted(missing))
            self.rated |= missing
            self.graph = decide.with_rates(self.graph, measured)
            now.graph = decide.renamed_graph(self.graph, self.plan.steps[: len(self.results)])
            gate = now.gate = decide.step_gate(now.step, now.graph, self.live, self.settings.edge_images)
        for line in gate.allowed if self.settings.check else ():
            self.say(f"{now.step.name}: {line}")
        return gate

    def _policy(self, now: _Now) -> str:
        return now.step.on_busy or self.settings.on_busy

    def _hold(self, now: _Now, gate: decide.Gate) -> None:
        """Wait until the robot is idle, and hold new goals back, so that none comes before the old server's end."""
        policy = self._policy(now)
        if not gate.rest or policy == "force":
            return
        if policy == "wait" and not self.settings.check:
            # a wait may be long, and whoever looks at the robot meanwhile wants to know of it
            self._apply_all([self._events(now)])
        seen = self._rest(now, gate.rest, f"{now.step.name} waits until the robot is idle")
        if self.settings.check:
            self.say(f"{now.step.name}: {'idle now' if seen.verdict == PASS else f'busy now: {seen.reason}'}")
        # in check mode nobody has waited: what would be waited for is no reason to leave out the rest of the plan
        if seen.verdict == WAIT and not (self.settings.check and policy == "wait"):
            raise BusyError(seen.reason)
        if seen.verdict == FAIL:
            raise NotReadyError(f"the actions cannot be looked at: {seen.reason}")
        if seen.verdict == PASS and seen.reason:  # a goal that comes now may be lost
            self.say(f"{now.step.name}: {seen.reason}")

    def _rest(self, now: _Now, rest: Sequence[Mapping[str, str]], what: str) -> Seen:
        """Until the actions are idle and new goals held, for as long as the policy says."""
        waits = self._policy(now) == "wait" and not self.settings.check
        began = self.waiting.setdefault(now.step.name, self.settings.since.get(now.step.name, self.clock.now()))
        end = began + (self.settings.busy_timeout if waits else 0.0)
        left, limit = max(end - self.clock.now(), 0.0), self.settings.look_timeout
        now.held = [] if self.settings.check else rest  # as long as nobody knows better: an answer may be lost
        seen = self._until(
            lambda seconds: self.host.hold(self.master, self.keeper, rest, HOLD_SECONDS, seconds),
            left if limit is None else min(left, limit),
            what,
        )
        now.patient = self.clock.now() < end
        now.held = [action for action in rest if action["name"] in seen.held]
        return seen

    def _apply(self, now: _Now, gate: decide.Gate) -> None:
        if self.settings.check:
            self._apply_all(now.step.objects)
            return
        bounds = decide.Bounds(self.settings.rate_tolerance, self.settings.ready_timeout)
        objects = decide.step_objects(now.step, gate.contracts, bounds, self.clock.wall())
        now.maps = [item for item in objects if item["kind"] == "ConfigMap"]
        now.applied = True  # from the first of these objects on
        self._apply_all([self._events(now), *objects])

    def _verify(self, now: _Now, gate: decide.Gate) -> None:
        """The graph is what was recorded, for as long as asked, and nothing was started again meanwhile."""
        if now.step.kind == "master":
            if not self.master:  # it is the robot's first one
                self.live = replace(self.live, services=self._read().services)
            # its pod is ready a moment before its Service leads there
            self._ready({}, MASTER_SECONDS, "the new master answers")
            if self.recorded:
                self.host.register(self.master, now.graph)
        seconds = self.settings.verify_seconds
        proof = decide.proof(now.step, gate.contracts, self.settings.rate_tolerance)
        if decide.proves_nothing(proof):
            self.say(f"{now.step.name}: nothing is recorded and nothing promised to hold it to: only its pod is proven")
        patience = seconds + max(VERIFY_EXTRA, now.step.patience)
        self._ready(proof, patience, f"{now.step.name} is what was recorded", stable=seconds)
        self.cluster.wait(now.step.workloads, 5.0, fail_on_restart=True)

    def _finish(self, now: _Now) -> StepResult:
        """Say that the contract is fulfilled, then take the mark off. Where that cannot be done it is proven anyway."""
        self.trace(f"{now.step.name}: finish")
        try:
            result = self._result(now, UPDATED)
            self._apply_all([*decide.fulfilled(now.maps), *now.step.workloads, self._events(None, [result])])
            if (
                now.step.resume or now.step.drifted
            ):  # the new server may have been there before, and then the keeper waits for a next one
                self._release(now)
            return result
        except LostError as error:  # whoever had the robot meanwhile may have changed what was proven
            return self._broken_off(now, error)
        except FleetError as error:
            self.over = isinstance(error, CancelledError)
            reason = f"its mark could not be taken off ({error}); the next run does that"
            self.say(f"{now.step.name}: {reason}")
            return self._result(now, UPDATED, reason)

    def _broken_off(self, now: _Now, error: FleetError, before: str = "") -> StepResult:
        """This run does nothing more to the robot."""
        if isinstance(error, CancelledError):
            self._release(now)  # not where another run has the robot: it may hold goals, too
        away = "the robot went away: " if isinstance(error, AwayError) else ""
        after = f"; before that: {before}" if before else ""
        words: dict[type, str] = {
            AwayError: OFFLINE,
            CancelledError: FAILED,
            BusyError: WAITING if now.patient else BUSY,
        }
        word = words.get(type(error), FAILED if now.applied else BUSY)
        return self._result(now, word, self._left(now, f"{away}{error}{after}"))

    def _failed(self, now: _Now, error: FleetError) -> StepResult:
        """Take back what was applied; what was not applied leaves nothing but held goals."""
        self.say(f"{now.step.name}: {error}")
        if not now.applied:
            self._release(now)
            return self._result(now, FAILED, f"nothing was touched: {error}")
        try:
            self.host.there()  # a robot that is away proves nothing, and cannot be helped from here
            with self._phase(now, "wait"):
                self._hold_new(now)
            with self._phase(now, "rollback"):
                self._back(now)
        except (AwayError, BusyError, LostError) as other:
            return self._broken_off(now, other, str(error))
        except FleetError as worse:
            self.say(f"{now.step.name}: the way back failed, too: {worse}")
            self._release(now)
            return self._result(now, FAILED, f"{error}; the way back failed, too: {worse}; {UNPROVEN}")
        self._release(now)
        return self._result(now, ROLLED_BACK, str(error))

    def _hold_new(self, now: _Now) -> None:
        """A version that goes may be at work, however bad it is. One that is dead is not, nor one that nobody finds."""
        if self._policy(now) == "force" or now.step.kind == "master":
            return
        try:
            graph, pods = self.host.graph(self.master), self._read().pods
        except RosError:
            return
        rest = decide.new_actions(now.step, graph, pods)
        if rest:
            seen = self._rest(now, rest, f"{now.step.name} waits until its new version is idle, to take it back")
            if seen.verdict == WAIT:
                raise BusyError(f"the new version is at work, so it was not taken back: {seen.reason}")

    def _back(self, now: _Now) -> None:
        """The old version again, and its part of the graph."""
        step, old = now.step, sorted({*now.step.old_nodes.values()} - {""})
        self.say(f"{step.name}: taken back")
        if self.recorded and old:
            # first, so that a service never points to nothing: the old server lives, and the new one's end cannot take
            # away what is not its own any more
            self.host.register(self.master, now.graph, old)
        # marked, too: until it is proven again the contract of this step's beginning counts, whoever goes on from here
        self._apply_all(decide.marked(step.previous.values(), str(int(now.started))))
        self.cluster.delete(step.created)
        self.cluster.wait(list(step.previous.values()), self.settings.ready_timeout)
        dead = sorted({*step.new_nodes.values()} - {"", *old})
        if dead:
            self.host.reap(self.master, dead)
        if now.gate:
            proof = decide.proof_of_old(step, now.gate.contracts, self.settings.rate_tolerance)
            self._ready(proof, self.settings.ready_timeout, f"{step.name} is as it was")
        self._apply_all(list(step.previous.values()))

    # --- what the phases share --------------------------------------------------------------------------------------

    @contextlib.contextmanager
    def _phase(self, now: _Now, name: str) -> Iterator[None]:
        began = self.clock.now()
        self.trace(f"{now.step.name}: {name}")
        try:
            yield
        finally:
            seconds = now.phases.get(name, 0.0) + self.clock.now() - began
            now.phases[name] = round(seconds, 3)

    def _until(self, wait: Callable[[float], Seen], timeout: float, what: str, least: float = SLICE) -> Seen:
        """Wait in slices, and say between two of them what is still open."""
        began = self.clock.now()
        while True:
            spent = self.clock.now() - began
            self.cluster.confirm()
            seen = wait(max(min(timeout - spent, max(least, SLICE)), 0.0))
            spent = self.clock.now() - began
            if seen.verdict != WAIT or spent >= timeout:
                return seen
            self.say(f"{what}, for {spent:.0f} s now: {seen.reason}")

    def _ready(self, conditions: Object, timeout: float, what: str, stable: float = 0.0) -> None:
        seen = self._until(
            lambda seconds: self.host.ready(self.master, conditions, max(seconds, stable), stable),
            timeout,
            f"waits until {what}",
            least=stable + 2.0,
        )
        if seen.verdict != PASS:
            raise NotReadyError(seen.reason)

    def _release(self, now: _Now) -> None:
        """Let the goals go that are still held. If nobody can, the keeper does it by itself."""
        if now.held:
            held, now.held = now.held, ()
            with contextlib.suppress(FleetError):
                self.host.release(self.master, self.keeper, held)

    def _apply_all(self, objects: Sequence[Object]) -> None:
        if objects:
            told = [change for change in self.cluster.apply(objects, self.settings.check) if _worth_telling(change)]
            self.changes += told

    def _events(self, now: _Now | None, ended: Sequence[StepResult] = ()) -> Object:
        running = self._result(now, "") if now else None
        back = ways_back(self.live.deployments)
        return events_map([*self.results, *ended], self.robot.name, self.live.maps, running, back)

    def _tell(self) -> None:
        """The record of the robot's updates: also that a run before this one ended without a word."""
        there = [item.get("data") for item in self.live.maps if item["metadata"]["name"] == EVENTS_NAME]
        record = self._events(None)
        if self.settings.check or not (self.results or there) or record["data"] in there:
            return
        last = self.results[-1] if self.results else None
        if last and (last.outcome == WAITING or (last.outcome == UPDATED and not last.reason)):
            return  # told before it waited, or when its mark was taken off
        try:
            self._apply_all([record])
        except FleetError as error:
            self.say(f"the robot's metrics will not show this: {error}")

    def _result(self, now: _Now, outcome: str, reason: str = "") -> StepResult:
        step = now.step
        found = StepResult(
            step_id(self.robot.name, step.apps, now.started),
            step.name, step.apps, step.handoff, step.before, step.after, now.started, dict(now.phases),
        )  # fmt: skip
        return replace(found, outcome=outcome, reason=reason)

    @staticmethod
    def _left(now: _Now, why: str) -> str:
        left = UNFINISHED if now.step.kind == INSTALL else UNPROVEN
        return f"{why}; {left if now.applied else 'nothing was touched'}"


def _worth_telling(change: Applied) -> bool:
    """The record of updates changes with every step: its news is the outcome itself."""
    return change.changed and change.ref.name != EVENTS_NAME
