# SPDX-License-Identifier: GPL-3.0-or-later
"""What the tasks of one run tell each other: what hosts have come to so far, and where the tasks stand.

Two files in Ansible's own temporary directory of the run: all workers and the main process see them, and they go with
the run. Reading the same from the variables of all other hosts would cost every robot as much as there are robots.
"""

from __future__ import annotations

import contextlib
import fcntl
import json
import math
import time
from collections.abc import Callable, Collection, Iterator
from pathlib import Path
from typing import Any, NamedTuple

from ...module_utils._common.errors import SpecError
from .._model.outcomes import FAILED, OFFLINE, ROLLED_BACK, UNCHANGED, UPDATED

NAME, STANDING = "rosops-fleet-ledger.jsonl", "rosops-fleet-standing.jsonl"
COSTS_BUDGET = (FAILED, ROLLED_BACK)
FLEET = "the fleet's"  # the wave in which what belongs to all robots is changed, before any robot's own
SERVERS = "servers"  # the kind of a change of the shared cluster's servers, which are none of the robots


class Ledger:
    """For the budget of failures, and for whoever comes back to a robot.

    `wave` names the hosts that are changed together: what becomes of them does not count against each other. `kind` is
    what is changed of them: the budget is the run's, whatever it changes.
    """

    def __init__(self, directory: Path, wave: str, kind: str = "") -> None:
        self._path, self._wave, self._kind = directory / NAME, wave, kind

    def refusal(self, budget: str, hosts: int) -> str:
        """Why this wave may not begin, or nothing. SpecError for a budget that is none."""
        earlier = dict.fromkeys(
            line["robot"]
            for line in _lines(self._path)
            if line["wave"] != self._wave and line["outcome"] in COSTS_BUDGET
            if (line["kind"] == SERVERS) == (self._kind == SERVERS)
        )
        if len(earlier) <= failures_allowed(budget, hosts):
            return ""
        return f"not begun: {', '.join(earlier)} failed, which is more than update_failure_budget allows"

    def note(self, robot: str, outcome: str, **more: Any) -> None:
        """Write down what became of a host, and what the run has to know when it comes back to it."""
        _add(self._path, {**more, "wave": self._wave, "kind": self._kind, "robot": robot, "outcome": outcome})

    @contextlib.contextmanager
    def alone(self) -> Iterator[None]:
        """One worker at a time; who waits here has nothing else to do."""
        with self._path.with_suffix(".lock").open("w", encoding="utf-8") as file:
            fcntl.flock(file, fcntl.LOCK_EX)  # it ends with its worker
            yield

    def fleet_done(self, parts: Collection[str]) -> bool:
        """Whether robots' turns have settled these parts of what is the fleet's, or one did not go well. One that was
        off has settled nothing."""
        turns = [line for line in _lines(self._path) if line["wave"] == FLEET and line["outcome"] != OFFLINE]
        settled = {part for line in turns for part in line.get("parts", ())}
        return {*parts} <= settled or any(line["outcome"] not in (UPDATED, UNCHANGED) for line in turns)

    def last(self, robot: str) -> dict[str, Any]:
        """What was noted last of a host's change of this kind, with all that was said besides."""
        mine = (line for line in reversed(_lines(self._path)) if (line["robot"], line["kind"]) == (robot, self._kind))
        return next(mine, {})


def failures_allowed(budget: Any, robots: int) -> int:
    """How many robots may fail. The budget is a number of robots or a percentage of them, rounded down."""
    text = str(budget).strip()
    try:
        allowed = math.floor(robots * float(text[:-1]) / 100) if text.endswith("%") else int(text)
    except ValueError:
        raise SpecError(
            f"update_failure_budget is {budget!r}; allowed: a number of robots, or a percentage as '10%'"
        ) from None
    if allowed < 0:
        raise SpecError(f"update_failure_budget is {budget!r}; allowed: 0 or more")
    return allowed


class Word(NamedTuple):
    """What the task of a host said: where it stands, or, without a text, that it has printed a line."""

    at: float  # by a clock that is the same in all processes
    host: str
    text: str = ""


class Standing:
    """Where the tasks stand by their own word, for whoever looks at a run that is silent.

    `clock` has to be the same in all processes.
    """

    def __init__(self, directory: Path, clock: Callable[[], float] = time.monotonic) -> None:
        self._path, self._clock = directory / STANDING, clock

    def note(self, host: str, text: str = "") -> None:
        _add(self._path, Word(self._clock(), host, text))

    def words(self, since: float) -> list[Word]:
        """Those that were said since then."""
        return [word for word in (Word(*line) for line in _lines(self._path)) if word.at >= since]


def _add(path: Path, said: Any) -> None:
    with path.open("a", encoding="utf-8") as file:
        fcntl.flock(file, fcntl.LOCK_EX)  # a line is written whole, whoever else writes
        file.write(f"{json.dumps(said)}\n")


def _lines(path: Path) -> list[Any]:
    """What was written so far. A line that is being written is left for the next time."""
    if not path.exists():
        return []
    *lines, _unfinished = path.read_text(encoding="utf-8").split("\n")
    return [json.loads(line) for line in lines]
