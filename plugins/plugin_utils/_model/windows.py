# SPDX-License-Identifier: GPL-3.0-or-later
"""Windows of time by the database of time zones, which the control node has. Pure."""

from __future__ import annotations

import functools
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from zoneinfo import ZoneInfo

from ...module_utils._step import windows
from ...module_utils._step.windows import Turn

# For which the keeper is told a zone's turns: the same ones on every day, so that no run changes them.
YEARS, DAY, MINUTE = (2025, 2051), 86400, 60


@dataclass(frozen=True)
class Windows(windows.Windows):
    """Those of the inventory."""

    @property
    def offsets(self) -> tuple[Turn, ...]:
        return _turns(self.zone)

    @property
    def kept(self) -> dict[str, object]:
        """As the keeper reads them."""
        return {"spans": self.spans, "zone": self.zone, "turns": self.offsets if self.spans else ()}


ALWAYS = Windows()


@functools.cache
def _turns(zone: str) -> tuple[Turn, ...]:
    clock, (begin, end) = ZoneInfo(zone), (int(datetime(year, 1, 1, tzinfo=UTC).timestamp()) for year in YEARS)

    def offset(wall: int) -> float:
        return (datetime.fromtimestamp(wall, clock).utcoffset() or timedelta()).total_seconds()

    found: list[Turn] = [(begin, offset(begin))]
    for day in range(begin, end, DAY):
        if offset(day + DAY) != found[-1][1]:
            turn = next(wall for wall in range(day, day + DAY + 1, MINUTE) if offset(wall) != found[-1][1])
            found.append((turn, offset(turn)))
    return tuple(found)
