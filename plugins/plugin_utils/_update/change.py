# SPDX-License-Identifier: GPL-3.0-or-later
"""One machine for every change of what a robot works with, from its gate to its outcome: phases of class `Change`.

The kinds of a change of a robot's apps, which are the steps of its plan, are in `app_change`: a new version, the
installation of all that is new, a removal. A change of the host is in `host_change`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

from ...module_utils._common.errors import FleetError
from ...module_utils._ros.contract import Contract
from .._kube.access import ServersAwayError
from .._model.outcomes import BUSY, FAILED, OFFLINE, ROLLED_BACK, UPDATED
from .hands import BusyError, Hands, Rest, Settings, World
from .manifests import step_objects
from .outcome import UNPROVEN, WAITING, StepResult, step_id
from .plan import Step
from .world import AwayError, CancelledError, HeldError, LostError, Object

# The outcome of a change that an error ends: before the change has begun to write, and after that. Any other error is a
# failure before it, and after it a reason to go back.
ENDS: Mapping[type[FleetError], tuple[str, str]] = {
    BusyError: (BUSY, BUSY),  # WAITING for as long as the robot has time to come to rest
    HeldError: (BUSY, BUSY),
    LostError: (BUSY, FAILED),
    AwayError: (OFFLINE, OFFLINE),
    ServersAwayError: (OFFLINE, OFFLINE),
    CancelledError: (FAILED, FAILED),
}
NOTHING = "nothing was touched"
MAYBE_UNPROVEN = UNPROVEN.replace("it runs", "it may run")


class StaysError(FleetError):
    """There is no way back from the change; the text says what stays."""


def word_of(error: FleetError, begun: bool = False) -> str:
    """The outcome's word for an error that ends a change, which has `begun` to write or has not."""
    return next((words[begun] for kind, words in ENDS.items() if isinstance(error, kind)), FAILED)


