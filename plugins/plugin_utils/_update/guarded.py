# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""A change of a host on which robots work, under the care of a step. The change and the world are handed in.

    look      the robots that work there; where none does, nothing is waited for
    claim     this run alone changes them
    record    their graphs; what was recorded lies in their namespaces before the change, for whoever goes on from there
    hold      all idle at the same time, new goals held back
    make      the change itself
    prove     the change works, the node and the Deployments are ready, the graphs are what was recorded
    or back   the change is undone, under the same proof

The change may take the cluster's API away for a while, as a restart of a robot's own k3s does. Until it is made that is
an error, from then on weather, for as long as `ready_timeout` says.
"""

from __future__ import annotations

import contextlib
from collections.abc import Iterator, Sequence
from dataclasses import replace

from ansible_collections.rosops.fleet.plugins.module_utils._common.errors import FleetError, KubeError, NotReadyError
from ansible_collections.rosops.fleet.plugins.module_utils._common.poll import FAIL, PASS
from ansible_collections.rosops.fleet.plugins.plugin_utils._model.context import Robot
from ansible_collections.rosops.fleet.plugins.plugin_utils._model.outcomes import (
    BUSY,
    FAILED,
    OFFLINE,
    ROLLED_BACK,
    UPDATED,
)
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.change import (
    Change,
    Limits,
    Surroundings,
)
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.events import step_id
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.hands import SLICE, timed
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.outcome import WAITING, StepResult
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.proof import Proof
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.rest import HOLD_SECONDS, BusyError, Rest
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.ward import Ward
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.world import (
    AwayError,
    CancelledError,
    HeldError,
    LostError,
    World,
)


class Guarded:
    """One change of one host. `node` is its name in the cluster; empty where it has none to be proven by.

    `robots` are those that may work there.
    """

    def __init__(self, change: Change, robots: Sequence[Robot], node: str, limits: Limits, world: Surroundings) -> None:
        self.change, self.robots, self.node, self.limits = change, robots, node, limits
        self.host, self.cluster, self.clock = world.host, world.cluster, world.clock
        self.say, self.trace = world.say, world.trace
        self.wards: list[Ward] = []
        self.phases: dict[str, float] = {}
        self.proof = Proof(change, node, limits, world)
        self.made = False
        self.since: float | None = None  # when it began to wait for a robot, by the clock's `now`
        self.patient = False  # the time for which a busy robot is waited for is not over
        name, before, after = change.name, change.before, change.after
        self.result = StepResult(
            step_id(node, [name], self.clock.wall()),
            name, [name], "replace",
            {name: {"image": before}},
            {name: {"image": after, "revision": "settings" if before == after else ""}},
            self.clock.wall(), {},
        )  # fmt: skip

    def run(self) -> StepResult:
        """From the look to the outcome. Whatever goes wrong with this host is its outcome, and no error."""
        try:
            with self._phase("gate"):
                self.host.there()
                self._look()
            if self.limits.check:
                return self._foresee()
            with self._claimed():
                return self._changed()
        except HeldError as error:
            return self._ends(BUSY, f"nothing was touched: {error}")
        except AwayError as error:
            return self._ends(OFFLINE, f"nothing was touched: {error}")
        except FleetError as error:
            return self._ends(FAILED, f"nothing was touched: {error}")

    # --- before -----------------------------------------------------------------------------------------------------

    def _look(self) -> None:
        """Who works here."""
        if self.cluster is None:
            return
        world = World(self.cluster, self.host, self.clock, self.say, self.trace)
        for robot in sorted(self.robots, key=lambda one: one.name):
            ward = Ward(robot, world, self.limits.check)
            ward.live = ward.read()
            if any(item["metadata"]["namespace"] == robot.namespace for item in ward.live.deployments):
                self.wards.append(ward)

    def _record(self) -> None:
        """What each robot's graph is now, and has to be again; of a change that was cut off, what it was before."""
        for ward in self.wards:
            if self.change.unproven:
                ward.recall(self.node)
            try:
                ward.record()
            except (AwayError, CancelledError):
                raise
            except FleetError as error:
                # what the change has done to it is seen by the proof, and it is taken back
                if self.limits.on_busy != "force" and ward.contract is None:
                    raise
                self.say(f"the graph of {ward.robot.name} cannot be read, and is not waited for: {error}")

    def _foresee(self) -> StepResult:
        """What the change would meet now."""
        self._record()
        for ward in self.wards:
            ward.rest = Rest(ward, 0.0) if ward.calm else None
            busy = self._rest(ward)
            self.say(f"{self.change.name}: {ward.robot.name} is {f'busy now: {busy}' if busy else 'idle now'}")
            if busy and self.limits.on_busy == "defer":
                return self._ends(BUSY, busy)
        return self._ends(UPDATED)

    @contextlib.contextmanager
    def _claimed(self) -> Iterator[None]:
        with contextlib.ExitStack() as claims:
            if self.cluster is not None:
                for ward in self.wards:
                    claims.enter_context(self.cluster.claim(ward.robot.namespace))
                    ward.live = ward.read()  # the run that had it may have changed it just now
            yield

    def _hold(self) -> None:
        """Wait until all robots are idle at the same time, and hold new goals back until the change is over."""
        limits, now = self.limits, self.clock.now()
        self.since = now if limits.since is None else limits.since
        seconds = limits.busy_timeout if limits.on_busy == "wait" else 0.0
        wards = [ward for ward in self.wards if ward.calm and limits.on_busy != "force"]
        for ward in wards:
            ward.rest = Rest(ward, seconds, self.since)
        while True:
            began = self.clock.now()
            for ward in wards:
                look = None if limits.look is None else max(limits.look - (self.clock.now() - now), 0.0)
                busy = self._rest(ward, look)
                if busy:
                    raise BusyError(f"{ward.robot.name}: {busy}")
            if len(wards) < 2 or self.clock.now() - began < HOLD_SECONDS - SLICE:
                return
            # what was held first has been let go by its keeper meanwhile
            if self.clock.now() >= self.since + seconds:
                raise BusyError(f"{', '.join(ward.robot.name for ward in wards)} were not idle at the same time")

    def _rest(self, ward: Ward, look: float | None = None) -> str:
        """Have the robot at rest; why it is not, if it works still when the time is over."""
        if ward.rest is None:
            return ""
        seen = ward.rest.idle(ward.calm, f"{self.change.name} waits until {ward.robot.name} is idle", look)
        if seen.verdict == FAIL:
            raise NotReadyError(f"it cannot be seen whether {ward.robot.name} is idle: {seen.reason}")
        self.patient = ward.rest.patient
        return "" if seen.verdict == PASS else seen.reason

    # --- the change -------------------------------------------------------------------------------------------------

    def _changed(self) -> StepResult:
        try:
            with self._phase("wait"):
                self._record()
                self._hold()
            with self._phase("apply"):
                for ward in self.wards:
                    ward.keep(self.node)
                self._confirm()
                self.proof.begin()
                self.made = True  # from the first moment on
                self.change.make()
            with self._phase("verify"):
                self._prove()
            return self._ends(UPDATED)
        except BusyError as error:
            return self._ends(WAITING if self.patient else BUSY, f"nothing was touched: {error}")
        except AwayError as error:
            return self._ends(OFFLINE, self._left(f"the host went away: {error}"))
        except CancelledError as error:
            return self._ends(FAILED, self._left(str(error)))
        except FleetError as error:
            if self.made:
                return self._back(error)
            word = BUSY if isinstance(error, LostError) else FAILED
            return self._ends(word, f"nothing was touched: {error}")
        finally:
            self._release()

    def _confirm(self) -> None:
        if self.cluster is not None:
            self.cluster.confirm()

    def _prove(self) -> None:
        self.proof.given(self.wards)
        self.change.proven()
        for ward in self.wards:
            ward.forget(self.node)

    def _back(self, error: FleetError) -> StepResult:
        self.say(f"{self.change.name}: {error}; it is taken back")
        try:
            with self._phase("rollback"):
                with contextlib.suppress(KubeError):  # the API may be what the change has broken
                    self._confirm()
                    self.proof.begin()
                self.change.undo()
                self._prove()
        except AwayError as away:
            return self._ends(OFFLINE, self._left(f"the host went away: {away}; before that: {error}"))
        except FleetError as worse:
            return self._ends(FAILED, f"{error}; the way back failed, too: {worse}; {self.change.left}")
        return self._ends(ROLLED_BACK, str(error))

    # --- after ------------------------------------------------------------------------------------------------------

    def _release(self) -> None:
        for ward in self.wards:
            if ward.rest:
                ward.rest.release()

    def _left(self, why: str) -> str:
        return f"{why}; {self.change.left}" if self.made else f"{why}; nothing was touched"

    def _ends(self, outcome: str, reason: str = "") -> StepResult:
        return replace(self.result, outcome=outcome, reason=reason, phases=dict(self.phases))

    @contextlib.contextmanager
    def _phase(self, name: str) -> Iterator[None]:
        self.trace(f"{self.change.name}: {name}")
        with timed(self.clock, self.phases, name):
            yield
