# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""A new version of what is at work on a robot: of an app, of the apps of a group, or of the master."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from ...module_utils._common.errors import FleetError, NotReadyError, RosError
from ...module_utils._common.poll import FAIL, PASS, WAIT
from ...module_utils._step.record import Record, mark_of
from ...module_utils._step.update_record import run_of
from ...module_utils._step.words import SOAKING
from .._model import names
from .._model.outcomes import UPDATED
from .._objects.pod_settings import promised
from . import step as decide
from .beside import beside, early, took_over
from .change import NOTHING, StaysError, StepChange, Turn
from .hands import MASTER_SECONDS
from .manifests import Bounds, found_good, fulfilled, marked, step_objects
from .outcome import WAITING, StepResult
from .plan import Step
from .rest import BusyError, Rest
from .revisions import identity, key_of
from .world import Calm, CancelledError, LostError, Object, Seen

NO_WAY_BACK = "no version of it was ever proven, so it stays as it is; another version takes its place"
WITHDRAWN = "the new version, which had not begun, was taken back"
UNKNOWN = "nobody can tell whether its new version is at work"
VERIFY_EXTRA = 20.0
AT_REST_SECONDS = 2.0  # in which a robot shows that it is at rest now and then
LONG_WAIT = 5.0  # seconds in which the graph may have become another one
BESIDE_SECONDS = 10.0  # that a new version waits beside the old one for a robot that went to work again