class Change:
    """One change. A kind says what its phases do; what goes wrong in them is the change's result, and no error."""

    where = "robot"  # that may go away
    untouched = NOTHING  # what a run leaves where nothing of the change was made, in words
    left = ""  # the same where it was made and can neither be proven nor taken back

    def __init__(self, host: str, told: StepResult, settings: Settings, world: World) -> None:
        self.name, self.settings, self.check = told.name, settings, settings.check
        self.clock, self.say, self.trace = world.clock, world.say, world.trace
        since = settings.since.get(self.name)
        waited = 0.0 if since is None else world.clock.now() - since
        started = settings.begun.get(self.name, world.clock.wall() - waited)
        self.told = replace(told, id=step_id(host, told.apps, started), started=started)
        self.rests: list[Rest] = []
        self.begun = False  # something may have been written
        self.written = False  # all of it was
        self.over = False  # no further change is begun
        self._phase, self._phases, self._booked = "", {"wait": waited}, 0.0

    @property
    def since(self) -> float | None:
        """When it began to wait for a robot, by the clock's `now`."""
        return next((rest.since for rest in self.rests if rest.since is not None), None)

    def take(self) -> StepResult:
        try:
            self.proceed()
            return self.result(UPDATED) if self.check else self.finish()
        except FleetError as error:
            return self._ends(error) if isinstance(error, tuple(ENDS)) else self._goes_back(error)

    def proceed(self) -> None:
        before = [("gate", self.gate), ("wait", self.hold), ("record", self.record), ("apply", self.apply)]
        after = [("rollout", self.roll_out), ("verify", self.verify)]
        try:
            for name, phase in [*before, *([] if self.check else after)]:
                self.phase(name)
                phase()
        finally:
            self.phase("")

    # --- what a kind does in its phases; each raises one of our errors ----------------------------------------------

    def gate(self) -> None:
        """Refuse what cannot go well, before anything is touched."""

    def hold(self) -> None:
        """Wait until the robot rests, and hold new goals back. In check mode the robot is only looked at."""

    def record(self) -> None:
        """What is there now, and has to be there again."""

    def apply(self) -> None:
        """The change, and before it what the next run has to know of it; `begun` stands before the first write.

        In check mode it is found out what it would be.
        """

    def roll_out(self) -> None:
        """Wait until what was changed is there, by its own word and by the cluster's."""

    def verify(self) -> None:
        """Wait until the graph is what was recorded."""

    def finish(self) -> StepResult:
        """Say that the change is proven, or that its keeper watches it for a while (`update_soak`)."""
        return self.result(UPDATED)

    def back(self) -> None:
        """Take back whatever part of it was made, under the same proof; StaysError where there is no way back."""

    # --- what became of the change ----------------------------------------------------------------------------------

    def result(self, outcome: str = "", reason: str = "") -> StepResult:
        """The change with its outcome; without one it is still at hand."""
        phases = {name: told for name, seconds in self._phases.items() if (told := round(seconds, 3))}
        return replace(self.told, phases=phases, outcome=outcome, reason=reason)

    def _ends(self, error: FleetError, before: str = "") -> StepResult:
        """This run does nothing more. `before` is what had gone wrong already."""
        # Whoever has the robot now may hold goals of the same actions for a change of its own, and one that is let go
        # goes to a server that is just replaced: it would be lost. A goal that is held on is only late, by a minute.
        if not isinstance(error, LostError):
            self.release()
        word = word_of(error, self.begun)
        if isinstance(error, BusyError) and any(rest.patient for rest in self.rests):
            word = WAITING
        away = f"the {self.where} went away: " if isinstance(error, AwayError) else ""
        return self.result(word, self._left_after(f"{away}{error}{f'; before that: {before}' if before else ''}"))

    def _goes_back(self, error: FleetError) -> StepResult:
        """What was not begun leaves nothing but held goals."""
        self.say(f"{self.name}: {error}")
        if not self.begun:
            self.release()
            return self.result(FAILED, self._left_after(str(error)))
        outcome, reason = ROLLED_BACK, str(error)
        try:
            self.back()
        except StaysError as stays:
            outcome, reason = FAILED, f"{error}; {stays}"
        except FleetError as worse:
            self.phase("")
            if isinstance(worse, tuple(ENDS)):
                return self._ends(worse, str(error))
            self.say(f"{self.name}: the way back failed, too: {worse}")
            outcome, reason = FAILED, f"{error}; the way back failed, too: {worse}; {self._stays()}"
        self.phase("")
        self.release()
        return self.result(outcome, reason)

    def _left_after(self, why: str) -> str:
        return f"{why}; {self._stays()}" if self.begun else f"{self.untouched}: {why}"

    def _stays(self) -> str:
        return self.left or (UNPROVEN if self.written else MAYBE_UNPROVEN)

    def release(self) -> None:
        for rest in self.rests:
            rest.release()

    def phase(self, name: str) -> None:
        """From now on the seconds are those of this phase, or of none."""
        now = self.clock.now()
        if self._phase:
            self._phases[self._phase] = self._phases.get(self._phase, 0.0) + now - self._booked
        if name:
            self.trace(f"{self.name}: {name}")
        self._phase, self._booked = name, now


class StepChange(Change):
    """A change of what runs on a robot: the first of the `steps` of its plan, after which the others come."""

    def __init__(self, steps: Sequence[Step], hands: Hands) -> None:
        step = self.step = steps[0]
        told = StepResult("", step.name, tuple(step.apps), step.handoff, step.before, step.after)
        super().__init__(hands.robot.name, told, hands.settings, hands.world)
        self.hands, self.host, self.cluster, self.later = hands, hands.host, hands.cluster, steps
        self.maps: Sequence[Object] = ()  # the contracts and the way back, as they were applied

    def marked(self, contracts: Mapping[str, Contract]) -> Sequence[Object]:
        """The step's objects with the contracts, the way back, and the mark of what is not proven."""
        limits = self.settings.rate_tolerance, self.settings.ready_timeout
        objects = step_objects(self.step, contracts, *limits, self.told.started)
        self.maps = [item for item in objects if item["kind"] == "ConfigMap"]
        return objects
