# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""A run's turn with one robot: what is to be done, what is known of the graph, what became of the steps."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace

from ansible_collections.rosops.fleet.plugins.module_utils._common.errors import FleetError
from ansible_collections.rosops.fleet.plugins.module_utils._step.update_record import (
    NEWS,
    REASON_KEPT,
    back_in_words,
    ways_back,
)
from ansible_collections.rosops.fleet.plugins.plugin_utils._kube.running import TODO, outdated
from ansible_collections.rosops.fleet.plugins.plugin_utils._model.context import Robot
from ansible_collections.rosops.fleet.plugins.plugin_utils._model.outcomes import BUSY, FAILED, OFFLINE, UPDATED
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.events import (
    EVENTS_NAME,
    events_map,
    known_events,
    step_id,
)
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.hands import Hands, timed
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.install import INSTALL
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.outcome import UNPROVEN, WAITING, StepResult
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.plan import Plan, Step
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.removal import REMOVE
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.rest import BusyError, Rest
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.revisions import read_records
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.settings import Settings
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.step import NO_GRAPH, Gate, with_rates
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.world import (
    AwayError,
    Calm,
    CancelledError,
    Graph,
    Object,
    Seen,
    World,
)

LOOK_SECONDS = 1.0  # for which the graph has to be as it should be
STAY_EXTRA = 5.0  # until the API shows what the robot shows
WITHDRAWN = "the new version, which had not begun, was taken back"
LEAVING = "it is there still, or ending; the next run goes on from there"
UNFINISHED = "what came up stays as it is; the next run goes on from there"


@dataclass
class Now:
    """The step at hand, for as long as it lasts."""

    step: Step
    started: float
    rest: Rest
    phases: dict[str, float] = field(default_factory=dict)
    graph: Graph = field(default_factory=lambda: NO_GRAPH)  # as it was before the step
    gate: Gate | None = None
    maps: Sequence[Object] = ()  # the contracts and the way back, as they were applied
    applied: bool = False
    beside: bool = False  # what is applied only waits beside the old version
    withdrawn: bool = False  # it did so, and was taken back

    @property
    def left(self) -> str:
        """What this run leaves of the step, in words."""
        if self.applied:
            return {INSTALL: UNFINISHED, REMOVE: LEAVING}.get(self.step.kind, UNPROVEN)
        return WITHDRAWN if self.withdrawn else "nothing was touched"


