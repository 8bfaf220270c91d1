# SPDX-License-Identifier: GPL-3.0-or-later
"""Which samples arrived: duplicates, holes, and the exact ranges received. No ROS."""

from __future__ import annotations


class SequenceTracker:
    """Accepts every sequence number once.

    `after` is the last number that an earlier process of the same application has accounted for: everything up to
    it counts as a duplicate. Holes are remembered so that a late sample fills its own.
    """

    def __init__(self, after: int | None = None, remember: int = 100_000) -> None:
        self._floor = -1 if after is None else after
        self.first: int | None = None  # the lowest number received
        self.last: int | None = None  # and the highest
        self._holes: set[int] = set()
        self._remember = remember
        self._lost_for_good = 0
        self._ranges: list[list[int]] = []
        self.duplicates = 0

    @property
    def missing(self) -> int:
        """Numbers between the first and the last that have not come."""
        return self._lost_for_good + len(self._holes)

    def add(self, number: int) -> bool:
        """True if the sample is new."""
        if not self._is_new(number):
            self.duplicates += 1
            return False
        if self._ranges and self._ranges[-1][1] == number - 1:
            self._ranges[-1][1] = number
        else:
            self._ranges.append([number, number])
        return True

    def _is_new(self, number: int) -> bool:
        if number <= self._floor:
            return False
        if self.first is None or self.last is None:
            self.first = self.last = number
        elif number > self.last:
            self._open_holes(self.last + 1, number)
            self.last = number
        elif number < self.first:
            self._open_holes(number + 1, self.first)
            self.first = number
        elif number in self._holes:
            self._holes.remove(number)
        else:
            return False
        return True

    def _open_holes(self, start: int, stop: int) -> None:
        room = max(0, self._remember - len(self._holes))
        kept = max(start, stop - room)
        self._lost_for_good += kept - start
        self._holes.update(range(kept, stop))

    def take_ranges(self) -> list[list[int]]:
        """The ranges `[first, last]` accepted since the last call, sorted and joined."""
        taken, self._ranges = self._ranges, []
        return join_ranges(taken)


class StreamGaps:
    """Messages that a connection has left out, by the count that the publisher's library puts into each header.

    TCP loses nothing in between, so what is missing within one connection was dropped by a full queue at one of its
    ends. What is missing between two connections is not counted here: that is what an update may lose.
    """

    def __init__(self) -> None:
        self._streams: dict[str, tuple[object, int]] = {}
        self.dropped = 0

    def add(self, publisher: str, connection: object, count: int) -> None:
        """The header's count of a message; `connection` is the same object for all messages of one connection."""
        known, last = self._streams.get(publisher, (None, 0))
        if known is connection and count > last + 1:
            self.dropped += count - last - 1
        self._streams[publisher] = (connection, count)


def join_ranges(ranges: list[list[int]]) -> list[list[int]]:
    """Sort ranges `[first, last]` and join those that touch or overlap."""
    joined: list[list[int]] = []
    for first, last in sorted(ranges):
        if joined and first <= joined[-1][1] + 1:
            joined[-1][1] = max(joined[-1][1], last)
        else:
            joined.append([first, last])
    return joined


def holes(ranges: list[list[int]]) -> list[list[int]]:
    """What is missing between the ranges: with the logs of all processes joined, the samples that nobody received."""
    joined = join_ranges(ranges)
    return [[before[1] + 1, after[0] - 1] for before, after in zip(joined, joined[1:])]
