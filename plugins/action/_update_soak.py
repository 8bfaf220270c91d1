# SPDX-License-Identifier: GPL-3.0-or-later
"""For the playbooks: the next wave begins once what is new in this one has soaked, and stayed good.

It goes on with what the update returned, and with another outcome where a keeper has taken something back. After the
last wave nobody waits: it soaks all the same, and status and the next run say what became of it.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from ..module_utils._common.documents import Arguments, Result, Variables
from ..module_utils._common.errors import FleetError
from ..plugin_utils._action.cancelled import cancellable
from ..plugin_utils._action.gated import GatedAction
from ..plugin_utils._model.fleet import robot_from_vars
from ..plugin_utils._model.outcomes import FAILED, UPDATED
from ..plugin_utils._report.kept import keep_early
from ..plugin_utils._update.engine import soak
from ..plugin_utils._update.outcome import RobotOutcome, StepResult


class ActionModule(GatedAction):
    """What it sees counts as what the robot's update came to: `KIND` is that of `_robot_update`."""

    _requires_connection = False
    KIND = "robot"

    def work(self, params: Arguments, known: Variables) -> Result:
        told = known.get("update_result") or {}
        result = {"changed": False, **{key: told[key] for key in ("outcome", "at_work") if key in told}}
        outcome = told.get("outcome") or {}
        if self._task.check_mode or is_last_wave(known) or outcome.get("outcome") != UPDATED:
            return result
        robot, host = robot_from_vars(known), str(known["inventory_hostname"])
        try:
            with self.cluster(params, known) as kube, cancellable():
                found = soak(self.run_of(kube, known), robot, revisions(outcome), self.world(known))
                if found.outcome == UPDATED:
                    return result
                keep_early(kube, host, found.outcome, found.reason, changed=True)
        except FleetError as error:  # a task that fails for all of a wave ends the run
            found = RobotOutcome(FAILED, f"nobody knows whether what is new stays good: {error}")
        self.ledger(known).note(host, found.outcome)
        return {**result, "outcome": {**outcome, "outcome": found.outcome, "reason": found.reason}}


def is_last_wave(known: Variables) -> bool:
    """Waves are taken in the order of their hosts' names (playbooks/waves.yml), but for who has left the run."""
    return max(known["ansible_play_hosts"]) in known["ansible_play_batch"]


def revisions(outcome: Mapping[str, Any]) -> dict[str, str]:
    """App -> the revision that a robot's steps have brought."""
    steps = [StepResult.from_dict(step) for step in outcome.get("steps") or ()]
    return {app: str(one.get("revision", "")) for step in steps for app, one in step.after.items()}
