# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""The running statistics against the standard library's."""

from __future__ import annotations

import json
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
    assert RunningStats(3).report() == {"count": 0}
    assert filled([4.0]).report() == {
        "count": 1, "minimum": 4.0, "maximum": 4.0, "average": 4.0, "standard_deviation": 0.0, "moving_average": 4.0,
    }  # fmt: skip
    assert filled([1.0, 2.0, 3.0, 10.0], window=2).moving_average == 6.5


@pytest.mark.parametrize("cut", [0, 1, 2, 700])
def test_resumed_from_a_line_of_its_own_log(cut: int) -> None:
    values = [float(n % 13) + 0.1 * n for n in range(1000)]
    stats = RunningStats.resume(json.loads(json.dumps(filled(values[:cut]).report())), 100)
    for value in values[cut:]:
        stats.add(value)
    whole = filled(values, 100)
    assert {name: pytest.approx(figure) for name, figure in whole.report().items()} == stats.report()


@pytest.mark.parametrize("report", [{"count": 3}, {"count": 3, "minimum": None}])
def test_a_report_that_does_not_fit(report: dict[str, object]) -> None:
    with pytest.raises(ValueError, match="cannot go on"):
        RunningStats.resume(report, 10)


def test_window() -> None:
    with pytest.raises(ValueError, match="window"):
        RunningStats(0)


def test_numpy_says_the_same() -> None:
    pytest.importorskip("numpy")
    from rosops_apps.stats_numpy import BatchStats  # noqa: PLC0415

    source = random.Random(2)  # noqa: S311 - no secret
    plain, batches = RunningStats(50), BatchStats(50)
    assert batches.report() == {"count": 0}
    for size in (1, 200, 0, 3, 700):
        for _number in range(size):
            value = source.gauss(21, 2)
            plain.add(value)
            batches.add(value)
        assert batches.report() == pytest.approx(plain.report(), rel=1e-9)
    resumed = BatchStats.resume(plain.report(), 50)
    plain.add(4.0)
    resumed.add(4.0)
    keys = ("count", "minimum", "maximum", "average", "standard_deviation")
    assert {key: resumed.report()[key] for key in keys} == pytest.approx({key: plain.report()[key] for key in keys})
