# SPDX-License-Identifier: GPL-3.0-or-later
"""The finished trials, a line of JSON each, in the repository: what docs/benchmarks.md is made of.

A run goes on where the one before was cut off: what is there is not measured again.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from lab_environment import CHECKOUT

from .measure import Measured
from .order import rounds
from .records import Record
from .scenario import of_arm

TRIALS = CHECKOUT / "benchmarks" / "update" / "results" / "trials.jsonl"
NOT_KEPT = ("lost_ranges",)  # as long as the loss is great; a run's own directory has it
Which = tuple[bool, int, str]  # under stress, trial, arm


@dataclass(frozen=True)
class Trial:
    """One round of an arm with what it was measured on: a case of a trial. Rounds of before had all of its cases."""

    arm: str
    stress: bool
    trial: int
    about: Mapping[str, Any]
    measured: Sequence[Measured]

    @property
    def which(self) -> Which:
        return (self.stress, self.trial, self.arm)

    def as_line(self) -> str:
        cases = [
            {"record": item.record, "details": {key: item.details[key] for key in item.details if key not in NOT_KEPT}}
            for item in self.measured
        ]
        whole = {"arm": self.arm, "stress": self.stress, "trial": self.trial, "about": dict(self.about), "cases": cases}
        return json.dumps(whole, separators=(",", ":"), sort_keys=True)

    @classmethod
    def from_line(cls, line: str) -> Trial:
        found = json.loads(line)
        measured = [Measured(item["record"], item["details"]) for item in found["cases"]]
        return cls(found["arm"], found["stress"], found["trial"], found["about"], measured)


class Trials:
    """The file of them. A last line that was cut off is no trial, and is taken away by the next one."""

    def __init__(self, path: Path = TRIALS) -> None:
        self.path = path
        self.all = list(_whole(path.read_text(encoding="utf-8"))) if path.exists() else []

    def add(self, trial: Trial) -> None:
        """Written the moment it is known, whole or not at all."""
        self.all.append(trial)
        self.path.parent.mkdir(parents=True, exist_ok=True)
        new = self.path.with_suffix(".new")
        new.write_text("".join(f"{one.as_line()}\n" for one in self.all), encoding="utf-8")
        new.replace(self.path)

    @property
    def records(self) -> list[Record]:
        """Of all trials."""
        return [item.record for trial in self.all for item in trial.measured]

    @property
    def details(self) -> list[dict[str, Any]]:
        """Of all trials, in the same order."""
        return [item.details for trial in self.all for item in trial.measured]

    def missing(self, trials: int, arms: Sequence[str], stress: str, cases: Iterable[str]) -> list[tuple[Which, str]]:
        """What is still to be measured, in the order of the rounds: which one, and the name of its case."""
        there = {
            (*trial.which, f"{item.record['app']}/{item.record['update']}")
            for trial in self.all
            for item in trial.measured
        }
        wanted = rounds(trials, arms, stress, list(cases))
        return [(one[:3], one[3]) for one in wanted if one not in there and of_arm(one[2], one[3])]


def _whole(text: str) -> Iterable[Trial]:
    for line in text.splitlines():
        try:
            yield Trial.from_line(line)
        except ValueError:
            continue
