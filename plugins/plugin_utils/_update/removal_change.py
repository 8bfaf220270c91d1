# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""An app is taken away, gated like an update: the robot rests, its node leaves as it would for a new version.

There is no way back but the inventory. A pod that is told to end cannot be told to stay.
"""

from __future__ import annotations

from ...module_utils._common import poll
from ...module_utils._common.errors import NotReadyError
from .._model import names
from .app_change import VERIFY_EXTRA, AppChange
from .change import StaysError
from .nodes import own_nodes
from .outcome import StepResult
from .revisions import identity
from .world import Seen

LOOK_SECONDS = 0.5
LEAVING = "it is there still, or ending; the next run goes on from there"


class RemovalChange(AppChange):
    @property
    def left(self) -> str:
        return LEAVING

    def record(self) -> None:
        """Nobody has to send as much afterwards."""

    def apply(self) -> None:
        if not self.check:
            self.write(())
        there = [identity(item) for item in self.step.previous.values()]
        self.hands.delete(there)

    def roll_out(self) -> None:
        """Until no pod of it is left: each ends within its grace period, which begins now."""
        (deployment,) = self.step.previous.values()
        grace = float(deployment["spec"]["template"]["spec"].get("terminationGracePeriodSeconds") or 0)
        seen = self.hands.until(self._gone, grace + self.settings.ready_timeout, f"waits until {self.name} has ended")
        if seen.verdict != poll.PASS:
            raise NotReadyError(seen.reason)

    def _gone(self, seconds: float) -> Seen:
        whose = self.hands.robot.namespace, self.name

        def look() -> poll.Seen:
            pods = [pod["metadata"] for pod in self.hands.read().pods]
            left = [pod["name"] for pod in pods if (pod["namespace"], pod["labels"][names.LABEL_APP]) == whose]
            return poll.Seen(poll.WAIT if left else poll.PASS, f"still there: {', '.join(left)}")

        ended = poll.poll(look, seconds, LOOK_SECONDS, now=self.clock.now, sleep=self.clock.sleep)
        return Seen(ended.verdict, str(ended.last))

    def verify(self) -> None:
        """Nobody is registered under its nodes' names any more. What a process left that was killed is taken away."""
        own = own_nodes(self.step.old_nodes, self.learned.graph, self.hands.live.pods)
        nodes = [node for found in own.values() for node in found]
        if self.learned.recorded and nodes:
            self.host.reap(self.master, nodes)
            self.hands.ready({"absent": nodes}, VERIFY_EXTRA, f"{self.name} has left the graph")

    def finish(self) -> StepResult:
        result = super().finish()
        self.release()  # no next server comes for the goals that are held
        return result

    def back(self) -> None:
        raise StaysError(LEAVING)
