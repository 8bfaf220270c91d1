# SPDX-License-Identifier: GPL-3.0-or-later
"""What is missing: of numbered lines, and of samples that come at an interval. Pure."""

from __future__ import annotations

import itertools
import re
from collections.abc import Iterable, Mapping, Sequence
from typing import NamedTuple

NUMBERED = re.compile(r"run=(?P<run>[0-9.]+) number=(?P<number>[0-9]+)")


class Numbers(NamedTuple):
    """Of one run of the counting app."""

    first: int
    last: int
    missing: int
    twice: int


def numbers(lines: Iterable[str]) -> dict[str, Numbers]:
    """Run -> what came of its numbers.

    >>> numbers([*(f"run=1.5 number={number}" for number in (3, 4, 4, 7)), "run=2.5 number=1", "other"])
    {'1.5': Numbers(first=3, last=7, missing=2, twice=1), '2.5': Numbers(first=1, last=1, missing=0, twice=0)}
    """
    runs: dict[str, list[int]] = {}
    for line in lines:
        found = NUMBERED.search(line)
        if found:
            runs.setdefault(found["run"], []).append(int(found["number"]))
    return {
        run: Numbers(min(got), max(got), max(got) - min(got) + 1 - len(set(got)), len(got) - len(set(got)))
        for run, got in runs.items()
    }


class Hole(NamedTuple):
    """A time without samples."""

    begin: float
    end: float

    @property
    def seconds(self) -> float:
        return self.end - self.begin


def holes(times: Sequence[float], interval: float, begin: float, end: float) -> list[Hole]:
    """Where two samples are more than one and a half intervals apart, the ends of the time counted as samples.

    >>> holes([10, 20, 30, 60], 10, 5, 80), holes([], 10, 0, 50)
    ([Hole(begin=30, end=60), Hole(begin=60, end=80)], [Hole(begin=0, end=50)])
    >>> holes([10, 20, 30, 40], 10, 10, 45)
    []
    """
    marks = [begin, *(time for time in sorted(times) if begin <= time <= end), end]
    pairs = itertools.pairwise(marks)
    return [Hole(one, other) for one, other in pairs if other - one > 1.5 * interval]


def missed(found: Iterable[Hole], interval: float) -> int:
    """How many samples the holes would have held.

    >>> missed([Hole(30, 60), Hole(70, 100)], 10), missed([], 10)
    (4, 0)
    """
    return sum(max(0, round(hole.seconds / interval) - 1) for hole in found)


def times(series: Mapping[str, Sequence[Sequence[object]]]) -> list[float]:
    """Of a series' samples."""
    return [float(str(time)) for time, _value in series["values"]]
