# SPDX-License-Identifier: GPL-3.0-or-later
"""Changes of what runs on a robot, each a step of its plan: a new version, the first installation, a removal."""

from __future__ import annotations

import contextlib
from collections.abc import Sequence
from dataclasses import replace

from ...module_utils._common import poll
from ...module_utils._common.errors import FleetError, NotReadyError, RosError
from ...module_utils._common.poll import FAIL, PASS, WAIT
from ...module_utils._step.objects import address_of, app_of
from ...module_utils._step.record import Record, mark_of
from ...module_utils._step.rest import own_nodes
from ...module_utils._step.update_record import run_of
from ...module_utils._step.words import SOAKING
from .._model import names
from .._model.outcomes import UPDATED
from .._objects.namespace import storage_objects
from . import step as decide
from .addresses import SERVING
from .change import StaysError, StepChange
from .hands import MASTER_SECONDS, PROMISED, BusyError, Hands, Rest
from .manifests import beside, early, found_good, fulfilled, marked
from .outcome import WAITING, StepResult
from .plan import Step, promised
from .revisions import identity, key_of
from .world import Calm, CancelledError, LostError, Object, Seen

NO_WAY_BACK = (
    "no version of it was ever proven, so it stays as it is: give ros_apps a version that works, or take it away "
    "(update_remove_apps)"
)
WITHDRAWN = "the new version, which had not begun, was taken back"
UNKNOWN = "nobody can tell whether its new version is at work"
UNFINISHED = "what came up stays as it is; the next run goes on from there"
UNTOLD = "on a quiet machine it can be told, or say in update.rates what it has to send (0: anything)"
LEAVING = "it is there still, or ending; the next run goes on from there"
VERIFY_EXTRA = 20.0
AT_REST_SECONDS = 2.0  # in which a robot shows that it is at rest now and then
LONG_WAIT = 5.0  # seconds in which the graph may have become another one
BESIDE_SECONDS = 10.0  # that a new version waits beside the old one for a robot that went to work again
LAST_SECONDS = 2.0  # of the last look at what has had its time
END_SECONDS = 0.5  # between two looks whether a pod has ended


