# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Running statistics of a stream of numbers. No ROS."""

from __future__ import annotations

import math
from collections import deque
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from typing_extensions import Self


class RunningStats:
    """Minimum, maximum, average and standard deviation by Welford's method, and the average of the last `window`."""

    def __init__(self, window: int) -> None:
        if window < 1:
            raise ValueError(f"the window must hold at least one value, not {window}")
        self.count = 0
        self.minimum = math.inf
        self.maximum = -math.inf
        self.average = 0.0
        self._squares = 0.0
        self._window: deque[float] = deque(maxlen=window)

    def add(self, value: float) -> None:
        """Take one value in."""
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
        return math.fsum(self._window) / len(self._window) if self._window else 0.0

    def report(self) -> dict[str, Any]:
        """The figures by name; without values only the count."""
        if not self.count:
            return {"count": 0}
        return {
            "count": self.count,
            "minimum": self.minimum,
            "maximum": self.maximum,
            "average": self.average,
            "standard_deviation": self.standard_deviation,
            "moving_average": self.moving_average,
        }

    @classmethod
    def resume(cls, report: dict[str, Any], window: int) -> Self:
        """Go on from a report; only the moving average starts anew. A report that does not fit is a ValueError."""
        stats = cls(window)
        if not report.get("count"):
            return stats
        try:
            stats.count = int(report["count"])
            stats.minimum = float(report["minimum"])
            stats.maximum = float(report["maximum"])
            stats.average = float(report["average"])
            stats._squares = float(report["standard_deviation"]) ** 2 * (stats.count - 1)
        except (KeyError, TypeError) as error:
            raise ValueError(f"cannot go on from {report!r}: {error}") from error
        return stats
