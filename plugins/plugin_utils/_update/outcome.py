# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""What became of a step, of a robot, and of the budget of failures. Pure."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from ...module_utils._common.errors import SpecError, printable
from ...module_utils._step import update_record
from .._model.outcomes import BUSY, FAILED, OFFLINE, ROLLED_BACK, UNCHANGED, UPDATED

# The word that an operator has to know first stands first.
WAITING = update_record.WAITING  # no outcome yet: the run comes back to this robot
WORST_FIRST = (FAILED, ROLLED_BACK, OFFLINE, BUSY, WAITING, UPDATED, UNCHANGED)
COSTS_BUDGET = (FAILED, ROLLED_BACK)
# What a run leaves where it cannot go on, and could not go back.
UNPROVEN = "it runs unproven beside the way back; the next run proves it or takes it back"


@dataclass(frozen=True)
class StepResult:
    """A step that has ended, or (without an outcome) the one at hand. `phases` are seconds by name."""

    id: str
    name: str
    apps: Sequence[str]
    handoff: str
    before: Mapping[str, Mapping[str, str]]  # app -> image and revision
    after: Mapping[str, Mapping[str, str]]
    started: float  # since 1970
    phases: Mapping[str, float]
    outcome: str = ""
    reason: str = ""

    def as_dict(self) -> dict[str, Any]:
        """As the report and the record of updates have it."""
        return {
            "id": self.id,
            "name": self.name,
            "apps": list(self.apps),
            "handoff": self.handoff,
            "from": dict(self.before),
            "to": dict(self.after),
            "started": self.started,
            "phases": dict(self.phases),
            "busy_wait": self.phases.get("wait", 0.0),
            "outcome": self.outcome,
            "reason": printable(self.reason),
        }

    @classmethod
    def from_dict(cls, told: Mapping[str, Any]) -> StepResult:
        """What `as_dict` made of it; AttributeError, TypeError or ValueError for what is of another shape."""
        return cls(
            id=str(told.get("id") or ""),
            name=str(told.get("name") or ""),
            apps=tuple(map(str, told.get("apps") or ())),
            handoff=str(told.get("handoff") or ""),
            before=_versions(told.get("from")),
            after=_versions(told.get("to")),
            started=float(told.get("started") or 0),
            phases={str(name): float(seconds) for name, seconds in (told.get("phases") or {}).items()},
            outcome=str(told.get("outcome") or ""),
            reason=str(told.get("reason") or ""),
        )

    def told(self) -> str:
        """`temperature lab/apps:1.0 -> lab/apps:1.1 in 6.1 s`."""
        parts = []
        for app in self.apps:
            old, new = self.before.get(app, {}).get("image", "new"), self.after.get(app, {}).get("image", "removed")
            revision = self.after.get(app, {}).get("revision", "")
            parts.append(f"{app} {old} -> {new}" if old != new else f"{app} {new} ({revision})")
        text = f"{', '.join(parts)} in {sum(self.phases.values()):.1f} s"
        return f"{text}; {self.reason}" if self.reason else text


@dataclass(frozen=True)
class RobotOutcome:
    """The word for the robot, why, and its steps."""

    outcome: str
    reason: str = ""
    steps: Sequence[StepResult] = ()

    def as_dict(self) -> dict[str, Any]:
        """As the task returns it and the report reads it."""
        return {
            "outcome": self.outcome,
            "reason": printable(self.reason),
            "steps": [step.as_dict() for step in self.steps],
        }

    @classmethod
    def from_dict(cls, told: Mapping[str, Any]) -> RobotOutcome:
        """What `as_dict` made of it; AttributeError, TypeError or ValueError for what is of another shape."""
        steps = tuple(StepResult.from_dict(step) for step in told.get("steps") or ())
        return cls(str(told.get("outcome") or ""), str(told.get("reason") or ""), steps)


def _versions(told: Any) -> dict[str, dict[str, str]]:
    """App -> image and revision."""
    return {str(app): {str(key): str(said or "") for key, said in one.items()} for app, one in (told or {}).items()}


def robot_outcome(results: Sequence[StepResult], steps: int) -> RobotOutcome:
    """Of a robot whose plan had so many steps; the first one that does not end well is the last one begun."""
    words = [result.outcome for result in results]
    outcome = next((word for word in WORST_FIRST if word in words), UNCHANGED)
    good = outcome in (UPDATED, UNCHANGED)
    reasons = [
        result.told() if good else f"{result.name}: {result.reason}" for result in results if result.outcome == outcome
    ]
    left = steps - len(results)
    if left > 0:
        reasons.append(f"{left} further step{'s' if left > 1 else ''} not begun")
    return RobotOutcome(outcome, "; ".join(reasons), tuple(results))


def budget_left(budget: Any, robots: int, outcomes: Iterable[str]) -> int:
    """How many more robots may fail. The budget is a number of robots or a percentage of them, rounded down.

    Negative: it is used up, and no further wave may begin.
    """
    text = str(budget).strip()
    try:
        allowed = math.floor(robots * float(text[:-1]) / 100) if text.endswith("%") else int(text)
    except ValueError:
        raise SpecError(
            f"update_failure_budget is {budget!r}; allowed: a number of robots, or a percentage as '10%'"
        ) from None
    if allowed < 0:
        raise SpecError(f"update_failure_budget is {budget!r}; allowed: 0 or more")
    return allowed - sum(word in COSTS_BUDGET for word in outcomes)
