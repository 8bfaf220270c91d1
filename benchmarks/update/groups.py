# SPDX-License-Identifier: GPL-3.0-or-later
"""Records of the same update, arm and stress, taken together. Pure."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

from .records import Record


@dataclass(frozen=True)
class Group:
    """All trials of one update by one arm under one condition."""

    app: str
    update: str
    arm: str
    stress: bool
    records: tuple[Record, ...]

    @property
    def case(self) -> str:
        """The case's name."""
        return f"{self.app}/{self.update}"

    def values(self, key: str) -> list[float]:
        """What is known of a figure."""
        return [record[key] for record in self.records if record[key] is not None]

    def mean(self, key: str) -> float | None:
        """Mean of what is known."""
        known = self.values(key)
        return sum(known) / len(known) if known else None

    def ended(self) -> str:
        """How many of its updates came to their end."""
        return f"{len(self.values('step_s'))} of {len(self.records)}"

    def worst(self, key: str) -> float | None:
        """The greatest of what is known."""
        return max(self.values(key), default=None)

    def total(self, *keys: str) -> float | None:
        """Sum over all trials and keys; None where a trial is without one of them, for then nothing is proven."""
        found = [record[key] for record in self.records for key in keys]
        return None if not found or None in found else sum(found)

    def ratio(self, later: str, earlier: str) -> float | None:
        """Mean of one figure by the mean of another one."""
        above, below = self.mean(later), self.mean(earlier)
        return above / below if above is not None and below else None

    def step_seconds(self) -> float | None:
        """Mean wall time of the step without the time that a busy robot was waited for."""
        known = [
            record["step_s"] - (record["busy_wait_s"] or 0.0) for record in self.records if record["step_s"] is not None
        ]
        return sum(known) / len(known) if known else None


def groups(records: Iterable[Record]) -> list[Group]:
    """In the order in which the updates were first made; calm before stress, plain before the fleet's."""
    found: dict[tuple[Any, ...], list[Record]] = {}
    for record in records:
        found.setdefault(tuple(record[key] for key in ("app", "update", "stress", "arm")), []).append(record)
    places = {case: number for number, case in enumerate(dict.fromkeys(key[:2] for key in found))}
    ordered = sorted(found, key=lambda key: (places[key[:2]], key[2], key[3] != "plain", key[3]))
    return [
        Group(app, update, arm, stress, tuple(found[app, update, stress, arm])) for app, update, stress, arm in ordered
    ]


def by_arm(every: Iterable[Group]) -> Mapping[tuple[str, bool], Mapping[str, Group]]:
    """(case, stress) -> arm -> its group."""
    found: dict[tuple[str, bool], dict[str, Group]] = {}
    for group in every:
        found.setdefault((group.case, group.stress), {})[group.arm] = group
    return found
