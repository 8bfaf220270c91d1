# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""One machine for every change of what a robot works with, from its gate to its outcome.

    gate      what has to hold, and whether anything forbids the change
    start     a version that cannot work beside the old one waits there for the old one's end
    wait      the robot rests, and new goals are held back
    record    what is there now, and has to be there again
    apply     the change, and before it what the next run has to know of it
    rollout   what was changed is there, by its own word and by the cluster's
    verify    the graph is what was recorded
    finish    the change is proven, or its keeper watches it for a while (`update_soak`)
    rollback  or the change is taken back, under the same proof

The kinds of a change are a new version of an app (`app_change`), the installation of all that is new
(`install_change`), the removal of an app (`removal_change`) and a change of the host (`host_change`).
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

from ...module_utils._common.errors import FleetError
from .._kube.access import ServersAwayError
from .._model.outcomes import BUSY, FAILED, OFFLINE, ROLLED_BACK, UPDATED
from .events import step_id
from .hands import Hands
from .outcome import UNPROVEN, WAITING, StepResult
from .plan import Step
from .rest import BusyError, Rest
from .settings import Settings
from .step import NO_GRAPH, with_rates
from .world import AwayError, CancelledError, Graph, HeldError, LostError, Object, World

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
LOOK_SECONDS = 1.0  # for which the graph has to be as it should be
STAY_EXTRA = 5.0  # until the API shows what the robot shows
MAYBE_UNPROVEN = UNPROVEN.replace("it runs", "it may run")


class StaysError(FleetError):
    """There is no way back from the change; the text says what stays."""


def ends(error: FleetError) -> bool:
    """Whether the run does nothing more after this error."""
    return isinstance(error, tuple(ENDS))


def word_of(error: FleetError, begun: bool = False) -> str:
    """The outcome's word for an error that ends a change, which has `begun` to write or has not."""
    return next((words[begun] for kind, words in ENDS.items() if isinstance(error, kind)), FAILED)


@dataclass(frozen=True)
class Learned:
    """What a run knows of a robot's graph."""

    graph: Graph = NO_GRAPH
    recorded: bool = False
    stale: bool = False  # a step has changed the graph since
    rated: frozenset[str] = frozenset()  # nodes of which the rates at rest are known

    def anew(self, graph: Graph) -> Learned:
        """The graph as it is now, with the rates that are known."""
        return replace(self, graph=with_rates(graph, self.graph), recorded=True, stale=False)


class Ended(NamedTuple):
    """What a change leaves to the run that made it."""

    result: StepResult
    learned: Learned
    since: float | None  # when the change began to wait for the robot, by the clock's `now`
    over: bool  # no further change is begun


