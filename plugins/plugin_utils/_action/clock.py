# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""The clocks of the control node."""

from __future__ import annotations

import time


class MonotonicClock:
    """Seconds since 1970, and a clock that nobody sets."""

    def wall(self) -> float:
        return time.time()

    def now(self) -> float:
        return time.monotonic()

    def sleep(self, seconds: float) -> None:
        time.sleep(seconds)
