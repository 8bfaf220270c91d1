# SPDX-License-Identifier: GPL-3.0-or-later
"""Running statistics of a stream of numbers. No ROS."""

from __future__ import annotations

import math
import statistics
from collections import deque
from typing import Any

try:  # the dependency that the major version's image brings
    import numpy

    ENGINE, mean = f"numpy {numpy.__version__}", numpy.mean
except ImportError:
    ENGINE, mean = "python", statistics.fmean


class RunningStats:
    """Minimum, maximum, average and standard deviation by Welford's method, and the average of the last `window`."""

    def __init__(self, window: int) -> None:
        self.count = 0
        self.minimum = math.inf
        self.maximum = -math.inf
        self.average = 0.0
        self._squares = 0.0
        self._window: deque[float] = deque(maxlen=window)

    def add(self, value: float) -> None:
        self.count += 1
        delta = value - self.average
        self.average += delta / self.count
        self._squares += delta * (value - self.average)
        self.minimum = min(self.minimum, value)
        self.maximum = max(self.maximum, value)
        self._window.append(value)

    @property
    def standard_deviation(self) -> float:
        """Of the sample (n - 1); 0 for fewer than two values."""
        return math.sqrt(self._squares / (self.count - 1)) if self.count > 1 else 0.0

    @property
    def moving_average(self) -> float:
        """Of the last values, summed afresh: a sum carried along would drift over days."""
        return float(mean(self._window))

    def report(self) -> dict[str, Any]:
        """The figures by name, once there is a value."""
        return {
            "count": self.count,
            "minimum": self.minimum,
            "maximum": self.maximum,
            "average": self.average,
            "standard_deviation": self.standard_deviation,
            "moving_average": self.moving_average,
        }
