# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""What became of a robot's update: its steps' results -> one outcome, the phases' times, the failure budget. Pure."""

from __future__ import annotations

import math
from typing import Any, Iterable, Mapping, Sequence

from ansible_collections.rosops.fleet.plugins.module_utils._common.errors import SpecError
from ansible_collections.rosops.fleet.plugins.plugin_utils._model.outcomes import (
    BUSY,
    FAILED,
    OFFLINE,
    ROLLED_BACK,
    UNCHANGED,
    UPDATED,
)

# The word that an operator has to know first stands first.
WORST_FIRST = (FAILED, ROLLED_BACK, OFFLINE, BUSY, UPDATED, UNCHANGED)
COSTS_BUDGET = (FAILED, ROLLED_BACK)


def robot_outcome(results: Sequence[Mapping[str, Any]], steps: int) -> dict[str, Any]:
    """`{outcome, reason, steps}` of a robot whose plan had so many steps.

    A result is `{name, apps, handoff, outcome, reason, from, to, phases, busy_wait}`; the first step that does not end
    well ends the robot's update.
    """
    words = [result["outcome"] for result in results]
    outcome = next((word for word in WORST_FIRST if word in words), UNCHANGED)
    reasons = [f"{result['name']}: {result['reason']}" for result in results if result["outcome"] == outcome]
    left = steps - len(results)
    if left > 0:
        reasons.append(f"{left} further step{'s' if left > 1 else ''} not begun")
    if outcome in (UPDATED, UNCHANGED):
        reasons = [_told(result) for result in results if result["outcome"] == outcome]
    return {"outcome": outcome, "reason": "; ".join(reasons), "steps": list(results)}


def _told(result: Mapping[str, Any]) -> str:
    """`temperature lab/apps:1.0 -> lab/apps:1.1 in 6.1 s`."""
    parts = []
    for app in result["apps"]:
        before, after = (result[side].get(app) or {} for side in ("from", "to"))
        old, new = before.get("image", "new"), after.get("image", "")
        parts.append(f"{app} {old} -> {new}" if old != new else f"{app} {new} ({after.get('revision', '')})")
    return f"{', '.join(parts)} in {sum(result['phases'].values()):.1f} s"


def phases(marks: Sequence[Mapping[str, Any]]) -> dict[str, float]:
    """Seconds of each phase out of `[{phase, at}, ...]`, each mark made when the phase before it ended.

    A phase lasts from its mark to the next one; the last mark only ends the one before.
    """
    found: dict[str, float] = {}
    for mark, following in zip(marks, marks[1:]):
        seconds = float(following["at"]) - float(mark["at"])
        found[mark["phase"]] = round(found.get(mark["phase"], 0.0) + max(seconds, 0.0), 3)
    return found


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
