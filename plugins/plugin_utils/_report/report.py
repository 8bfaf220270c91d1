# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""The report of a run: as a file (the callback's documentation has its keys), and as lines of the screen. Pure."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from .._model.keys import plain
from .._model.outcomes import UNCHANGED, UPDATED
from .._update.outcome import RobotOutcome
from .host_run import note_of
from .results import Ready, Rollout
from .text import table

# In check mode nothing was changed, so the screen says it in the conditional; the file keeps the words of outcomes.
WOULD = {UPDATED: "would change", UNCHANGED: "would not change"}
HEADERS = ("host", "outcome", "ros graph", "changed", "note")
STAGES_SHOWN = 6

Api = Mapping[str, str]  # of a cluster: its `host`, and the `source` of the access


@dataclass(frozen=True)
class Spent:
    """How long a play or a stage took, in seconds."""

    name: str
    seconds: float


@dataclass(frozen=True)
class TaskReport:
    """`hosts` and `changed` are how many."""

    name: str
    action: str
    play: str
    stage: str
    seconds: float
    hosts: int
    changed: int


@dataclass(frozen=True)
class HostReport:
    """`changed` are names of tasks, `counts` Ansible's own."""

    host: str
    groups: tuple[str, ...]
    outcome: RobotOutcome
    failed_task: str
    changed: tuple[str, ...]
    ready: Ready | None
    rollout: Rollout | None
    counts: Mapping[str, int]

    def as_dict(self) -> dict[str, Any]:
        return {
            "host": self.host,
            "groups": list(self.groups),
            **self.outcome.as_dict(),
            "failed_task": self.failed_task or None,
            "changed": list(self.changed),
            "ready": plain(self.ready),
            "rollout": plain(self.rollout),
            "counts": dict(self.counts),
        }

    @property
    def note(self) -> str:
        return note_of(self.outcome.reason, self.failed_task)

    @property
    def graph(self) -> str:
        """The last verdict on the ROS graph, in words."""
        if self.ready is None:
            return ""
        return self.ready.verdict + ("" if self.ready.elapsed is None else f" {self.ready.elapsed:.1f} s")


@dataclass(frozen=True)
class Report:
    """Times are in seconds, but for `started`, which is in UTC; `outcomes` are how many of each, `tasks` how many."""

    playbook: str
    check_mode: bool
    started: str
    elapsed: float
    outcomes: Mapping[str, int]
    hosts: tuple[HostReport, ...]
    plays: tuple[Spent, ...]
    stages: tuple[Spent, ...]
    slowest_tasks: tuple[TaskReport, ...]
    tasks: int
    apis: Mapping[str, Api]

    def as_dict(self) -> dict[str, Any]:
        """As it is written."""
        return {**plain(self), "hosts": [host.as_dict() for host in self.hosts]}


def word_of(outcome: str, check_mode: bool) -> str:
    return WOULD.get(outcome, outcome) if check_mode else outcome


def screen(report: Report, width: int = 120) -> list[str]:
    """The report in lines: a host each, then where the time went."""
    rows = [
        (
            host.host,
            word_of(host.outcome.outcome, report.check_mode),
            host.graph,
            host.counts.get("changed", 0),
            host.note,
        )
        for host in report.hosts
    ]
    lines = table(HEADERS, rows, width, wrapped=True) if rows else ["no host took part"]
    slow = sorted(report.stages, key=lambda stage: stage.seconds, reverse=True)[:STAGES_SHOWN]
    spent = ", ".join(f"{stage.name} {stage.seconds:.1f} s" for stage in slow if stage.seconds >= 0.1)
    return [*lines, f"{report.elapsed:.1f} s" + (f": {spent}" if spent else "")]
