# SPDX-License-Identifier: GPL-3.0-or-later
"""Windows of time in which a robot may be changed, by the clock where it works. Pure.

Pods have no database of time zones, so what is kept for the keeper has the turns of the zone's clock.
"""

from __future__ import annotations

from dataclasses import dataclass
from datetime import date, datetime, time, timedelta
from typing import Sequence, Tuple, TypedDict

DAYS = ("mon", "tue", "wed", "thu", "fri", "sat", "sun")
AHEAD = 15  # days: in one week a window may fall into the hour that a zone's clock leaves out
EPOCH = datetime(1970, 1, 1)


# an item of update_windows; hours and minutes
Span = TypedDict("Span", {"days": Sequence[str], "from": str, "to": str}, total=False)
Turn = Tuple[float, float]  # since when (seconds since 1970) a zone's clock is how many seconds before UTC's


@dataclass(frozen=True)
class Windows:
    """`zone` is a name of the IANA time zone database, `turns` are those of its clock; without any it is UTC.

    A span begins on its days (on all without any) at `from`, and ends at `to`, on the day after where that is not
    later. Without spans the robot may be changed at any time.
    """

    spans: tuple[Span, ...] = ()
    zone: str = "UTC"
    turns: tuple[Turn, ...] = ()

    def __bool__(self) -> bool:
        """Whether there is a time in which the robot may not be changed."""
        return bool(self.spans)

    @property
    def offsets(self) -> tuple[Turn, ...]:
        """The turns of the zone's clock."""
        return self.turns or ((0.0, 0.0),)

    def opens_at(self, wall: float) -> float:
        """When the robot may be changed, `wall` or later; both in seconds since 1970."""
        today = self._shown(wall).date()
        days = [today + timedelta(days=number) for number in range(-1, AHEAD)]
        found = [
            self._seconds(span, day)
            for span in self.spans
            for day in days
            if not span.get("days") or DAYS[day.weekday()] in span["days"]
        ]
        return min((max(start, wall) for start, end in found if start < end and wall < end), default=wall)

    def told(self, opens: float) -> str:
        """This moment in words."""
        return f"{self._shown(opens):%Y-%m-%d %H:%M} ({self.zone})"

    def _shown(self, wall: float) -> datetime:
        """What the clock shows then."""
        past = [now for since, now in self.offsets if since <= wall]
        return EPOCH + timedelta(seconds=wall + (past or [self.offsets[0][1]])[-1])

    def _seconds(self, span: Span, day: date) -> tuple[float, float]:
        """Its start and its end; where the clock is turned the end may come first."""
        start, end = (timedelta(hours=int(text[:2]), minutes=int(text[3:])) for text in (span["from"], span["to"]))
        midnight = datetime.combine(day, time()) - EPOCH
        return self._since(midnight + start), self._since(midnight + end + timedelta(days=end <= start))

    def _since(self, shown: timedelta) -> float:
        """When the clock shows that; what it shows twice is the first one."""
        local, turns = shown.total_seconds(), self.offsets
        later = [now for (_since, before), (since, now) in zip(turns, turns[1:]) if local >= since + max(before, now)]
        return local - [turns[0][1], *later][-1]