class AppChange(StepChange):
    """`found` is what the graph, as it was known last before the change, says of the step."""

    found: decide.Gate

    def __init__(self, step: Step, turn: Turn) -> None:
        super().__init__(step, turn)
        self.policy = step.on_busy or self.settings.on_busy
        patience = self.settings.busy_timeout if self.policy == "wait" and not self.check else 0.0
        self.rest = Rest(self.hands, patience, self.settings.since.get(step.name))
        self.rests = [self.rest]
        self.maps: Sequence[Object] = ()  # the contracts and the way back, as they were applied
        self.beside = False  # what is applied only waits beside the old version
        self.withdrawn = False  # it did so, and was taken back

    def _proceed(self) -> None:
        """Of a version that an earlier run has proven its mark alone is left to be taken off."""
        if not self.step.proven:
            super()._proceed()
        elif self.check:
            self.hands.apply_all(self._found_good())

    @property
    def untouched(self) -> str:
        return WITHDRAWN if self.withdrawn else NOTHING

    # --- before -----------------------------------------------------------------------------------------------------

    def gate(self) -> None:
        if self.learned.recorded and self.learned.stale:  # what came, and what the steps before changed, is in it then
            self._learn()
        known = self.learned.recorded or self.step.kind == "master" or self.policy == "force"
        if not (known or self.check):  # in check mode the master is not mended yet
            self._record_late()
        self._look()
        for warning in self.found.warnings:
            self.say(f"WARNING: {self.name}: {warning}")
        if self.found.problems:
            raise NotReadyError("; ".join(self.found.problems))

    def _record_late(self) -> None:
        """Only a master is changed while nobody knows the graph: it may be what is broken. It serves by now."""
        nodes = sorted({node for step in self.later for node in step.old_nodes.values()} - {""})
        # the keeper gives the master what was registered; a node that does not come is recorded as it is
        self.hands.until(
            lambda seconds: self.host.ready(self.master, {"nodes": nodes}, seconds),
            MASTER_SECONDS,
            f"{self.name} waits until {', '.join(nodes)} is registered again",
        )
        self._learn()

    def _learn(self) -> None:
        try:
            self.learned = self.learned.anew(self.hands.graph(self.name))
        except (RosError, NotReadyError) as error:
            raise NotReadyError(f"the graph is not known: {error}") from error

    def _look(self) -> None:
        images = self.settings.edge_images
        self.found = decide.step_gate(self.step, self.learned.graph, self.hands.live, images)

    def start(self) -> None:
        """It takes a second moment of rest. A robot that hardly has one is not asked for two."""
        waits = self.learned.recorded and not self.check
        chosen = early(self.step, self.found.calm, bool(self.hands.keeper)) if waits else []
        unrated = bool({*self.found.nodes} - self.learned.rated)
        # rates are those of rest only while no goal can come
        if not (chosen and self._rests_now(hold=unrated)):
            return
        with self.phase("record"):  # its pod is held to what was recorded when it started
            self.record()
        self.rest.let_go()
        with self.phase("start"):
            objects = self._marked()
            self.beside = True
            self.write(beside(objects, chosen))
            self.cluster.begin(chosen, self.settings.ready_timeout)

    def _needs_rest(self) -> bool:
        return bool(self.found.calm) and self.policy != "force"

    def _rests_now(self, hold: bool) -> bool:
        if not self._needs_rest():
            return True
        if self.name in self.settings.since:  # it was waited for already
            return False
        with self.phase("wait"):
            return self._idle(self.found.calm, "the robot is idle", hold, AT_REST_SECONDS).verdict == PASS

    def _idle(self, calm: Calm, what: str, hold: bool = True, seconds: float | None = None) -> Seen:
        """Until the robot is calm and new goals held, for as long as the policy says, or so many seconds."""
        return self.rest.idle(calm, f"{self.name} waits until {what}", self.settings.look_timeout, hold, seconds)

    def hold(self) -> None:
        """A robot that went to work again is waited for without a pod beside it."""
        try:
            self._hold()
        except BusyError as error:
            if not self.beside:
                raise
            self.say(f"{self.name}: {error}")
            self._take_back()
            self.begun, self.written, self.beside, self.withdrawn = False, False, False, True
            self._hold()

    def _hold(self) -> None:
        calm, policy = self.found.calm, self.policy
        if not self._needs_rest():
            return
        if policy == "wait" and not self.check and not self.beside:
            # a wait may be long, and whoever looks at the robot meanwhile wants to know of it
            self.hands.apply_all([self.events(self.result(WAITING), ())])
        silent = decide.unanswered(calm, self.learned.graph)
        publishers = {topic: app.name for topic, app, _said in promised(self.hands.robot)} if silent else {}
        for topic in silent:
            if topic in publishers:  # it may be down, and come up with this very run
                self.say(
                    f"{self.name}: {topic} is app {publishers[topic]}'s, which publishes nothing; {decide.UNASKED}"
                )
        # a pod that waits beside the old one takes place, and the robot was at rest a moment ago
        seen = self._idle(calm, "the robot is idle", seconds=BESIDE_SECONDS if self.beside else None)
        if self.check:
            self.say(f"{self.name}: {'idle now' if seen.verdict == PASS else f'busy now: {seen.reason}'}")
        # in check mode nobody has waited: what would be waited for is no reason to leave out the rest of the plan
        if seen.verdict == WAIT and not (self.check and policy == "wait"):
            raise BusyError(f"{seen.reason}; {decide.UNASKED}" if silent else seen.reason)
        if seen.verdict == FAIL:
            raise NotReadyError(f"it cannot be seen whether the robot is idle: {seen.reason}")
        if seen.verdict == PASS and seen.reason:  # a goal that comes now may be lost
            self.say(f"{self.name}: {seen.reason}")

    def record(self) -> None:
        """What the nodes send when the robot rests is what the next version has to send, too.

        Steps that wait for nobody have theirs measured together. One that is forced may find the robot at work.
        """
        known, found = self.learned, self.found
        missing, busy = {*found.nodes} - known.rated, decide.at_work(known.graph, found.calm.actions)
        forced = busy and self.policy == "force"
        # what came while it waited is in the graph, too; but a version that starts beside the old one is none of it
        waited = (busy or self._phases.get("wait", 0.0) > LONG_WAIT) and not (self.beside or self.check)
        if (missing or waited) and known.recorded and not forced:
            if not found.calm:
                later = [decide.step_gate(step, known.graph, self.hands.live) for step in self.later]
                missing |= {node for other in later if not other.calm for node in other.nodes} - known.rated
            seconds = self.settings.rate_seconds if missing else 0.0
            measured = self.host.graph(self.master, seconds, sorted(missing))
            self.learned = replace(known.anew(measured), stale=known.stale, rated=known.rated | missing)
            self._look()
            if waited and self.found.calm.actions != found.calm.actions:  # what was unknown is known by now
                self._hold()
        for line in self.found.allowed if self.check else ():
            self.say(f"{self.name}: {line}")

    # --- the change -------------------------------------------------------------------------------------------------

    def apply(self) -> None:
        if self.check:
            self.hands.apply_all(self.step.objects)
            return
        objects = self._marked()
        self.beside = False
        self.write(objects)

    def _marked(self) -> Sequence[Object]:
        """The step's objects with the contracts, the way back, and the mark of what is not proven."""
        bounds = Bounds(self.settings.rate_tolerance, self.settings.ready_timeout)
        objects = step_objects(self.step, self.found.contracts, bounds, self.told.started)
        self.maps = [item for item in objects if item["kind"] == "ConfigMap"]
        return objects

    def roll_out(self) -> None:
        self.cluster.stay(self.step.workloads, self.settings.ready_timeout)

    def verify(self) -> None:
        """The graph is what was recorded, for as long as asked, and no container ended meanwhile."""
        if self.step.kind == "master":
            self.hands.master_answers("the new master answers")
            if self.learned.recorded:
                self.host.register(self.master, self.learned.graph)
        proof = decide.proof(self.step, self.found, self.settings.rate_tolerance)
        if decide.proves_nothing(proof):
            self.say(f"{self.name}: nothing is recorded and nothing promised to hold it to: only its pod is proven")
        self.stays(proof, max(VERIFY_EXTRA, self.step.patience), f"{self.name} is what was recorded")

    def finish(self) -> StepResult:
        """Say that the contract is fulfilled, then take the mark off. Where that cannot be done it is proven anyway."""
        self.trace(f"{self.name}: finish")
        result = self.result(UPDATED)
        try:
            self.hands.apply_all([*self._found_good(), self.events(None, [result])])
            # the new server may have been there before, and then the keeper waits for a next one
            if self.step.resume or self.step.drifted:
                self.release()
        except LostError:  # whoever had the robot meanwhile may have changed what was proven
            raise
        except FleetError as error:
            self.over = isinstance(error, CancelledError)
            reason = f"its mark could not be taken off ({error}); the next run does that"
            self.say(f"{self.name}: {reason}")
            result = replace(result, reason=reason)
        return result

    def _found_good(self) -> list[Object]:
        """That it is proven. Where a keeper can take it back that is the keeper's to say, after a while."""
        step, soak = self.step, self.settings.soak
        apps = {*step.apps} - {names.KEEPER_NAME}
        revisions = {app: step.after.get(app, {}).get("revision", "") for app in apps}
        again = all(Record(history=step.histories.get(app, ())).is_history(new) for app, new in revisions.items())
        if step.proven or again or not (self.hands.keeper and soak and apps & {*step.previous}):
            return [*fulfilled(self.maps), *step.workloads]
        good = found_good(self.maps, soak, decide.new_pods(step, self.hands.read().pods))
        return [*good, *marked(step.workloads, run_of(self.told.started), SOAKING)]

    # --- or back ----------------------------------------------------------------------------------------------------

    def back(self) -> None:
        if not (self.step.previous or self.step.created):  # what another run made may work tomorrow
            raise StaysError(NO_WAY_BACK)
        self.host.there()  # a robot that is away proves nothing, and cannot be helped from here
        self._take_back()

    def _take_back(self) -> None:
        with self.phase("wait"):
            self._hold_new()
        with self.phase("rollback"):
            self._go_back()

    def _hold_new(self) -> None:
        """A version that goes may be at work, however bad it is. One that is dead is not, nor one that nobody finds."""
        if self.policy == "force" or self.step.kind == "master":
            return
        pods = self.hands.read().pods
        if decide.is_dead(self.step, pods) or (self.beside and not took_over(self.step, pods)):
            return
        self.beside = False  # it works
        try:
            actions = decide.new_actions(self.step, self.hands.graph(self.name), pods)
        except (RosError, NotReadyError) as error:
            raise NotReadyError(f"{UNKNOWN}: {error}") from error
        if actions:
            seen = self._idle(Calm(actions), "its new version is idle, to take it back")
            # one that crashes tells nothing
            if seen.verdict == WAIT and not decide.is_dead(self.step, self.hands.read().pods):
                raise BusyError(f"the new version is at work, so it was not taken back: {seen.reason}")
            if seen.verdict == FAIL:
                raise NotReadyError(f"{UNKNOWN}: {seen.reason}")

    def _go_back(self) -> None:
        """The old version again, and its part of the graph."""
        step, timeout, follows = self.step, self.settings.ready_timeout, self.found.succession.nodes
        old, previous = sorted({*step.old_nodes.values(), *follows} - {""}), [*step.previous.values()]
        self.say(f"{self.name}: taken back")
        if self.learned.recorded and old:
            # first, so that a service never points to nothing: the old server lives, and the new one's end cannot take
            # away what is not its own any more
            try:
                self.host.register(self.master, self.learned.graph, old)
            except RosError as error:  # without the old version there is nothing to register
                self.say(f"{self.name}: its old nodes are not registered again yet: {error}")
        # marked, too: until it is proven again the contract of this step's beginning counts, whoever goes on from here;
        # and never without the contract, which a refused apply may have left unwritten
        self.hands.apply_all([*self.maps, *marked(previous, run_of(self.told.started))])
        self.cluster.delete(self._made())
        self.cluster.wait(previous, timeout)
        dead = sorted({*step.new_nodes.values(), *follows.values()} - {"", *old})
        if dead:
            self.host.reap(self.master, dead)
        proof = decide.proof_of_old(step, self.found, self.settings.rate_tolerance)
        self.hands.ready(proof, timeout, f"{self.name} is as it was")
        self.hands.apply_all(previous)

    def _made(self) -> list[Object]:
        """The Deployments that this very step has made: they were not there before it, and are there with its mark."""
        if not self.step.created:
            return []
        there, run = {key_of(item): item for item in self.hands.read().deployments}, run_of(self.told.started)
        made = [there[key_of(item)] for item in self.step.created if key_of(item) in there]
        return [
            {**identity(item), "metadata": {**identity(item)["metadata"], "uid": item["metadata"].get("uid")}}
            for item in made
            if (mark := mark_of(item)) is not None and mark.run == run
        ]
