# SPDX-License-Identifier: GPL-3.0-or-later
"""For the role guarded: the user's tasks as a change of a host, with the care that robots at work there need.

The engine works in a process beside the run, from the first task of the role to its last one.
"""

from __future__ import annotations

from pathlib import Path
from typing import ClassVar

from ..module_utils._common.documents import Arguments, Result, Variables
from ..module_utils._common.errors import FleetError
from ..plugin_utils._action.aside import Turns, begin, come_back
from ..plugin_utils._action.gated import HostAction
from ..plugin_utils._action.variables import OF_EVERY_CHANGE
from ..plugin_utils._model.fleet import Fleet
from ..plugin_utils._model.outcomes import UPDATED
from ..plugin_utils._update.change import NOTHING, word_of
from ..plugin_utils._update.host_change import HostChange, Work
from ..plugin_utils._update.outcome import WAITING, RobotOutcome

MAKE, UNDO = "make", "undo"


class UsersTasks(Work):
    """The run takes its turns. Tasks have no version, and say themselves whether they went well."""

    unproven = True  # what was recorded for tasks that nobody has proven is still there
    left = "what was done stays; the next run holds the robot to what it was before"

    def __init__(self, name: str, node: str, turns: Turns, way_back: bool) -> None:
        self.name, self.node, self._turns, self._way_back = name, node, turns, way_back

    def make(self) -> None:
        self._turns.give(MAKE)

    def undo(self) -> None:
        if not self._way_back:
            raise FleetError("what was done stays, as there is no guarded_undo")
        self._turns.give(UNDO)


class ActionModule(HostAction):
    """Without a `line` it begins; with one it goes on after a turn, of which `failure` says what went wrong.

    A result with `turn` (make or undo) and `line` asks for it; one with `waiting` has the task come back. Any other one
    has the robot's `outcome`, but where all went well: then it is what the tasks have changed.
    """

    KIND = "tasks"
    ARGUMENTS: ClassVar = {"line": {"type": "str", "default": ""}, "failure": {"type": "str", "default": ""}}

    def work(self, params: Arguments, known: Variables) -> Result:
        name, ledger = known["inventory_hostname"], self.ledger(known)
        variables = self.variables(known, "guarded") | self.variables(known, "update", *OF_EVERY_CHANGE)
        if params["line"]:
            told = come_back(params["line"], params["failure"])
        else:
            refusal = self.outcome(ledger, variables["update_failure_budget"], known, lambda: None)
            if refusal:
                return {"changed": False, "outcome": refusal.as_dict(), "msg": f"{refusal.outcome}: {refusal.reason}"}
            before = ledger.last(name)
            told = begin(lambda turns: self._guarded(turns, params, variables, known, before))
        if "error" in told:
            raise FleetError(told["error"])
        if "turn" in told:
            return {"changed": False, "turn": told["turn"], "line": told["line"]}
        word, reason = told["outcome"], told["reason"]
        ledger.note(name, word, since=told["since"])
        if word == WAITING:
            return {"changed": False, "waiting": True, "msg": reason}
        if word == UPDATED:
            return {"changed": False, "foreseen": bool(self._task.check_mode), "msg": reason or "proven"}
        outcome = {key: told[key] for key in ("outcome", "reason", "steps")}
        return {"changed": False, "outcome": outcome, "msg": f"{word}: {reason}"}

    def _guarded(
        self, turns: Turns, params: Arguments, variables: Variables, known: Variables, before: Result
    ) -> Result:
        node = Fleet.from_vars(known).hosts[known["inventory_hostname"]].node
        work = UsersTasks(Path(variables["guarded_tasks"]).stem, node, turns, bool(variables["guarded_undo"]))
        settings = self.settings(variables, variables["guarded_ready_timeout"], work.name, before)
        try:
            with self.cluster(params, known) as kube:
                robots = self.robots(known, kube, node)
                change = HostChange(work, settings, self.world(known), self.run_of(kube, known), robots)
                found = self.taken(change)
        except FleetError as error:
            return {**RobotOutcome(word_of(error), f"{NOTHING}: {error}").as_dict(), "since": None}
        return {**RobotOutcome(found.outcome, found.reason, (found,)).as_dict(), "since": self.since}
