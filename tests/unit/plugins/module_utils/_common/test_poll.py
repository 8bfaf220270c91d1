# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
from __future__ import annotations

import pytest
from ansible_collections.rosops.fleet.plugins.module_utils._common.poll import (
    FAIL,
    PASS,
    WAIT,
    Polled,
    Seen,
    overall,
    poll,
)


class Clock:
    """A clock that only sleeping and looking move."""

    def __init__(self, look_seconds: float = 0.0) -> None:
        self.time = 1000.0
        self.look_seconds = look_seconds
        self.naps: list[float] = []
        self.starts: list[float] = []

    def now(self) -> float:
        return self.time

    def sleep(self, seconds: float) -> None:
        assert seconds > 0
        self.naps.append(seconds)
        self.time += seconds

    def run(
        self, verdicts: list[str], timeout: float, interval: float, consecutive: int = 1, stable: float = 0.0
    ) -> Polled:
        def probe() -> Seen:
            self.starts.append(self.time - 1000.0)
            self.time += self.look_seconds
            index = min(len(self.starts), len(verdicts)) - 1
            return Seen(verdicts[index], f"look {len(self.starts)}")

        return poll(probe, timeout, interval, consecutive, self.now, self.sleep, stable)


def test_a_first_pass_returns_without_sleeping() -> None:
    clock = Clock()
    result = clock.run([PASS], timeout=60, interval=0.5)
    assert (result.verdict, result.last, result.looks, result.timed_out) == (PASS, "look 1", 1, False)
    assert clock.naps == []


def test_looks_start_one_interval_apart_whatever_a_look_takes() -> None:
    clock = Clock(look_seconds=0.2)
    result = clock.run([WAIT, WAIT, WAIT, PASS], timeout=60, interval=0.5)
    assert clock.starts == pytest.approx([0, 0.5, 1.0, 1.5])
    assert clock.naps == pytest.approx([0.3, 0.3, 0.3])
    assert result.elapsed == pytest.approx(1.7)


def test_a_look_longer_than_the_interval_is_followed_at_once() -> None:
    clock = Clock(look_seconds=2.0)
    clock.run([WAIT, WAIT, PASS], timeout=60, interval=0.5)
    assert clock.naps == []
    assert clock.starts == pytest.approx([0, 2, 4])


def test_fail_ends_the_poll_at_once() -> None:
    result = Clock().run([WAIT, FAIL, PASS], timeout=60, interval=1)
    assert (result.verdict, result.last, result.looks) == (FAIL, "look 2", 2)


def test_the_time_out_carries_the_last_observation_and_looks_once_more_at_the_end() -> None:
    clock = Clock()
    result = clock.run([WAIT], timeout=1.2, interval=0.5)
    assert clock.starts == pytest.approx([0, 0.5, 1.0, 1.2])
    assert (result.verdict, result.last, result.timed_out) == (WAIT, "look 4", True)
    assert result.elapsed == pytest.approx(1.2)


def test_what_comes_true_just_before_the_end_still_passes() -> None:
    result = Clock().run([WAIT, WAIT, WAIT, PASS], timeout=1.2, interval=0.5)
    assert result.verdict == PASS


def test_no_time_at_all_is_exactly_one_look() -> None:
    clock = Clock()
    result = clock.run([WAIT], timeout=0, interval=0.5)
    assert (result.looks, result.verdict, clock.naps) == (1, WAIT, [])


def test_passes_in_a_row_start_over_after_a_look_that_did_not_pass() -> None:
    clock = Clock()
    result = clock.run([PASS, PASS, WAIT, PASS, PASS, PASS], timeout=60, interval=1, consecutive=3)
    assert (result.verdict, result.looks, result.passes) == (PASS, 6, 3)


def test_too_few_passes_in_a_row_time_out() -> None:
    result = Clock().run([PASS], timeout=1, interval=1, consecutive=3)
    assert (result.verdict, result.passes, result.timed_out) == (WAIT, 2, True)


def test_stable_looks_on_until_it_has_held_for_so_long() -> None:
    clock = Clock()
    result = clock.run([WAIT, PASS], timeout=60, interval=0.5, stable=1.2)
    assert clock.starts == pytest.approx([0, 0.5, 1.0, 1.5, 1.7])  # the last one just at the end
    assert (result.verdict, result.looks, result.passes) == (PASS, 5, 4)
    assert (result.held, result.elapsed) == (pytest.approx(1.2), pytest.approx(1.7))


def test_one_look_that_does_not_pass_starts_the_stable_time_over() -> None:
    clock = Clock()
    result = clock.run([PASS, PASS, WAIT, PASS], timeout=60, interval=1, stable=2)
    assert clock.starts == pytest.approx([0, 1, 2, 3, 4, 5])
    assert (result.verdict, result.held) == (PASS, pytest.approx(2))


def test_the_stable_time_counts_from_the_start_of_the_first_look_to_the_end_of_the_last() -> None:
    clock = Clock(look_seconds=1.0)
    result = clock.run([PASS], timeout=60, interval=0.5, stable=2)
    assert (result.looks, result.elapsed, result.held) == (2, pytest.approx(2), pytest.approx(2))


def test_a_time_out_before_the_stable_time_is_over() -> None:
    result = Clock().run([WAIT, WAIT, PASS], timeout=3, interval=1, stable=5)
    assert (result.verdict, result.timed_out, result.passes) == (WAIT, True, 2)
    assert result.held == pytest.approx(1)
    assert Clock().run([PASS, WAIT], timeout=1, interval=1, stable=5).held == 0


def test_stable_and_consecutive_both_have_to_be_reached() -> None:
    assert Clock().run([PASS], timeout=60, interval=1, consecutive=4, stable=1).looks == 4
    assert Clock().run([PASS], timeout=60, interval=1, consecutive=2, stable=3).looks == 4


def test_a_failure_ends_the_stable_time_at_once() -> None:
    result = Clock().run([PASS, FAIL], timeout=60, interval=1, stable=10)
    assert (result.verdict, result.looks, result.held) == (FAIL, 2, 0)


@pytest.mark.parametrize(
    ("verdicts", "expected"),
    [
        ([], PASS),
        ([PASS, PASS], PASS),
        ([PASS, WAIT], WAIT),
        ([WAIT, FAIL, PASS], FAIL),
    ],
)
def test_overall(verdicts: list[str], expected: str) -> None:
    assert overall(verdicts) == expected
