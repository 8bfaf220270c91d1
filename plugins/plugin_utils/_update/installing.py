# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""A robot on which no app is at work gets all that is new at once: applied, awaited, and the graph is as promised.

There is nothing to go back to: what does not come up stays, and is told.
"""

from __future__ import annotations

import contextlib
from collections.abc import Sequence

from ansible_collections.rosops.fleet.plugins.module_utils._common.errors import FleetError, NotReadyError
from ansible_collections.rosops.fleet.plugins.module_utils._common.poll import FAIL, PASS
from ansible_collections.rosops.fleet.plugins.plugin_utils._model import names
from ansible_collections.rosops.fleet.plugins.plugin_utils._model.outcomes import FAILED, UPDATED
from ansible_collections.rosops.fleet.plugins.plugin_utils._objects.namespace import storage_objects
from ansible_collections.rosops.fleet.plugins.plugin_utils._objects.parts import PARTS, workload_objects
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.addresses import SERVING
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.install import members, promised
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.manifests import Bounds, installed, installing
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.outcome import StepResult
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.revisions import deployments_of
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.turn import UNFINISHED, Now, Turn
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.world import (
    AwayError,
    CancelledError,
    LostError,
    Object,
)

LOOK_SECONDS = 2.0  # of a look at what has had its time
NO_MASTER = "run the stage master of rosops.fleet.site first"


class Installing:
    """The installation as a step of a turn."""

    def __init__(self, turn: Turn, now: Now) -> None:
        self.turn, self.now, self.step = turn, now, now.step
        self.settings = turn.settings

    @property
    def _bounds(self) -> Bounds:
        return Bounds(self.settings.rate_tolerance, self.settings.ready_timeout)

    def take(self) -> StepResult:
        """All of it. Whatever goes wrong is its result, and no error."""
        turn, now, step = self.turn, self.now, self.step
        if not (turn.master or names.MASTER_NAME in step.apps):
            return turn.result(now, FAILED, f"nothing was touched: {turn.robot.name} has no ROS master; {NO_MASTER}")
        try:
            with turn.phase(now, "apply"):
                now.applied = not turn.check
                turn.apply_all(
                    step.objects if turn.check else installing(step.objects, step, self._bounds, now.started)
                )
            if turn.check:
                return turn.result(now, UPDATED)
            with turn.phase(now, "rollout"):
                claims = storage_objects(turn.robot) if set(step.apps) - set(SERVING) else []
                turn.cluster.wait([*claims, *step.workloads], self.settings.rollout_timeout)
            with turn.phase(now, "verify"):
                keeps_promise(turn, step.conditions, step.workloads)
            result = turn.result(now, UPDATED)
            self._prove(step.workloads, [turn.events(None, [result])])
            return result
        except (AwayError, CancelledError, LostError) as error:
            return turn.broken_off(now, error)
        except FleetError as error:
            return turn.result(now, FAILED, f"{error}; {UNFINISHED}{self._half()}")

    def _half(self) -> str:
        """Prove each app that came up all the same, so that it is at work from now on; what to say of that."""
        turn, proven = self.turn, list[str]()
        try:
            for app, workloads in members(self.step).items():
                with contextlib.suppress(NotReadyError):
                    turn.cluster.wait(workloads, LOOK_SECONDS)
                    keeps_promise(turn, promised(turn.robot, [app]), workloads, LOOK_SECONDS)
                    self._prove(workloads)
                    proven.append(app)
        except FleetError as error:
            turn.say(f"{self.step.name}: {error}")
        return f"; up: {', '.join(proven)}" if proven else ""

    def _prove(self, workloads: Sequence[Object], more: Sequence[Object] = ()) -> None:
        """Say that they are proven, then take their marks off: whatever brings a mark back is no word against them."""
        said = installed(workloads, self.step, self._bounds, self.now.started)
        self.turn.apply_all([*said, *workloads, *more])


def all_ready(turn: Turn) -> None:
    """All of the robot is rolled out, and its graph is what its apps promise, whether or not they were changed."""
    wanted = [*storage_objects(turn.robot), *deployments_of(workload_objects(turn.robot, PARTS))]
    turn.cluster.wait(wanted, turn.settings.rollout_timeout)
    keeps_promise(turn, promised(turn.robot, [app.name for app in turn.robot.apps]))


def keeps_promise(turn: Turn, conditions: Object, new: Sequence[Object] = (), timeout: float | None = None) -> None:
    """The graph is what the apps promised; with what is `new` for as long as that is looked at."""
    if not turn.master:
        raise NotReadyError(f"{turn.robot.name} has no ROS master; {NO_MASTER}")
    began, turn.graph_told = turn.clock.now(), {"verdict": FAIL}
    limit = float(conditions["timeout"]) if timeout is None else timeout
    try:
        what = "the graph is what the apps promised"
        if new:
            turn.stays(new, conditions, limit, what)
        else:
            turn.ready(conditions, limit, what)
        turn.graph_told["verdict"] = PASS
    finally:
        turn.graph_told["elapsed"] = round(turn.clock.now() - began, 3)
