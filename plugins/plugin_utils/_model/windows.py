# SPDX-License-Identifier: GPL-3.0-or-later
"""Windows of time in which a robot may be changed, by the clock where it works. Pure."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import date, datetime, time, timedelta
from typing import TypedDict
from zoneinfo import ZoneInfo

DAYS = ("mon", "tue", "wed", "thu", "fri", "sat", "sun")
AHEAD = 15  # days: in one week a window may fall into the hour that a zone's clock leaves out


# an item of update_windows; hours and minutes
Span = TypedDict("Span", {"days": Sequence[str], "from": str, "to": str}, total=False)


@dataclass(frozen=True)
class Windows:
    """`zone` is a name of the IANA time zone database.

    A span begins on its days (on all without any) at `from`, and ends at `to`, on the day after where that is not
    later. Without spans the robot may be changed at any time.
    """

    spans: tuple[Span, ...] = ()
    zone: str = "UTC"

    def __bool__(self) -> bool:
        """Whether there is a time in which the robot may not be changed."""
        return bool(self.spans)

    def opens_at(self, wall: float) -> float:
        """When the robot may be changed, `wall` or later; both in seconds since 1970."""
        if not self.spans:
            return wall
        zone = ZoneInfo(self.zone)
        today = datetime.fromtimestamp(wall, zone).date()
        days = [today + timedelta(days=number) for number in range(-1, AHEAD)]
        found = [
            _seconds(span, day, zone)
            for span in self.spans
            for day in days
            if not span.get("days") or DAYS[day.weekday()] in span["days"]
        ]
        return min(max(start, wall) for start, end in found if start < end and wall < end)

    def told(self, opens: float) -> str:
        """This moment in words."""
        return f"{datetime.fromtimestamp(opens, ZoneInfo(self.zone)):%Y-%m-%d %H:%M} ({self.zone})"


ALWAYS = Windows()


def _seconds(span: Span, day: date, zone: ZoneInfo) -> tuple[float, float]:
    """Its start and its end; where the zone's clock is turned the end may come first."""
    start, end = (timedelta(hours=int(text[:2]), minutes=int(text[3:])) for text in (span["from"], span["to"]))
    end += timedelta(days=end <= start)
    midnight = datetime.combine(day, time(), zone)  # what is added to it counts by the clock
    return (midnight + start).timestamp(), (midnight + end).timestamp()
