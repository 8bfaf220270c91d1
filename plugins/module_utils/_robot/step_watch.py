# SPDX-License-Identifier: GPL-3.0-or-later
"""The keeper beside steps of updates: it takes back what `way_back` says, as the run would have that is gone, and what
does not stay good in its `soak`.

A look costs one request, for the Leases of all robots. Only where one has changed, and nobody has it, the Deployments
are looked at, and what the run left open in the record of updates is closed.
"""

from __future__ import annotations

import contextlib
import time
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, Callable, Collection, Iterable, Mapping

from .._common.errors import FleetError, RosError
from .._ros.backend import Backend
from .._step import update_record
from .._step.objects import Object, name_of, node_of, rolled_out, version_of
from .._step.record import mark_of, record_name, record_of, soaks
from .._step.words import FLEET, SOAKING, UPDATING
from .cluster_api import ApiError, Claim, Cluster, LostError, read_records
from .memory import KeptFiles, Silence
from .open_goals import open_goals
from .soak import Soaking, soaked
from .watchdog import Hung, Watchdog
from .way_back import Observed, Step, member_of, restored, steps_of

LOOK = 10.0  # seconds between two looks
HOLD = 300.0  # for the old server to come back: goals are held so long
CLUSTER = "the cluster"
AGAIN = 0.5  # between "idle" and "idle still"
UNREADABLE = 2.0  # times the time to get ready: after that, goals of a node that cannot be read keep nobody waiting
STEPS = "steps"  # of the kept files: namespace -> steps that were seen rolled out


@dataclass(frozen=True)
class Robot:
    """What the keeper does for the robot's graph meanwhile: its own calls."""

    hold: Callable[[str, str, float], list[Any]]  # action, server, seconds
    release: Callable[[str], list[Any]]
    take_back: Callable[[Iterable[str]], None]  # services, by these nodes where they live
    silence: Callable[[], Silence]  # which nodes do not answer
    watch_hold: Callable[[str, Object | None], object]  # of somebody else's update, by a namespace and its Lease


@dataclass(frozen=True)
class Due:
    """A step that is to go back, by which mark it is known, and why.

    `patient`: one that came up once is not bad for goals that cannot be read.
    """

    step: Step
    key: str
    reason: str
    patient: bool = True


