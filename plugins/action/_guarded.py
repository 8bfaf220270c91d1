# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""For the role guarded: the user's tasks as a change of a host, with the care that robots at work there need.

The engine works in a process beside the run, from the first task of the role to its last one.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, ClassVar

from ansible import constants as C  # noqa: N812 - its customary name
from ansible_collections.rosops.fleet.plugins.module_utils._common.errors import FleetError
from ansible_collections.rosops.fleet.plugins.plugin_utils._action.aside import Turns, begin, come_back
from ansible_collections.rosops.fleet.plugins.plugin_utils._action.cluster import ClusterAction
from ansible_collections.rosops.fleet.plugins.plugin_utils._action.guarding import Guarding
from ansible_collections.rosops.fleet.plugins.plugin_utils._action.variables import change_variables, role_variables
from ansible_collections.rosops.fleet.plugins.plugin_utils._kube.access import ServersAwayError
from ansible_collections.rosops.fleet.plugins.plugin_utils._model.fleet import Fleet
from ansible_collections.rosops.fleet.plugins.plugin_utils._model.outcomes import FAILED, OFFLINE, UNCHANGED, UPDATED
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.change import Limits
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.cluster import run_name
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.kube_nodes import KubeNodes
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.ledger import Ledger
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.outcome import WAITING
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.rest import look_seconds
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.world import AwayError

LEDGER = "rosops-fleet-guarded.jsonl"
MAKE, UNDO = "make", "undo"


class UsersTasks:
    """The change, as `Guarded` wants it; the run takes its turns."""

    before = after = ""  # tasks have no version
    unproven = True  # what was recorded for tasks that nobody has proven is still there
    left = "what was done stays; the next run holds the robot to what it was before"

    def __init__(self, name: str, turns: Turns, way_back: bool) -> None:
        self.name, self._turns, self._way_back = name, turns, way_back

    def make(self) -> None:
        self._turns.give(MAKE)

    def works(self) -> None:
        """The tasks have said so themselves."""

    def undo(self) -> None:
        if not self._way_back:
            raise FleetError("what was done stays, as there is no guarded_undo")
        self._turns.give(UNDO)

    def proven(self) -> None:
        """Nothing is kept of it."""


class ActionModule(ClusterAction):
    """Without a `line` it begins; with one it goes on after a turn, of which `failure` says what went wrong.

    A result with `turn` (make or undo) and `line` asks for it; one with `waiting` has the task come back, with that in
    `since`. Any other one has the robot's `outcome`, but where all went well: then it is what the tasks have changed.
    """

    _requires_connection = True
    ARGUMENTS: ClassVar = {
        "line": {"type": "str", "default": ""},
        "failure": {"type": "str", "default": ""},
        "since": {"type": "float"},
    }

    def work(self, params: Mapping[str, Any], known: dict[str, Any]) -> dict[str, Any]:
        name = known["inventory_hostname"]
        variables = role_variables("guarded", self._templar, known) | change_variables(self._templar, known)
        batch = known.get("ansible_play_batch") or [name]
        ledger = Ledger(Path(C.DEFAULT_LOCAL_TMP), str(batch[0]), LEDGER)
        if params["line"]:
            told = come_back(params["line"], params["failure"])
        else:
            hosts = len(known.get("ansible_play_hosts_all") or batch)
            refusal = ledger.refusal(variables["update_failure_budget"], hosts)
            if refusal:
                return _outcome(UNCHANGED, refusal)
            told = begin(lambda turns: self._guarded(turns, params, variables, known))
        if "error" in told:
            raise FleetError(told["error"])
        if "turn" in told:
            return {"changed": False, "turn": told["turn"], "line": told["line"]}
        if told["outcome"] == WAITING:
            return {"changed": False, "waiting": told["since"], "msg": told["reason"]}
        ledger.note(name, told["outcome"])
        if told["outcome"] == UPDATED:
            return {"changed": False, "foreseen": bool(self._task.check_mode), "msg": told["reason"] or "proven"}
        return _outcome(told["outcome"], told["reason"], told["steps"])

    def _guarded(
        self, turns: Turns, params: Mapping[str, Any], variables: Mapping[str, Any], known: dict[str, Any]
    ) -> dict[str, Any]:
        """What became of it, from the process beside."""
        change = UsersTasks(Path(variables["guarded_tasks"]).stem, turns, bool(variables["guarded_undo"]))
        node = Fleet.from_vars(known).hosts[known["inventory_hostname"]].node
        limits = Limits(
            on_busy=variables["update_on_busy"],
            busy_timeout=variables["update_busy_timeout"],
            ready_timeout=variables["guarded_ready_timeout"],
            look=look_seconds(variables["update_busy_timeout"], params["since"] is not None),
            since=params["since"],
            check=bool(self._task.check_mode),
        )
        try:
            with self.cluster(params, known) as kube:
                guarding = Guarding(self, known, KubeNodes(kube, self.say(known), run_name(known)))
                guarded = guarding.change(change, guarding.robots(node), node, limits)
                found = guarded.run()
        except (AwayError, ServersAwayError) as error:
            return {"outcome": OFFLINE, "reason": f"nothing was touched: {error}", "steps": []}
        except FleetError as error:
            return {"outcome": FAILED, "reason": f"nothing was touched: {error}", "steps": []}
        steps = [found.as_dict()]
        return {"outcome": found.outcome, "reason": found.reason, "steps": steps, "since": guarded.since}


def _outcome(word: str, reason: str, steps: Sequence[Mapping[str, Any]] = ()) -> dict[str, Any]:
    found = {"outcome": word, "reason": reason, "steps": list(steps)}
    return {"changed": False, "outcome": found, "msg": f"{word}: {reason}"}
