# SPDX-License-Identifier: GPL-3.0-or-later
"""The running statistics against the standard library's."""

from __future__ import annotations

import random
import statistics

import pytest
from rosops_apps.stats import RunningStats


def filled(values: list[float], window: int = 500) -> RunningStats:
    stats = RunningStats(window)
    for value in values:
        stats.add(value)
    return stats


@pytest.mark.parametrize("offset", [0.0, 21.0, 1e9])
def test_against_the_standard_library(offset: float) -> None:
    source = random.Random(1)  # noqa: S311 - no secret
    values = [offset + source.gauss(0, 2) for _number in range(5000)]
    stats = filled(values)
    assert (stats.count, stats.minimum, stats.maximum) == (5000, min(values), max(values))
    assert stats.average == pytest.approx(statistics.fmean(values))
    assert stats.standard_deviation == pytest.approx(statistics.stdev(values), rel=1e-6)
    assert stats.moving_average == pytest.approx(statistics.fmean(values[-500:]))


def test_few_values() -> None:
    assert filled([4.0]).report() == {
        "count": 1, "minimum": 4.0, "maximum": 4.0, "average": 4.0, "standard_deviation": 0.0, "moving_average": 4.0,
    }  # fmt: skip
    assert filled([1.0, 2.0, 3.0, 10.0], window=2).moving_average == 6.5
