# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""What the hosts of one run have come to so far, for the budget of failures, and for whoever comes back to a robot.

A file in Ansible's own temporary directory of the run: all workers see it, and it goes with the run. Reading the same
from the variables of all other hosts would cost every robot as much as there are robots.
"""

from __future__ import annotations

import contextlib
import fcntl
import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from .._model.outcomes import OFFLINE
from .outcome import COSTS_BUDGET, budget_left

NAME = "rosops-fleet-ledger.jsonl"
FLEET = "the fleet's"  # the wave in which what belongs to all robots is changed, before any robot's own
SERVERS = "servers"  # the kind of a change of the shared cluster's servers, which are none of the robots


class Ledger:
    """`wave` names the hosts that are changed together: what becomes of them does not count against each other.

    `kind` is what is changed of them: the budget is the run's, whatever it changes.
    """

    def __init__(self, directory: Path, wave: str, kind: str = "") -> None:
        self._path, self._wave, self._kind = directory / NAME, wave, kind

    def refusal(self, budget: str, hosts: int) -> str:
        """Why this wave may not begin, or nothing. SpecError for a budget that is none."""
        earlier = {
            line["robot"]: line["outcome"]
            for line in self._lines()
            if line["wave"] != self._wave and line["outcome"] in COSTS_BUDGET
            if (line["kind"] == SERVERS) == (self._kind == SERVERS)
        }
        if budget_left(budget, hosts, earlier.values()) >= 0:
            return ""
        return f"not begun: {', '.join(earlier)} failed, which is more than update_failure_budget allows"

    def note(self, robot: str, outcome: str, **more: Any) -> None:
        """Write down what became of a host, and what the run has to know when it comes back to it."""
        line = json.dumps({**more, "wave": self._wave, "kind": self._kind, "robot": robot, "outcome": outcome})
        with self._path.open("a", encoding="utf-8") as file:
            fcntl.flock(file, fcntl.LOCK_EX)  # a line is written whole, whoever else writes
            file.write(f"{line}\n")

    @contextlib.contextmanager
    def alone(self) -> Iterator[None]:
        """One worker at a time; who waits here has nothing else to do."""
        with self._path.with_suffix(".lock").open("w", encoding="utf-8") as file:
            fcntl.flock(file, fcntl.LOCK_EX)  # it ends with its worker
            yield

    def fleet_done(self) -> bool:
        """Whether some robot's turn has settled what is the fleet's. One that was off has not."""
        return any(line["wave"] == FLEET and line["outcome"] != OFFLINE for line in self._lines())

    def last(self, robot: str) -> dict[str, Any]:
        """What was noted last of a host's change of this kind, with all that was said besides."""
        mine = (line for line in reversed(self._lines()) if (line["robot"], line["kind"]) == (robot, self._kind))
        return next(mine, {})

    def _lines(self) -> list[dict[str, Any]]:
        if not self._path.exists():
            return []
        return [json.loads(line) for line in self._path.read_text(encoding="utf-8").splitlines()]