class AppChange(StepChange):
    """A new version of what is at work: of an app, of the apps of a group, or of the master.

    `found` is what the graph, as it was known last before the change, says of the step.
    """

    found: decide.Gate

    def __init__(self, steps: Sequence[Step], hands: Hands) -> None:
        super().__init__(steps, hands)
        self.policy = self.step.on_busy or self.settings.on_busy
        self.rest = Rest(hands, self.policy, self.settings.since.get(self.name))
        self.rests = [self.rest]
        self.beside = False  # what is applied only waits beside the old version

    def proceed(self) -> None:
        """Of a version that an earlier run has proven its mark alone is left to be taken off."""
        if not self.step.proven:
            super().proceed()
        elif self.check:
            self.hands.apply_all(self._found_good())

    # --- before -----------------------------------------------------------------------------------------------------

    def gate(self) -> None:
        hands, master = self.hands, self.step.kind == "master"
        unknown = not (hands.recorded or master or self.policy == "force" or self.check)
        if unknown:
            # Only a master is changed while nobody knows the graph: it may be what is broken. It serves by now, and the
            # keeper gives it what was registered; a node that does not come is recorded as it is.
            nodes = sorted({node for step in self.later for node in step.old_nodes.values()} - {""})
            hands.until(
                lambda seconds: self.host.ready(hands.master, {"nodes": nodes}, seconds),
                MASTER_SECONDS,
                f"{self.name} waits until {', '.join(nodes)} is registered again",
            )
        if unknown or (hands.recorded and hands.stale):  # what came, and what the steps before changed, is in it then
            hands.learn(hands.ask(self.name, "the graph is not known"))
        self._look()
        for warning in self.found.warnings:
            self.say(f"WARNING: {self.name}: {warning}")
        if self.found.problems:
            raise NotReadyError("; ".join(self.found.problems))
        if hands.recorded and not self.check:
            self._start()

    def _look(self) -> None:
        self.found = decide.step_gate(self.step, self.hands.graph, self.hands.live, self.settings.edge_images)

    def _start(self) -> None:
        """It takes a second moment of rest. A robot that hardly has one is not asked for two."""
        calm = self.found.calm
        chosen = early(self.step, calm, bool(self.hands.keeper))
        if chosen and self.rest.needed(calm):
            if self.name in self.settings.since:  # it was waited for already
                return
            self.phase("wait")
            # rates are those of rest only while no goal can come
            unrated = bool({*self.found.nodes} - self.hands.rated)
            what = f"{self.name} waits until the robot is idle"
            if self.rest.idle(calm, what, hold=unrated, seconds=AT_REST_SECONDS).verdict != PASS:
                return
        if chosen:
            self.phase("record")  # its pod is held to what was recorded when it started
            self.record()
            self.phase("start")
            self.rest.let_go()
            objects, self.beside = self.marked(self.found.contracts), True
            self.write(beside(objects, chosen))
            self.cluster.wait(chosen, self.settings.ready_timeout, begun=True)

    def hold(self) -> None:
        """A robot that went to work again is waited for without a pod beside it."""
        try:
            self._hold()
        except BusyError as error:
            if not self.beside:
                raise
            self.say(f"{self.name}: {error}")
            self._take_back()
            self.begun, self.written, self.beside, self.untouched = False, False, False, WITHDRAWN
            self.phase("wait")
            self._hold()

    def _hold(self) -> None:
        calm = self.found.calm
        if not self.rest.needed(calm):
            return
        if self.policy == "wait" and not (self.check or self.beside):
            # a wait may be long, and whoever looks at the robot meanwhile wants to know of it
            self.hands.apply_all([self.hands.events(self.result(WAITING))])
        # a pod that waits beside the old one takes place, and the robot was at rest a moment ago
        seconds = BESIDE_SECONDS if self.beside else None
        self.rest.begin(calm, self.name, seconds=seconds)

    def record(self) -> None:
        """What the nodes send when the robot rests is what the next version has to send, too.

        Steps that wait for nobody have theirs measured together. One that is forced may find the robot at work.
        """
        known, found = self.hands, self.found
        missing = ({*found.nodes} - known.rated) | {*found.untold}
        busy = decide.at_work(known.graph, found.calm.actions)
        forced = busy and self.policy == "force"
        # what came while it waited is in the graph, too; but a version that starts beside the old one is none of it
        waited = (busy or self._phases.get("wait", 0.0) > LONG_WAIT) and not (self.beside or self.check)
        if (missing or waited) and known.recorded and not forced:
            if not found.calm:
                later = [decide.step_gate(step, known.graph, known.live) for step in self.later]
                missing |= {node for other in later if not other.calm for node in other.nodes} - known.rated
            known.learn(self.host.graph(known.master, self.settings.rate_seconds, sorted(missing)))
            known.rated |= missing
            self._look()
            if waited and self.found.calm.actions != found.calm.actions:  # what was unknown is known by now
                self._hold()
            if self.found.untold:  # what is unknown waits
                self.rest.put_off(f"{'; '.join(self.found.untold.values())}; {UNTOLD}")
        for line in self.found.allowed if self.check else ():
            self.say(f"{self.name}: {line}")

    # --- the change -------------------------------------------------------------------------------------------------

    def apply(self) -> None:
        if self.check:
            self.hands.apply_all(self.step.objects)
        else:
            objects, self.beside = self.marked(self.found.contracts), False
            self.write(objects)

    def write(self, objects: Sequence[Object]) -> None:
        """Apply the objects with the record of updates, in which this step is at hand."""
        self.begun = True  # from the first of these objects on
        self.hands.apply_all([self.hands.events(self.result()), *objects])
        self.written = True

    def roll_out(self) -> None:
        self.cluster.wait(self.step.workloads, self.settings.ready_timeout, stay=0.0)

    def verify(self) -> None:
        if self.step.kind == "master":
            self.hands.master_answers("the new master answers")
            if self.hands.recorded:
                self._register_all()
        proof = decide.proof(self.step, self.found, self.settings.rate_tolerance)
        if decide.proves_nothing(proof):
            self.say(f"{self.name}: nothing is recorded and nothing promised to hold it to: only its pod is proven")
        timeout = max(VERIFY_EXTRA, self.step.patience)
        self.hands.stays(proof, timeout, f"{self.name} is what was recorded", self.step.workloads)

    def _register_all(self) -> None:
        """Of two questions the old master's pod may get the second one, as long as the Service knows of both."""
        try:
            self.host.register(self.hands.master, self.hands.registered)
        except RosError as error:
            self.say(f"{self.name}: {error}")
            self.hands.master_answers("the new master answers again")
            self.host.register(self.hands.master, self.hands.registered)

    def finish(self) -> StepResult:
        """Say that the contract is fulfilled, then take the mark off. Where that cannot be done it is proven anyway."""
        self.trace(f"{self.name}: finish")
        result = self.result(UPDATED)
        try:
            self.hands.apply_all([*self._found_good(), self.hands.events(result)])
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
        if step.proven or again or not (self.hands.watched(step.workloads) and soak and apps & {*step.previous}):
            return [*fulfilled(self.maps), *step.workloads]
        good = found_good(self.maps, soak, decide.new_pods(step, self.hands.read().pods))
        return [*good, *marked(step.workloads, self.maps, run_of(self.told.started), SOAKING)]

    # --- or back ----------------------------------------------------------------------------------------------------

    def back(self) -> None:
        if not (self.step.previous or self.step.created):  # what another run made may work tomorrow
            raise StaysError(NO_WAY_BACK)
        self.host.there()  # a robot that is away proves nothing, and cannot be helped from here
        self._take_back()

    def _take_back(self) -> None:
        self.phase("wait")
        self._hold_new()
        self.phase("rollback")
        self._go_back()

    def _hold_new(self) -> None:
        """A version that goes may be at work, however bad it is. One that is dead is not, nor one that nobody finds."""
        if self.policy == "force" or self.step.kind == "master":
            return
        pods = self.hands.read().pods
        # the old one may have ended by itself: then the new version works already
        took_over = any(container.get("ready") for container in decide.new_containers(self.step, pods))
        if decide.is_dead(self.step, pods) or (self.beside and not took_over):
            return
        self.beside = False  # it works
        actions = decide.new_actions(self.step, self.hands.ask(self.name, UNKNOWN), pods)
        if actions:
            what = f"{self.name} waits until its new version is idle, to take it back"
            seen = self.rest.idle(Calm(actions), what)
            # one that crashes tells nothing
            if seen.verdict == WAIT and not decide.is_dead(self.step, self.hands.read().pods):
                raise BusyError(f"the new version is at work, so it was not taken back: {seen.reason}")
            if seen.verdict == FAIL:
                raise NotReadyError(f"{UNKNOWN}: {seen.reason}")

    def _go_back(self) -> None:
        step, hands, timeout = self.step, self.hands, self.settings.ready_timeout
        follows, run = self.found.succession.nodes, run_of(self.told.started)
        old, previous = sorted({*step.old_nodes.values(), *follows} - {""}), [*step.previous.values()]
        self.say(f"{self.name}: taken back")
        if hands.recorded and old:
            # first, so that a service never points to nothing: the old server lives, and the new one's end cannot take
            # away what is not its own any more
            try:
                self.host.register(hands.master, hands.registered, old)
            except RosError as error:  # without the old version there is nothing to register
                self.say(f"{self.name}: its old nodes are not registered again yet: {error}")
        leaving = [*filter(None, map(address_of, decide.new_pods(step, hands.read().pods)))]
        # marked, too: until it is proven again the contract of this step's beginning counts, whoever goes on from here;
        # and never without the contract, which a refused apply may have left unwritten
        hands.apply_all([*self.maps, *marked(previous, self.maps, run)])
        self.cluster.delete(self._made(run))
        self.cluster.wait(previous, timeout)
        dead = sorted({*step.new_nodes.values(), *follows.values()} - {"", *old})
        if dead:
            self.host.reap(hands.master, dead, leaving)
        hands.ready(decide.proof_of_old(step, self.found), timeout, f"{self.name} is as it was")
        hands.apply_all(previous)

    def _made(self, run: str) -> list[Object]:
        """The Deployments that this very step has made: they were not there before it, and are there with its mark."""
        created = {key_of(item) for item in self.step.created}
        there = [item for item in self.hands.read().deployments if key_of(item) in created] if created else []
        return [identity(item) for item in there if (mark := mark_of(item)) is not None and mark.run == run]