@dataclass(eq=False)
class StepWatch:
    """Looks at all namespaces, and longer where something is due."""

    cluster: Cluster
    ros: Backend
    robot: Robot
    kept: KeptFiles
    log: Callable[[str], None]
    now: Callable[[], float] = time.monotonic
    sleep: Callable[[float], None] = time.sleep

    def __post_init__(self) -> None:
        self.watchdog = Watchdog(self.cluster, self.ros, self.robot.silence, self.now)
        self.came_up: Mapping[str, list[str]] = self.kept.load(STEPS) or {}
        self.observed: dict[str, Observed] = {}
        self.soaking: dict[str, dict[str, Soaking]] = {}
        self.said: dict[str, str] = {}

    def run(self) -> None:
        while True:
            try:
                self.look()
            except Exception as error:  # whatever one look brings, the next one may be better
                self.log(f"error: {type(error).__name__}: {error}")
            self.sleep(LOOK)

    def look(self) -> None:
        """At all namespaces. An API that is away is looked for again later."""
        try:
            leases = self.cluster.leases()
            self._tell(CLUSTER, "")
        except FleetError as error:
            self._away(CLUSTER, error)
            return
        began = self.now()
        known = {name: self.observed.get(name) or Observed(frozenset(self.came_up.get(name, ()))) for name in leases}
        self.observed = known
        for namespace, seen in known.items():
            seen.lease(leases[namespace], began)
        for namespace, seen in known.items():
            try:
                self.robot.watch_hold(namespace, leases[namespace])
                self._look(namespace, seen)
                self._tell(namespace, "")
            except FleetError as error:
                if not (isinstance(error, ApiError) and error.status):
                    self._away(namespace, error)
                    break
                # what answers with a refusal is not away: a robot that may not be read keeps nobody from the others
                seen.away()
                self._tell(namespace, str(error))
            except Exception as error:  # as what somebody has written into a robot's records
                self._tell(namespace, f"{type(error).__name__}: {error}")

    def _away(self, where: str, error: FleetError) -> None:
        for seen in self.observed.values():
            seen.away()
        self._tell(where, str(error))

    def rests(self) -> bool:
        """Whether, as far as was seen, nobody takes a step, and none has been left."""
        return bool(self.observed) and all(seen.free and seen.nothing is not None for seen in self.observed.values())

    def left_over(self, namespace: str, lease: Object | None) -> bool:
        """Whether whoever has this Lease has gone: as far as was seen, it was left for its whole time."""
        seen = self.observed.get(namespace)
        return seen is not None and seen.over and seen.version == version_of(lease)

    def _tell(self, about: str, text: str) -> None:
        """What is so now; once, and not again before it changes."""
        if text != self.said.get(about, ""):
            self.log(f"{about}: {text or 'the Kubernetes API answers'}")
            self.said[about] = text

    # ---- the look

    def _look(self, namespace: str, seen: Observed) -> None:
        """What is the whole fleet's has a Lease of its own, too."""
        if not seen.free:
            self.soaking.pop(namespace, None)  # what is to come may be another version
            return
        if seen.version != seen.nothing:
            self._steps_left(namespace, seen)
        self._wake(namespace, seen)

    def _steps_left(self, namespace: str, seen: Observed) -> None:
        there = self.cluster.deployments(namespace)
        steps = self._steps(namespace, there)
        due = seen.due(steps[UPDATING])
        # what was rolled out once is not failing because its robot starts anew, and the keeper with it
        came_up = {space: sorted(one.came_up) for space, one in self.observed.items()}
        self.kept.save(STEPS, {space: keys for space, keys in came_up.items() if keys})
        for step in due:
            patient = seen.up(step) or seen.waited[step.key] < UNREADABLE * step.ready_timeout
            reason = f"{seen.why(step)} after the run that began it had gone"
            self._due(namespace, seen, Due(step, UPDATING, reason, patient))
        soaking = soaked(self.soaking.get(namespace, {}), steps[SOAKING], seen.passed, self.ros)
        self.soaking[namespace] = soaking
        for one in soaking.values():
            if one.why:
                reason = f"{one.why}, within {one.step.soak:.0f} s of the update"
                self._due(namespace, seen, Due(one.step, SOAKING, reason))
        good = {key: one.step.name for key, one in soaking.items() if one.good}
        if good:
            about = f"{namespace}/{next(iter(good.values()))}"
            self._with_lease(namespace, seen, about, "is not proven yet: {}", partial(self._prove, good))
        recorded = self._record(namespace, there)
        seen.nothing = seen.version if recorded and not any(steps.values()) else None

    def _steps(self, namespace: str, there: list[Object]) -> dict[str, list[Step]]:
        """Mark -> the steps that it stands for: those that are not over, and those that soak."""
        marked = {key: [item for item in there if mark_of(item, key) is not None] for key in (UPDATING, SOAKING)}
        records = read_records(self.cluster, namespace, [name_of(one) for found in marked.values() for one in found])
        marked[SOAKING] = [item for item in marked[SOAKING] if soaks(item, records)]
        needed = marked[SOAKING] or not all(map(rolled_out, marked[UPDATING]))
        pods = self.cluster.pods(namespace) if needed else []
        return {key: steps_of([member_of(one, records, pods) for one in of], there) for key, of in marked.items()}

    def _prove(self, good: Collection[str], claim: Claim) -> None:
        """They were good for long enough. The record says so first; only then the mark comes off."""
        for step in self._steps(claim.namespace, self.cluster.deployments(claim.namespace))[SOAKING]:
            if step.key not in good:
                continue
            claim.renew()
            for member in step.members:
                found = self.cluster.config_map(claim.namespace, record_name(member.name))
                if found and record_of(found) == member.record:
                    self.cluster.apply(claim.namespace, update_record.anew(found, member.record.fulfilled().data()))
            for member in step.members:
                self.cluster.unmark(claim.namespace, member.deployment, SOAKING)
            self.log(f"{claim.namespace}: {step.name} was good for {step.soak:.0f} s: proven")

    def _record(self, namespace: str, there: list[Object]) -> bool:
        """Say in the robot's record of updates what became of its steps; False: it is to be tried again."""
        found = self.cluster.config_map(namespace, update_record.NAME)
        shared = self.cluster.deployments(FLEET) if found and namespace != self.cluster.home == FLEET else []
        body = update_record.ended(found, [*there, *shared]) if found else None
        try:
            if body:
                self.cluster.apply(namespace, body)
        except ApiError as error:
            if error.status in (0, 409):  # somebody wrote it just now
                return False
            self._tell(f"{namespace}/{update_record.NAME}", str(error))
        return True

    def _wake(self, namespace: str, seen: Observed) -> None:
        """Begin a pod anew whose node hangs, one at a look; meanwhile nobody else may begin a step."""
        for one in self.watchdog.hung(namespace):
            about, waiting = f"{namespace}/{one.app}", self.watchdog.waits(namespace, one)
            if waiting:
                self._tell(about, waiting)
                continue
            self._with_lease(namespace, seen, about, one.left("{}"), partial(self._begin_anew, one))
            return

    def _begin_anew(self, one: Hung, claim: Claim) -> None:
        self._tell(f"{claim.namespace}/{one.app}", self.watchdog.begin_anew(claim.namespace, one))

    def _with_lease(self, namespace: str, seen: Observed, about: str, lost: str, work: Callable[[Claim], None]) -> None:
        """Do it with the Lease, unless somebody else has that by now. `lost` is said where another one takes it."""
        found = self.cluster.lease(namespace)
        if version_of(found) != seen.version:
            return
        claim = Claim(self.cluster, namespace, found)
        try:
            claim.renew()  # from here on nobody else changes the robot
            work(claim)
        except LostError as error:
            self._tell(about, lost.format(error))
        finally:
            claim.write()

    # ---- the way back

    def _due(self, namespace: str, seen: Observed, due: Due) -> None:
        step = due.step
        about = f"{namespace}/{step.name}"
        waiting = open_goals(self.ros, step).waiting(due.patient)
        if waiting:
            self._tell(about, f"is taken back when it rests: {waiting}")
            return
        # goals that are held when somebody takes the Lease may be held for that one
        self._with_lease(namespace, seen, about, "is not taken back any further: {}", partial(self._still_due, due))

    def _still_due(self, due: Due, claim: Claim) -> None:
        """What was due may be over by now."""
        seen = self.observed[claim.namespace]
        for again in self._steps(claim.namespace, self.cluster.deployments(claim.namespace))[due.key]:
            if again.key == due.step.key and (due.key == SOAKING or again.failing(seen.up(again))):
                self._go_back(claim, replace(due, step=again))

    def _go_back(self, claim: Claim, due: Due) -> None:
        """Goals that come now are for the old server. Where it does not go back after all they are let go, unless
        another one has the robot, who may hold them, too.
        """
        with contextlib.ExitStack() as held:
            try:
                self._restore(claim, due, held)
            except LostError:
                held.pop_all()
                raise

    def _restore(self, claim: Claim, due: Due, held: contextlib.ExitStack) -> None:
        """The Lease is renewed before all that may take its time, and before all that is written."""
        step = due.step
        for action, server in open_goals(self.ros, step).servers.items():
            claim.renew()
            if self.robot.hold(action, server, HOLD)[0]:
                held.callback(self.robot.release, action)
        self.sleep(AGAIN)
        claim.renew()
        if open_goals(self.ros, step).waiting(due.patient):
            return
        claim.renew()
        new = {node_of(member.deployment) for member in step.going_back}
        old = {node for member in step.going_back for node in member.nodes_before}
        try:  # first, so that a service never points to nothing while its old server lives
            self.robot.take_back(old - new - {""})
        except RosError as error:
            self.log(f"{step.name}: services were not given back: {error}")
        for member in step.going_back:
            claim.renew()
            self.cluster.apply(claim.namespace, restored(member, due.reason, self.cluster.stamp()))
            held.pop_all()
            self.log(f"{claim.namespace}: {member.name} was taken back: {due.reason}")
        if claim.namespace == FLEET:  # the records are those of the robots that took the step
            for other in self.observed.values():
                other.nothing = None
