# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""One step of a robot at work: gate, hold, apply, verify, and back where the new version does not prove itself."""

from __future__ import annotations

from collections.abc import Sequence

from ansible_collections.rosops.fleet.plugins.module_utils._common.errors import FleetError, NotReadyError, RosError
from ansible_collections.rosops.fleet.plugins.module_utils._common.poll import FAIL, PASS, WAIT
from ansible_collections.rosops.fleet.plugins.module_utils._step.record import Record
from ansible_collections.rosops.fleet.plugins.module_utils._step.update_record import run_of
from ansible_collections.rosops.fleet.plugins.module_utils._step.words import SOAKING
from ansible_collections.rosops.fleet.plugins.plugin_utils._model import names
from ansible_collections.rosops.fleet.plugins.plugin_utils._model.outcomes import FAILED, ROLLED_BACK, UPDATED
from ansible_collections.rosops.fleet.plugins.plugin_utils._objects.pod_settings import promised
from ansible_collections.rosops.fleet.plugins.plugin_utils._update import step as decide
from ansible_collections.rosops.fleet.plugins.plugin_utils._update import way_back
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.beside import beside, early
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.hands import MASTER_SECONDS
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.manifests import (
    Bounds,
    found_good,
    fulfilled,
    marked,
    step_objects,
)
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.outcome import UNPROVEN, WAITING, StepResult
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.rest import BusyError
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.turn import Now, Turn
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.world import (
    AwayError,
    CancelledError,
    LostError,
    Object,
)

NO_WAY_BACK = "no version of it was ever proven, so it stays as it is; another version takes its place"
VERIFY_EXTRA = 20.0
AT_REST_SECONDS = 2.0  # in which a robot shows that it is at rest now and then
LONG_WAIT = 5.0  # seconds in which the graph may have become another one
BESIDE_SECONDS = 10.0  # that a new version waits beside the old one for a robot that went to work again