class Change:
    """One change. A kind says what its phases do; what goes wrong in them is the change's result, and no error."""

    where = "robot"  # that may go away
    learned = Learned()

    def __init__(self, told: StepResult, world: World, check: bool) -> None:
        self.told, self.name, self.check = told, told.name, check
        self.clock, self.say, self.trace = world.clock, world.say, world.trace
        self.rests: list[Rest] = []
        self.begun = False  # something may have been written
        self.written = False  # all of it was
        self.over = False
        self._phases, self._open, self._booked = dict(told.phases), list[str](), 0.0

    def take(self) -> Ended:
        """All of the change, from its gate to its outcome."""
        try:
            self._proceed()
            result = self.result(UPDATED) if self.check else self.finish()
        except FleetError as error:
            result = self._ends(error) if ends(error) else self._goes_back(error)
        since = next((rest.since for rest in self.rests if rest.since is not None), None)
        return Ended(result, self.learned, since, self.over)

    def _proceed(self) -> None:
        with self.phase("gate"):
            self.gate()
        self.start()
        with self.phase("wait"):
            self.hold()
        with self.phase("record"):
            self.record()
        with self.phase("apply"):
            self.apply()
        if not self.check:
            with self.phase("rollout"):
                self.roll_out()
            with self.phase("verify"):
                self.verify()

    # --- what a kind does in its phases; each raises one of our errors ----------------------------------------------

    def gate(self) -> None:
        """Refuse what cannot go well, before anything is touched."""

    def start(self) -> None:
        """Start what can wait beside the old version for the old version's end."""

    def hold(self) -> None:
        """Wait until the robot rests, and hold new goals back. In check mode the robot is only looked at."""

    def record(self) -> None:
        """What is there now, and has to be there again."""

    def apply(self) -> None:
        """The change itself; `begun` stands before its first write. In check mode it is found out what it would be."""

    def roll_out(self) -> None:
        """Wait until what was changed is there."""

    def verify(self) -> None:
        """Wait until the graph is what was recorded."""

    def finish(self) -> StepResult:
        """Say that the change is proven."""
        return self.result(UPDATED)

    def back(self) -> None:
        """Take back whatever part of the change was made; StaysError where there is no way back."""

    @property
    def left(self) -> str:
        """What a run leaves that can neither prove the change nor go back, in words."""
        return UNPROVEN if self.written else MAYBE_UNPROVEN

    @property
    def untouched(self) -> str:
        """The same where nothing of the change was made."""
        return NOTHING

    # --- what became of the change ----------------------------------------------------------------------------------

    def result(self, outcome: str = "", reason: str = "") -> StepResult:
        """The change with its outcome; without one it is still at hand."""
        phases = {name: round(seconds, 3) for name, seconds in self._phases.items() if seconds}
        return replace(self.told, phases=phases, outcome=outcome, reason=reason)

    def _ends(self, error: FleetError, before: str = "") -> StepResult:
        """This run does nothing more. `before` is what had gone wrong already."""
        if not isinstance(error, LostError):  # whoever has the robot now may hold goals, too
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
        try:
            self.back()
        except StaysError as stays:
            result = self.result(FAILED, f"{error}; {stays}")
        except FleetError as worse:
            if ends(worse):
                return self._ends(worse, str(error))
            self.say(f"{self.name}: the way back failed, too: {worse}")
            result = self.result(FAILED, f"{error}; the way back failed, too: {worse}; {self.left}")
        else:
            result = self.result(ROLLED_BACK, str(error))
        self.release()
        return result

    def _left_after(self, why: str) -> str:
        return f"{why}; {self.left}" if self.begun else f"{self.untouched}: {why}"

    def release(self) -> None:
        """Let the goals go that are held."""
        for rest in self.rests:
            rest.release()

    @contextlib.contextmanager
    def phase(self, name: str) -> Iterator[None]:
        """The seconds of this phase; those of a phase within it are not among them."""
        self.trace(f"{self.name}: {name}")
        self._book()
        self._open.append(name)
        try:
            yield
        finally:
            self._book()
            self._open.pop()

    def _book(self) -> None:
        now = self.clock.now()
        if self._open:
            self._phases[self._open[-1]] = self._phases.get(self._open[-1], 0.0) + now - self._booked
        self._booked = now


@dataclass(frozen=True)
class Turn:
    """What a step of a robot's plan gets of its run."""

    hands: Hands
    settings: Settings
    learned: Learned
    later: Sequence[Step]  # this one, and those after it
    events: Callable[[StepResult | None, Sequence[StepResult]], Object]  # the record of updates with what is at hand


class StepChange(Change):
    """A change of what runs on a robot: a step of its plan."""

    def __init__(self, step: Step, turn: Turn) -> None:
        self.step, self.hands, self.settings, self.events = step, turn.hands, turn.settings, turn.events
        self.host, self.cluster = turn.hands.host, turn.hands.cluster
        self.learned, self.later = turn.learned, turn.later
        clock, since = turn.hands.clock, turn.settings.since.get(step.name)
        waited = 0.0 if since is None else clock.now() - since
        started, name = clock.wall() - waited, turn.hands.robot.name
        told = StepResult(
            step_id(name, step.apps, started), step.name, step.apps, step.handoff,
            step.before, step.after, started, {"wait": waited},
        )  # fmt: skip
        super().__init__(told, turn.hands.world, turn.settings.check)

    @property
    def master(self) -> str:
        return self.hands.master

    def write(self, objects: Sequence[Object]) -> None:
        """Apply the objects with the record of updates, in which this step is at hand."""
        self.begun = True  # from the first of these objects on
        self.hands.apply_all([self.events(self.result(), ()), *objects])
        self.written = True

    def stays(self, conditions: Object, timeout: float, what: str, workloads: Sequence[Object] | None = None) -> None:
        """The robot's graph is like that, and for `verify_seconds` no container of these ends; NotReadyError.

        The graph is looked at first and last. Between them the API alone is watched: that costs the robot nothing.
        """
        seconds, at_first = self.settings.verify_seconds, min(self.settings.verify_seconds, LOOK_SECONDS)
        self.hands.ready(conditions, timeout + at_first, what, stable=at_first)
        self.cluster.stay(self.step.workloads if workloads is None else workloads, STAY_EXTRA, seconds - at_first)
        if seconds > at_first:
            self.hands.ready(conditions, timeout, what)
