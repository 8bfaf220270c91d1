# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""The same statistics with numpy, the dependency that the major version brings. No ROS."""

from __future__ import annotations

from typing import Any

import numpy as np

from .stats import RunningStats

ENGINE = f"numpy {np.__version__}"


class BatchStats(RunningStats):
    """Collects values and works them in when a report is asked for."""

    def __init__(self, window: int) -> None:
        super().__init__(window)
        self._batch: list[float] = []

    def add(self, value: float) -> None:
        """Take one value in."""
        self._batch.append(value)

    def _fold(self) -> None:
        """Average and squares of two sets joined, by Chan's formulas."""
        if not self._batch:
            return
        values = np.asarray(self._batch)
        self._batch = []
        count = self.count + values.size
        average = float(values.mean())
        delta = average - self.average
        self._squares += float(((values - average) ** 2).sum()) + delta**2 * self.count * values.size / count
        self.average += delta * values.size / count
        self.count = count
        self.minimum = min(self.minimum, float(values.min()))
        self.maximum = max(self.maximum, float(values.max()))
        self._window.extend(values[-(self._window.maxlen or 1) :].tolist())

    def report(self) -> dict[str, Any]:
        """The figures by name; without values only the count."""
        self._fold()
        return super().report()