class Gated:
    """The step at hand of a turn."""

    def __init__(self, turn: Turn, now: Now) -> None:
        self.turn, self.now, self.step = turn, now, now.step
        self.settings, self.say = turn.settings, turn.say

    def take(self) -> StepResult:
        """All of the step. Whatever goes wrong is its result, and no error."""
        turn, now = self.turn, self.now
        if self.step.proven:
            return self._finish()
        try:
            with turn.phase(now, "gate"):
                gate = self._gate()
            gate = self._begin(gate)
            self._come_to_rest(gate)
            with turn.phase(now, "record"):
                gate = self._rates(gate)
            with turn.phase(now, "apply"):
                self._apply(gate)
            if turn.check:
                return turn.result(now, UPDATED)
            with turn.phase(now, "rollout"):
                self._roll_out()
            with turn.phase(now, "verify"):
                self._verify(gate)
            return self._finish()
        except (BusyError, AwayError, CancelledError, LostError) as error:
            return turn.broken_off(now, error)
        except FleetError as error:
            return self._failed(error)

    # --- before -----------------------------------------------------------------------------------------------------

    def _gate(self) -> decide.Gate:
        """Refuse what cannot go well, before anything is touched."""
        turn = self.turn
        if turn.recorded and turn.stale:
            self._record_anew()
        known = turn.recorded or self.step.kind == "master" or turn.policy(self.step) == "force"
        if not (known or turn.check):  # in check mode the master is not mended yet
            self._record_late()
        gate = self._known()
        for warning in gate.warnings:
            self.say(f"WARNING: {self.step.name}: {warning}")
        if gate.problems:
            raise NotReadyError("; ".join(gate.problems))
        return gate

    def _record_anew(self) -> None:
        """What came, and what the steps before this one changed, is in it. A master that is silent is waited for."""
        turn = self.turn
        try:
            turn.record()
        except RosError as error:
            self.say(f"{self.step.name}: {error}")
            turn.master_answers("the master answers")
            self._record()

    def _record(self) -> None:
        try:
            self.turn.record()
        except RosError as error:
            raise NotReadyError(f"the graph is not known: {error}") from error

    def _record_late(self) -> None:
        """Only a master is changed while nobody knows the graph: it may be what is broken. It serves by now."""
        turn = self.turn
        later = turn.plan.steps[len(turn.results) :]
        nodes = sorted({node for step in later for node in step.old_nodes.values()} - {""})
        # the keeper gives the master what was registered; a node that does not come is recorded as it is
        turn.until(
            lambda seconds: turn.host.ready(turn.master, {"nodes": nodes}, seconds),
            MASTER_SECONDS,
            f"{self.step.name} waits until {', '.join(nodes)} is registered again",
        )
        self._record()

    def _known(self) -> decide.Gate:
        """What the graph, as it is known now, says of the step."""
        turn, now = self.turn, self.now
        now.graph = turn.graph
        now.gate = decide.step_gate(self.step, now.graph, turn.live, self.settings.edge_images)
        return now.gate

    def _begin(self, gate: decide.Gate) -> decide.Gate:
        """Start what can wait beside the old version for its end, before any goal is held for it.

        It takes a second moment of rest. A robot that hardly has one is not asked for two.
        """
        turn, now = self.turn, self.now
        chosen = early(self.step, gate.calm, bool(turn.keeper)) if turn.recorded and not turn.check else []
        unrated = bool({*gate.nodes} - turn.rated)
        if not (chosen and self._rests_now(gate, hold=unrated)):  # rates are those of rest only while no goal can come
            return gate
        with turn.phase(now, "record"):  # its pod is held to what was recorded when it started
            gate = self._rates(gate)
        now.rest.let_go()
        with turn.phase(now, "start"):
            objects = self._marked(gate)
            now.applied = now.beside = True  # from the first of these objects on
            turn.apply_all([turn.events(now), *beside(objects, chosen)])
            turn.cluster.begin(chosen, self.settings.ready_timeout)
        return gate

    def _needs_rest(self, gate: decide.Gate) -> bool:
        return bool(gate.calm) and self.turn.policy(self.step) != "force"

    def _rests_now(self, gate: decide.Gate, hold: bool) -> bool:
        turn, now = self.turn, self.now
        if not self._needs_rest(gate):
            return True
        if self.step.name in self.settings.since:  # it was waited for already
            return False
        with turn.phase(now, "wait"):
            return turn.rest(now, gate.calm, "the robot is idle", hold, AT_REST_SECONDS).verdict == PASS

    def _come_to_rest(self, gate: decide.Gate) -> None:
        """New goals are held. A robot that went to work again is waited for without a pod beside it."""
        turn, now = self.turn, self.now
        try:
            with turn.phase(now, "wait"):
                self._hold(gate)
        except BusyError as error:
            if not now.beside:
                raise
            self.say(f"{self.step.name}: {error}")
            self._go_back()
            now.applied, now.beside, now.withdrawn = False, False, True
            with turn.phase(now, "wait"):
                self._hold(gate)

    def _hold(self, gate: decide.Gate) -> None:
        """Wait until the robot is idle, and hold new goals back, so that none comes before the old server's end."""
        turn, name, policy = self.turn, self.step.name, self.turn.policy(self.step)
        if not self._needs_rest(gate):
            return
        if policy == "wait" and not turn.check and not self.now.beside:
            # a wait may be long, and whoever looks at the robot meanwhile wants to know of it
            turn.apply_all([turn.events(self.now, word=WAITING)])
        silent = decide.unanswered(gate.calm, turn.graph) if policy != "force" else []
        publishers = {topic: app.name for topic, app, _said in promised(turn.robot)} if silent else {}
        for topic in silent:
            if topic in publishers:  # it may be down, and come up with this very run
                self.say(f"{name}: {topic} is app {publishers[topic]}'s, which publishes nothing; {decide.UNASKED}")
        # a pod that waits beside the old one takes place, and the robot was at rest a moment ago
        seconds = BESIDE_SECONDS if self.now.beside else None
        seen = turn.rest(self.now, gate.calm, "the robot is idle", seconds=seconds)
        if turn.check:
            self.say(f"{name}: {'idle now' if seen.verdict == PASS else f'busy now: {seen.reason}'}")
        # in check mode nobody has waited: what would be waited for is no reason to leave out the rest of the plan
        if seen.verdict == WAIT and not (turn.check and policy == "wait"):
            raise BusyError(f"{seen.reason}; {decide.UNASKED}" if silent else seen.reason)
        if seen.verdict == FAIL:
            raise NotReadyError(f"it cannot be seen whether the robot is idle: {seen.reason}")
        if seen.verdict == PASS and seen.reason:  # a goal that comes now may be lost
            self.say(f"{name}: {seen.reason}")

    def _rates(self, gate: decide.Gate) -> decide.Gate:
        """What the nodes send when the robot rests is what the next version has to send, too.

        Steps that wait for nobody have theirs measured together. One that is forced may find the robot at work.
        """
        turn, now = self.turn, self.now
        missing, busy = {*gate.nodes} - turn.rated, decide.at_work(now.graph, gate.calm.actions)
        forced = busy and turn.policy(self.step) == "force"
        # what came while it waited is in the graph, too; but a version that starts beside the old one is none of it
        waited = (busy or now.phases.get("wait", 0.0) > LONG_WAIT) and not (now.beside or turn.check)
        if (missing or waited) and turn.recorded and not forced:
            if not gate.calm:
                later = [decide.step_gate(step, turn.graph, turn.live) for step in turn.plan.steps[len(turn.results) :]]
                missing |= {node for other in later if not other.calm for node in other.nodes} - turn.rated
            measured = turn.host.graph(turn.master, self.settings.rate_seconds if missing else 0.0, sorted(missing))
            turn.rated |= missing
            turn.graph = decide.with_rates(measured, turn.graph)
            calm, gate = gate.calm, self._known()
            if waited and gate.calm.actions != calm.actions:  # what was unknown is known by now
                self._hold(gate)
        for line in gate.allowed if turn.check else ():
            self.say(f"{self.step.name}: {line}")
        return gate

    # --- the change -------------------------------------------------------------------------------------------------

    def _apply(self, gate: decide.Gate) -> None:
        turn, now = self.turn, self.now
        if turn.check:
            turn.apply_all(self.step.objects)
            return
        objects = self._marked(gate)
        now.applied, now.beside = True, False  # from the first of these objects on
        turn.apply_all([turn.events(now), *objects])

    def _marked(self, gate: decide.Gate) -> Sequence[Object]:
        """The step's objects with the contracts, the way back, and the mark of what is not proven."""
        bounds = Bounds(self.settings.rate_tolerance, self.settings.ready_timeout)
        objects = step_objects(self.step, gate.contracts, bounds, self.now.started)
        self.now.maps = [item for item in objects if item["kind"] == "ConfigMap"]
        return objects

    def _roll_out(self) -> None:
        self.turn.cluster.stay(self.step.workloads, self.settings.ready_timeout)

    def _verify(self, gate: decide.Gate) -> None:
        """The graph is what was recorded, for as long as asked, and no container ended meanwhile."""
        turn, step = self.turn, self.step
        if step.kind == "master":
            turn.master_answers("the new master answers")
            if turn.recorded:
                turn.host.register(turn.master, self.now.graph)
        proof = decide.proof(step, gate, self.settings.rate_tolerance)
        if decide.proves_nothing(proof):
            self.say(f"{step.name}: nothing is recorded and nothing promised to hold it to: only its pod is proven")
        turn.stays(step.workloads, proof, max(VERIFY_EXTRA, step.patience), f"{step.name} is what was recorded")

    def _finish(self) -> StepResult:
        """Say that the contract is fulfilled, then take the mark off. Where that cannot be done it is proven anyway."""
        turn, now, step = self.turn, self.now, self.step
        turn.trace(f"{step.name}: finish")
        try:
            result = turn.result(now, UPDATED)
            turn.apply_all([*self._found_good(), turn.events(None, [result])])
            # the new server may have been there before, and then the keeper waits for a next one
            if step.resume or step.drifted:
                now.rest.release()
            return result
        except LostError as error:  # whoever had the robot meanwhile may have changed what was proven
            return turn.broken_off(now, error)
        except FleetError as error:
            turn.over = isinstance(error, CancelledError)
            reason = f"its mark could not be taken off ({error}); the next run does that"
            self.say(f"{step.name}: {reason}")
            return turn.result(now, UPDATED, reason)

    def _found_good(self) -> list[Object]:
        """That it is proven. Where a keeper can take it back that is the keeper's to say, after a while."""
        turn, now, step = self.turn, self.now, self.step
        apps = {*step.apps} - {names.KEEPER_NAME}
        revisions = {app: step.after.get(app, {}).get("revision", "") for app in apps}
        again = all(Record(history=step.histories.get(app, ())).is_history(new) for app, new in revisions.items())
        if step.proven or again or not (turn.keeper and turn.settings.soak and apps & {*step.previous}):
            return [*fulfilled(now.maps), *step.workloads]
        good = found_good(now.maps, turn.settings.soak, decide.new_pods(step, turn.read().pods))
        return [*good, *marked(step.workloads, run_of(now.started), SOAKING)]

    # --- or back ----------------------------------------------------------------------------------------------------

    def _failed(self, error: FleetError) -> StepResult:
        """Take back what was applied; what was not applied leaves nothing but held goals."""
        turn, now = self.turn, self.now
        self.say(f"{self.step.name}: {error}")
        if not now.applied:
            now.rest.release()
            return turn.result(now, FAILED, f"{now.left}: {error}")
        if not (self.step.previous or self.step.created):  # and what another run made may work tomorrow
            now.rest.release()
            return turn.result(now, FAILED, f"{error}; {NO_WAY_BACK}")
        try:
            turn.host.there()  # a robot that is away proves nothing, and cannot be helped from here
            self._go_back()
        except (AwayError, BusyError, LostError) as other:
            return turn.broken_off(now, other, str(error))
        except FleetError as worse:
            self.say(f"{self.step.name}: the way back failed, too: {worse}")
            now.rest.release()
            return turn.result(now, FAILED, f"{error}; the way back failed, too: {worse}; {UNPROVEN}")
        now.rest.release()
        return turn.result(now, ROLLED_BACK, str(error))

    def _go_back(self) -> None:
        with self.turn.phase(self.now, "wait"):
            way_back.hold_new(self.turn, self.now)
        with self.turn.phase(self.now, "rollback"):
            way_back.go(self.turn, self.now)
