# SPDX-License-Identifier: GPL-3.0-or-later
"""The sensor's pace and its numbers."""

from __future__ import annotations

import itertools

import pytest
from rosops_apps.pacing import SLEW, SampleClock, celsius, pending


def run(clock: SampleClock, start: float, seconds: float, wake: float) -> list[int]:
    """Numbers published by a loop that wakes every `wake` seconds at the earliest."""
    sent: list[int] = []
    now = start
    last = clock.number(start)
    while now < start + seconds:
        now = max(now + wake, clock.due(last + 1))
        numbers, given_up = pending(last, clock.number(now), 500)
        assert given_up == 0
        sent += numbers
        last = sent[-1]
    return sent


def test_numbers_are_wall_time_times_rate() -> None:
    clock = SampleClock(500, wall=1_000_000.001, monotonic=7.0)
    assert clock.number(7.0) == 500_000_000
    assert clock.number(8.0) == 500_000_500
    assert clock.due(500_000_500) == pytest.approx(7.999)


@pytest.mark.parametrize("wake", [0.0001, 0.0015, 0.0123])
def test_long_run_rate_is_exact_and_no_number_is_left_out(wake: float) -> None:
    sent = run(SampleClock(500, wall=1e9, monotonic=0.0), start=0.0, seconds=60, wake=wake)
    assert sent == list(range(sent[0], sent[0] + len(sent)))
    assert len(sent) == pytest.approx(30_000, rel=0.001)


def test_two_publishers_on_one_robot_agree() -> None:
    old = SampleClock(500, wall=1e9, monotonic=0.0)
    new = SampleClock(500, wall=1e9 + 3600.0004, monotonic=3600.0004)
    assert abs(old.number(3601.0) - new.number(3601.0)) <= 1
    assert celsius(old.number(3601.0), 500) == celsius(old.number(3601.0), 500)


def test_drift_of_the_wall_clock_is_followed() -> None:
    clock = SampleClock(500, wall=1e9, monotonic=0.0)
    for second in range(1, 1001):
        away = clock.follow(1e9 + second * 1.0005, float(second))  # 500 ppm, the most that NTP slews
    assert away == pytest.approx(0.0005, abs=1e-4)
    assert clock.number(1000.0) == pytest.approx((1e9 + 1000.5) * 500, abs=1)


@pytest.mark.parametrize("step", [3600.0, -3600.0])
def test_a_clock_that_is_set_neither_breaks_the_order_nor_the_rate(step: float) -> None:
    clock = SampleClock(500, wall=1e9, monotonic=0.0)
    numbers = [clock.number(0.0)]
    for second in range(1, 61):
        assert clock.follow(1e9 + second + step, float(second)) * step > 0
        numbers.append(clock.number(float(second)))
    assert all(later > earlier for earlier, later in itertools.pairwise(numbers))
    assert (numbers[-1] - numbers[0]) / 60 == pytest.approx(500, rel=SLEW + 1e-3)


@pytest.mark.parametrize(
    ("last", "current", "numbers", "given_up"),
    [
        (10, 10, [], 0),
        (10, 9, [], 0),  # the pace slowed down after its time was looked at
        (10, 11, [11], 0),
        (10, 14, [11, 12, 13, 14], 0),
        (10, 15, [11, 12, 13, 14, 15], 0),
        (10, 16, [12, 13, 14, 15, 16], 1),
        (10, 1000, [996, 997, 998, 999, 1000], 985),
    ],
)
def test_pending(last: int, current: int, numbers: list[int], given_up: int) -> None:
    assert (list(pending(last, current, 5)[0]), pending(last, current, 5)[1]) == (numbers, given_up)


def test_readings_stay_in_the_sensor_s_range_and_differ() -> None:
    readings = [celsius(n, 500) for n in range(0, 30_000, 7)]
    assert 16.8 < min(readings) < 17.2
    assert 24.8 < max(readings) < 25.2
    assert len(set(readings)) > 4000
