# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""An app is taken away, gated like an update: the robot rests, its node leaves as it would for a new version.

There is no way back but the inventory. A pod that is told to end cannot be told to stay.
"""

from __future__ import annotations

from ansible_collections.rosops.fleet.plugins.module_utils._common import poll
from ansible_collections.rosops.fleet.plugins.module_utils._common.errors import FleetError, NotReadyError
from ansible_collections.rosops.fleet.plugins.plugin_utils._model import names
from ansible_collections.rosops.fleet.plugins.plugin_utils._model.outcomes import FAILED
from ansible_collections.rosops.fleet.plugins.plugin_utils._update import step as decide
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.gated import VERIFY_EXTRA, Gated
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.nodes import own_nodes
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.outcome import StepResult
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.revisions import identity
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.world import Seen

LOOK_SECONDS = 0.5


class Removing(Gated):
    """The removal as a step of a turn."""

    def _rates(self, gate: decide.Gate) -> decide.Gate:
        return gate  # nobody has to send as much afterwards

    def _apply(self, _gate: decide.Gate) -> None:
        turn, now = self.turn, self.now
        now.applied = not turn.check
        if now.applied:
            turn.apply_all([turn.events(now)])
        there = [identity(item) for item in self.step.previous.values()]
        turn.changes += [done for done in turn.cluster.delete(there, turn.check) if done.changed]

    def _roll_out(self) -> None:
        """Until no pod of it is left: each ends within its grace period, which begins now."""
        (deployment,) = self.step.previous.values()
        grace = float(deployment["spec"]["template"]["spec"].get("terminationGracePeriodSeconds") or 0)
        seen = self.turn.until(
            self._gone, grace + self.settings.ready_timeout, f"waits until {self.step.name} has ended"
        )
        if seen.verdict != poll.PASS:
            raise NotReadyError(seen.reason)

    def _gone(self, seconds: float) -> Seen:
        turn, clock = self.turn, self.turn.clock
        whose = turn.robot.namespace, self.step.name

        def look() -> poll.Seen:
            pods = [pod["metadata"] for pod in turn.read().pods]
            left = [pod["name"] for pod in pods if (pod["namespace"], pod["labels"][names.LABEL_APP]) == whose]
            return poll.Seen(poll.WAIT if left else poll.PASS, f"still there: {', '.join(left)}")

        ended = poll.poll(look, seconds, LOOK_SECONDS, now=clock.now, sleep=clock.sleep)
        return Seen(ended.verdict, str(ended.last))

    def _verify(self, _gate: decide.Gate) -> None:
        """Nobody is registered under its nodes' names any more. What a process left that was killed is taken away."""
        turn, now = self.turn, self.now
        nodes = [node for found in own_nodes(self.step.old_nodes, now.graph, turn.live.pods).values() for node in found]
        if turn.recorded and nodes:
            turn.host.reap(turn.master, nodes)
            turn.ready({"absent": nodes}, VERIFY_EXTRA, f"{self.step.name} has left the graph")

    def _finish(self) -> StepResult:
        result = super()._finish()
        self.now.rest.release()  # no next server comes for them
        return result

    def _failed(self, error: FleetError) -> StepResult:
        self.say(f"{self.step.name}: {error}")
        self.now.rest.release()
        return self.turn.result(self.now, FAILED, f"{error}; {self.now.left}")
