# SPDX-License-Identifier: GPL-3.0-or-later
"""Duplicates, holes and ranges."""

from __future__ import annotations

import pytest
from rosops_apps.sequence import SequenceTracker, StreamGaps, holes, join_ranges


def feed(numbers: list[int], after: int | None = None) -> tuple[SequenceTracker, list[int]]:
    tracker = SequenceTracker(after=after)
    return tracker, [n for n in numbers if tracker.add(n)]


@pytest.mark.parametrize(
    ("numbers", "accepted", "missing", "ranges"),
    [
        ([5, 6, 7], [5, 6, 7], 0, [[5, 7]]),
        ([5, 5, 6, 6], [5, 6], 0, [[5, 6]]),
        ([5, 8], [5, 8], 2, [[5, 5], [8, 8]]),
        ([5, 8, 6], [5, 8, 6], 1, [[5, 6], [8, 8]]),
        ([5, 8, 6, 7, 7], [5, 8, 6, 7], 0, [[5, 8]]),
        ([7, 5, 8], [7, 5, 8], 1, [[5, 5], [7, 8]]),  # the overlapping publisher's first one comes late
        ([7, 5, 6, 5], [7, 5, 6], 0, [[5, 7]]),
        ([1, 2, 1, 3, 2, 4, 3, 5], [1, 2, 3, 4, 5], 0, [[1, 5]]),  # two publishers that overlap
        ([0, 1], [0, 1], 0, [[0, 1]]),
    ],
)
def test_add(numbers: list[int], accepted: list[int], missing: int, ranges: list[list[int]]) -> None:
    tracker, taken = feed(numbers)
    assert taken == accepted
    assert tracker.missing == missing
    assert tracker.duplicates == len(numbers) - len(accepted)
    assert tracker.take_ranges() == ranges
    assert tracker.take_ranges() == []
    assert (tracker.first, tracker.last) == (min(numbers), max(numbers))
    assert [tracker.add(max(numbers) + more) for more in (1, 2)] == [True, True]
    assert tracker.take_ranges() == [[max(numbers) + 1, max(numbers) + 2]]  # those since it was asked before


def test_what_an_earlier_process_accounted_for_is_a_duplicate() -> None:
    tracker, taken = feed([9, 10, 11, 12], after=10)
    assert taken == [11, 12]
    assert tracker.duplicates == 2
    assert tracker.missing == 0


def test_holes_beyond_what_is_remembered_are_still_counted() -> None:
    tracker = SequenceTracker(remember=10)
    for number in (0, 101, 203):
        assert tracker.add(number)
    assert tracker.missing == 100 + 101
    assert not tracker.add(50)  # forgotten, so it cannot be told from a duplicate
    assert tracker.add(100)


def test_join_and_holes() -> None:
    assert join_ranges([[7, 9], [1, 3], [4, 5], [2, 3]]) == [[1, 5], [7, 9]]
    assert holes([[7, 9], [1, 3], [20, 20]]) == [[4, 6], [10, 19]]
    assert holes([]) == []


def test_what_a_connection_leaves_out() -> None:
    gaps, first, second = StreamGaps(), {"callerid": "/a"}, {"callerid": "/a"}
    for count in (7, 8, 11):
        gaps.add("/a", first, count)
    assert gaps.dropped == 2
    gaps.add("/b", {}, 50)  # another publisher counts for itself
    gaps.add("/a", second, 99)  # an equal header, but of a new connection, which starts anew
    assert gaps.dropped == 2