class RemovalChange(AppChange):
    """There is no way back but the inventory. A pod that is told to end cannot be told to stay."""

    left = LEAVING

    def record(self) -> None:
        """Nobody has to send as much afterwards."""

    def apply(self) -> None:
        if not self.check:
            self.write(())
        self.hands.delete([identity(item) for item in self.step.previous.values()])

    def roll_out(self) -> None:
        """Until no pod of it is left: each ends within its grace period, which begins now."""
        (deployment,) = self.step.previous.values()
        grace = float(deployment["spec"]["template"]["spec"].get("terminationGracePeriodSeconds") or 0)
        seen = self.hands.until(self._gone, grace + self.settings.ready_timeout, f"waits until {self.name} has ended")
        if seen.verdict != PASS:
            raise NotReadyError(seen.reason)

    def _gone(self, seconds: float) -> Seen:
        whose = self.hands.robot.namespace, self.name

        def look() -> poll.Seen:
            pods = [pod["metadata"] for pod in self.hands.read().pods]
            left = [pod["name"] for pod in pods if (pod["namespace"], pod["labels"][names.LABEL_APP]) == whose]
            return poll.Seen(WAIT if left else PASS, f"still there: {', '.join(left)}")

        ended = poll.poll(look, seconds, END_SECONDS, now=self.clock.now, sleep=self.clock.sleep)
        return Seen(ended.verdict, str(ended.last))

    def verify(self) -> None:
        """Nobody is registered under its nodes' names any more. What a process left that was killed is taken away."""
        own = own_nodes(self.step.old_nodes, self.hands.graph, self.hands.live.pods)
        nodes = [node for found in own.values() for node in found]
        if self.hands.recorded and nodes:
            self.host.reap(self.hands.master, nodes, ())
            self.hands.ready({"absent": nodes}, VERIFY_EXTRA, f"{self.name} has left the graph")

    def finish(self) -> StepResult:
        result = super().finish()
        self.release()  # no next server comes for the goals that are held
        return result

    def back(self) -> None:
        raise StaysError(LEAVING)


