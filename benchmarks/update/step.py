# SPDX-License-Identifier: GPL-3.0-or-later
"""What is known of one update when it is over, whichever arm made it. Pure."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from .windows import Span


@dataclass(frozen=True)
class Step:
    """One update: when, how long by phase, and how it ended."""

    run: Span  # from the command to its end: what whoever gives it waits for
    span: Span
    seconds: float | None  # the step's own wall time, busy wait included
    busy_wait: float | None = None
    phases: Mapping[str, float] = field(default_factory=dict)
    outcome: str = "updated"
    problem: str = ""


def fleet_step(report: Mapping[str, Any], robot: str, run: Span) -> Step:
    """The step that a run of the playbook reported for the robot.

    Without a step's `started` its place in the run is not known: it is taken to have ended with the run.
    """
    host = next((item for item in report.get("hosts", []) if item.get("host") == robot), None)
    if host is None:
        return Step(run, run, None, outcome="failed", problem=f"{robot} is not in the report")
    steps = host.get("steps") or []
    outcome = str(host.get("outcome"))
    problem = "" if outcome == "updated" else f"{outcome}: {host.get('reason') or host.get('failed_task') or ''}"
    if len(steps) != 1:
        problem = problem or f"the run made {len(steps)} steps, not one"
        return Step(run, run, None, outcome=outcome, problem=problem)
    phases = {str(name): float(seconds) for name, seconds in (steps[0].get("phases") or {}).items()}
    seconds = sum(phases.values())
    started = steps[0].get("started")
    begin = float(started) if started is not None else run.end - seconds
    return Step(
        run=run,
        span=Span(begin, begin + seconds),
        seconds=seconds,
        busy_wait=float(steps[0].get("busy_wait") or 0.0),
        phases=phases,
        outcome=outcome,
        problem=problem,
    )