class Turn(Hands):
    """One robot, one run. The steps are taken by `gated` and `installing`."""

    def __init__(self, robot: Robot, settings: Settings, world: World) -> None:
        super().__init__(robot, world, settings.check)
        self.settings = settings
        self.plan, self.graph, self.recorded = Plan(), NO_GRAPH, False
        self.stale = False  # a step has changed it since
        self.rated: set[str] = set()  # nodes of which the rates at rest are known
        self.waiting: dict[str, float] = {}  # step -> since when it has waited for the robot, by the clock's `now`
        self.graph_told: dict[str, object] = {}  # of what the whole robot promises: verdict, and elapsed seconds
        self.results: list[StepResult] = []
        self.over = False  # no further step is begun

    # --- the step at hand -------------------------------------------------------------------------------------------

    def begun(self, step: Step) -> Now:
        """The step, at its beginning or where it waits again."""
        settings, since = self.settings, self.settings.since.get(step.name)
        waited = 0.0 if since is None else self.clock.now() - since
        patience = settings.busy_timeout if self.policy(step) == "wait" and not settings.check else 0.0
        rest = Rest(self, patience, since)
        return Now(step, self.clock.wall() - waited, rest, {"wait": round(waited, 3)} if waited else {})

    def record(self) -> None:
        """The robot's graph as it is now, with the rates that are known; RosError."""
        self.graph = with_rates(self.host.graph(self.master), self.graph)
        self.recorded, self.stale = True, False

    def policy(self, step: Step) -> str:
        """What to do about a robot that works: wait, defer or force."""
        return step.on_busy or self.settings.on_busy

    def rest(
        self,
        now: Now,
        calm: Calm,
        what: str,
        hold: bool = True,
        seconds: float | None = None,
    ) -> Seen:
        """Until the robot is calm and new goals held, for as long as the policy says, or so many seconds."""
        try:
            return now.rest.idle(calm, f"{now.step.name} waits until {what}", self.settings.look_timeout, hold, seconds)
        finally:
            if now.rest.since is not None:
                self.waiting[now.step.name] = now.rest.since

    def stays(self, workloads: Sequence[Object], conditions: Object, timeout: float, what: str) -> None:
        """The robot's graph is like that, and for `verify_seconds` no container of these ends; NotReadyError.

        The graph is looked at first and last. Between them the API alone is watched: that costs the robot nothing.
        """
        seconds = self.settings.verify_seconds
        at_first = min(seconds, LOOK_SECONDS)
        self.ready(conditions, timeout + at_first, what, stable=at_first)
        self.cluster.stay(workloads, STAY_EXTRA, seconds - at_first)
        if seconds > at_first:
            self.ready(conditions, timeout, what)

    @contextlib.contextmanager
    def phase(self, now: Now, name: str) -> Iterator[None]:
        self.trace(f"{now.step.name}: {name}")
        with timed(self.clock, now.phases, name):
            yield

    # --- what became of it ------------------------------------------------------------------------------------------

    def result(self, now: Now, outcome: str, reason: str = "") -> StepResult:
        """The step with its outcome; without one it is still at hand."""
        step = now.step
        found = StepResult(
            step_id(self.robot.name, step.apps, now.started),
            step.name, step.apps, step.handoff, step.before, step.after, now.started, dict(now.phases),
        )  # fmt: skip
        return replace(found, outcome=outcome, reason=reason)

    def broken_off(self, now: Now, error: FleetError, before: str = "") -> StepResult:
        """This run does nothing more to the robot. `before` is what had gone wrong already."""
        if isinstance(error, CancelledError):
            now.rest.release()  # not where another run has the robot: it may hold goals, too
        away = "the robot went away: " if isinstance(error, AwayError) else ""
        after = f"; before that: {before}" if before else ""
        words: dict[type, str] = {
            AwayError: OFFLINE,
            CancelledError: FAILED,
            BusyError: WAITING if now.rest.patient else BUSY,
        }
        word = words.get(type(error), FAILED if now.applied else BUSY)
        return self.result(now, word, f"{away}{error}{after}; {now.left}")

    # --- the record of the robot's updates --------------------------------------------------------------------------

    def events(self, now: Now | None, ended: Sequence[StepResult] = (), word: str = "") -> Object:
        """The record with this run's steps: those that have ended, and the one at hand, which runs or does this."""
        running = self.result(now, word) if now else None
        back = ways_back(self.live.deployments, read_records(self.live.maps))
        return events_map([*self.results, *ended], self.robot.name, self.live.maps, running, back)

    def untold(self) -> list[Object]:
        """The record, where it is not at its end: also that a run before this one ended without a word."""
        there = [item.get("data") for item in self.live.maps if item["metadata"]["name"] == EVENTS_NAME]
        record = self.events(None)
        return [] if self.check or not (self.results or there) or record["data"] in there else [record]

    def tell(self) -> None:
        """Bring the record to its end."""
        last = self.results[-1] if self.results else None
        if last and (last.outcome == WAITING or (last.outcome == UPDATED and not last.reason)):
            return  # told before it waited, or when its mark was taken off
        try:
            self.apply_all(self.untold())
        except FleetError as error:
            self.say(f"the robot's metrics will not show this: {error}")

    def news(self) -> list[str]:
        """What the keeper did that no run has told yet, and apps that run another image than its name means by now."""
        taken = {app for step in self.plan.steps for app in step.apps}  # their pods are new ones by then
        others = [one for one in outdated(self.live.pods, self.settings.known) if one.app not in taken]
        events = known_events(self.live.maps, self.robot.name)
        known = {str(event.get("reason")) for event in events if NEWS not in event}
        back = ways_back(self.live.deployments, read_records(self.live.maps))
        told = {app: back_in_words(one) for app, one in back.items()}
        new = [f"{app}: {text}" for app, text in told.items() if text[:REASON_KEPT] not in known]
        return [*new, *dict.fromkeys(f"{one.app} {one.what}; {TODO}" for one in others)]