class InstallChange(StepChange):
    """All that is new on a robot on which no app is at work, at once: applied, awaited, and the graph is as promised.

    There is nothing to go back to: what does not come up stays, and is told.
    """

    left = UNFINISHED

    def gate(self) -> None:
        if names.MASTER_NAME not in self.step.apps and self.hands.robot.master.mode != "none":
            self.hands.need_master()

    def apply(self) -> None:
        self.begun = not self.check  # from the first of these objects on
        self.hands.apply_all(self.step.objects if self.check else self.marked({}))

    def roll_out(self) -> None:
        claims = storage_objects(self.hands.robot) if set(self.step.apps) - set(SERVING) else []
        self.cluster.wait([*claims, *self.step.workloads], self.settings.rollout_timeout)

    def verify(self) -> None:
        self.hands.as_promised(self.step.conditions, self.step.workloads)

    def finish(self) -> StepResult:
        result = self.result(UPDATED)
        self._prove(self.step.workloads, [self.hands.events(result)])
        return result

    def back(self) -> None:
        """Prove each app that came up all the same, so that it is at work from now on."""
        proven = list[str]()
        try:
            for item in self.step.workloads:
                with contextlib.suppress(NotReadyError):
                    self.cluster.wait([item], LAST_SECONDS)
                    if self.hands.master:
                        self.hands.stays(promised(self.hands.robot, [app_of(item)]), LAST_SECONDS, PROMISED, [item])
                        self._prove([item])
                        proven.append(app_of(item))
        except FleetError as error:
            self.say(f"{self.name}: {error}")
        raise StaysError(f"{UNFINISHED}; up: {', '.join(proven)}" if proven else UNFINISHED)

    def _prove(self, workloads: Sequence[Object], more: Sequence[Object] = ()) -> None:
        """Say that they are proven, then take their marks off: whatever brings a mark back is no word against them."""
        apps = [app_of(item) for item in workloads]
        said = fulfilled(item for item in self.maps if app_of(item) in apps)
        self.hands.apply_all([*said, *workloads, *more])
