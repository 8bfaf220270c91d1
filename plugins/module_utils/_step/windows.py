# SPDX-License-Identifier: GPL-3.0-or-later
"""Windows of time in which a robot may be changed, by the clock where it works. Pure.

Pods have no database of time zones, so what is kept for the keeper has the turns of the zone's clock.
"""

from __future__ import annotations

from dataclasses import dataclass
from datetime import date, datetime, time, timedelta, tzinfo
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
    def clock(self) -> tzinfo:
        return Clock(self.turns)

    def opens_at(self, wall: float) -> float:
        """When the robot may be changed, `wall` or later; both in seconds since 1970."""
        if not self.spans:
            return wall
        zone = self.clock
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
        return f"{datetime.fromtimestamp(opens, self.clock):%Y-%m-%d %H:%M} ({self.zone})"


class Clock(tzinfo):
    """Of a zone, by its turns. An hour that it shows twice is the first one, as zoneinfo has it."""

    def __init__(self, turns: Sequence[Turn]) -> None:
        self.turns = turns or ((0.0, 0.0),)

    def utcoffset(self, dt: datetime | None) -> timedelta:
        local = ((dt or EPOCH).replace(tzinfo=None) - EPOCH).total_seconds()
        later = [
            now
            for (_since, before), (since, now) in zip(self.turns, self.turns[1:])
            if local >= since + max(before, now)
        ]
        return timedelta(seconds=[self.turns[0][1], *later][-1])

    def fromutc(self, dt: datetime) -> datetime:
        seconds = (dt.replace(tzinfo=None) - EPOCH).total_seconds()
        past = [now for since, now in self.turns if since <= seconds]
        return dt + timedelta(seconds=[self.turns[0][1], *past][-1])

    def dst(self, _at: datetime | None) -> None:
        """It is not told."""

    def tzname(self, _at: datetime | None) -> None:
        """The same."""


def _seconds(span: Span, day: date, zone: tzinfo) -> tuple[float, float]:
    """Its start and its end; where the zone's clock is turned the end may come first."""
    start, end = (timedelta(hours=int(text[:2]), minutes=int(text[3:])) for text in (span["from"], span["to"]))
    end += timedelta(days=end <= start)
    midnight = datetime.combine(day, time(), zone)  # what is added to it counts by the clock
    return (midnight + start).timestamp(), (midnight + end).timestamp()
