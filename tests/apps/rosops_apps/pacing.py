# SPDX-License-Identifier: GPL-3.0-or-later
"""When the next sample of a sensor is due, and what the sensor reads then. No ROS, no clock of its own."""

from __future__ import annotations

import math

# How much faster or slower than nominal the pace may run to follow a clock that was set: the promised rate holds.
SLEW = 0.01


class SampleClock:
    """Numbers samples by the wall clock (number = time x rate) but runs on the monotonic clock.

    The wall clock makes two publishers on one robot agree on a sample's number without talking to each other.
    The monotonic clock makes the pace steady: a wall clock that is stepped changes neither rate nor order, the
    numbers move back to it at most `SLEW` of the time that passes.
    """

    def __init__(self, rate: float, wall: float, monotonic: float) -> None:
        self.rate = rate
        self._offset = wall - monotonic
        self._followed = monotonic

    def follow(self, wall: float, monotonic: float) -> float:
        """Move towards the wall clock; returns how far away it was, in seconds."""
        away = (wall - monotonic) - self._offset
        most = SLEW * max(0.0, monotonic - self._followed)
        self._offset += max(-most, min(most, away))
        self._followed = monotonic
        return away

    def number(self, monotonic: float) -> int:
        """The last sample that is due."""
        return math.floor((monotonic + self._offset) * self.rate)

    def due(self, number: int) -> float:
        """The monotonic time at which the sample is due."""
        return number / self.rate - self._offset


def pending(last: int, current: int, most: int) -> tuple[range, int]:
    """Samples to send now, and how many are given up.

    After a short stall every sample that fell due is sent, no more. A backlog above `most` would push out what
    is still in the queues, so its oldest part is given up and counted.
    """
    first = max(last + 1, current - most + 1)
    return range(first, max(current, last) + 1), max(0, min(first, current + 1) - last - 1)


def celsius(number: int, rate: float) -> float:
    """The simulated sensor: a slow wave and a small ripple, a function of the sample's number alone."""
    seconds = number / rate
    ripple = ((number * 2654435761) & 0xFFFF) / 0xFFFF - 0.5
    return 21.0 + 4.0 * math.sin(seconds * math.tau / 60.0) + 0.2 * ripple
