# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""A robot on which no app is at work gets all that is new at once: applied, awaited, and the graph is as promised.

There is nothing to go back to: what does not come up stays, and is told.
"""

from __future__ import annotations

import contextlib
from collections.abc import Sequence

from ...module_utils._common.errors import FleetError, NotReadyError
from .._model import names
from .._model.outcomes import UPDATED
from .._objects.namespace import storage_objects
from .._objects.parts import PARTS, workload_objects
from .addresses import SERVING
from .change import StaysError, StepChange
from .hands import Hands
from .install import members, promised
from .manifests import Bounds, installed, installing
from .outcome import StepResult
from .revisions import deployments_of
from .world import Object

LOOK_SECONDS = 2.0  # of a look at what has had its time
NO_MASTER = "run the stage master of rosops.fleet.site first"
UNFINISHED = "what came up stays as it is; the next run goes on from there"
PROMISED = "the graph is what the apps promised"


class InstallChange(StepChange):
    @property
    def left(self) -> str:
        return UNFINISHED

    @property
    def _bounds(self) -> Bounds:
        return Bounds(self.settings.rate_tolerance, self.settings.ready_timeout)

    def gate(self) -> None:
        if not (self.master or names.MASTER_NAME in self.step.apps):
            raise no_master(self.hands)

    def apply(self) -> None:
        if self.check:
            self.hands.apply_all(self.step.objects)
            return
        self.begun = True  # from the first of these objects on
        self.hands.apply_all(installing(self.step.objects, self.step, self._bounds, self.told.started))

    def roll_out(self) -> None:
        claims = storage_objects(self.hands.robot) if set(self.step.apps) - set(SERVING) else []
        self.cluster.wait([*claims, *self.step.workloads], self.settings.rollout_timeout)

    def verify(self) -> None:
        if not self.hands.master:
            raise no_master(self.hands)
        with self.hands.telling():
            self.stays(self.step.conditions, float(self.step.conditions["timeout"]), PROMISED)

    def finish(self) -> StepResult:
        result = self.result(UPDATED)
        self._prove(self.step.workloads, [self.events(None, [result])])
        return result

    def back(self) -> None:
        """Prove each app that came up all the same, so that it is at work from now on."""
        proven = list[str]()
        try:
            for app, workloads in members(self.step).items():
                with contextlib.suppress(NotReadyError):
                    self.cluster.wait(workloads, LOOK_SECONDS)
                    if self.hands.master:
                        self.stays(promised(self.hands.robot, [app]), LOOK_SECONDS, PROMISED, workloads)
                        self._prove(workloads)
                        proven.append(app)
        except FleetError as error:
            self.say(f"{self.name}: {error}")
        raise StaysError(f"{UNFINISHED}; up: {', '.join(proven)}" if proven else UNFINISHED)

    def _prove(self, workloads: Sequence[Object], more: Sequence[Object] = ()) -> None:
        """Say that they are proven, then take their marks off: whatever brings a mark back is no word against them."""
        said = installed(workloads, self.step, self._bounds, self.told.started)
        self.hands.apply_all([*said, *workloads, *more])


def no_master(hands: Hands) -> NotReadyError:
    """That nobody can be asked for the robot's graph."""
    return NotReadyError(f"{hands.robot.name} has no ROS master; {NO_MASTER}")


def all_ready(hands: Hands, rollout_timeout: float) -> None:
    """All of the robot is rolled out, and its graph is what its apps promise, whether or not they were changed."""
    robot = hands.robot
    hands.cluster.wait([*storage_objects(robot), *deployments_of(workload_objects(robot, PARTS))], rollout_timeout)
    if not hands.master:
        raise no_master(hands)
    conditions = promised(robot, [app.name for app in robot.apps])
    with hands.telling():
        hands.ready(conditions, float(conditions["timeout"]), PROMISED)
