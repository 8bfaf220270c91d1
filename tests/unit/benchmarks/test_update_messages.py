# SPDX-License-Identifier: GPL-3.0-or-later
"""What the experiment makes of publishers' and subscribers' logs."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import pytest
from update.jsonlog import lines
from update.messages import dropped_by_queues, gap_ms, messages, order, processes
from update.numbers import clip, count, minus, percentile
from update.windows import Span, after_start, around, before

RATE = 500.0
SPAN = Span(2.0, 4.0)  # numbers 1000 to 1999


def line(time: float, *ranges: list[int], **more: Any) -> dict[str, Any]:
    return {"time": time, "node": "/s", "version": "1.0", "resumed_from": None, "ranges": list(ranges), **more}


ALL, BOTH = [[900, 2600]], [line(3.0, [900, 1500]), line(5.0, [1450, 2600], node="/p_new")]
DROPPED = [
    line(at, numbers, duplicates=count)
    for at, numbers, count in (
        (1.9, [900, 999], 5), (2.9, [1000, 1450], 7), (3.9, [1451, 2100], 7), (4.9, [2101, 2600], 90),
    )
]  # fmt: skip
ANEW = [line(2.5, [900, 1250], duplicates=40), line(3.5, [1251, 2600], duplicates=3, resumed_from=1250)]
GAP = [line(3.0, [900, 1399]), line(5.0, [1403, 2600], resumed_from=1399)]
NOT_SENT = [line(5.0, [900, 1199], [1300, 2600])]


@pytest.mark.parametrize(
    ("published", "received", "counts"),
    [
        (BOTH, GAP, (1000, 3, 0, 0)),  # what nobody received of what anybody published
        ([line(5.0, *ALL)], [line(3.0, [900, 1500]), line(5.0, [1400, 2600], node="/new")], (1000, 0, 0, 101)),
        ([line(5.0, *ALL)], [line(5.0, [900, 950], [990, 1999], [2200, 2600])], (1000, 0, 0, 0)),  # out of the span
        (NOT_SENT, NOT_SENT, (900, 0, 100, 0)),
        ([line(5.0, *ALL)], DROPPED, (1000, 0, 0, 2)),  # what a process dropped counts once, and within the span
        ([line(5.0, *ALL)], ANEW, (1000, 0, 0, 43)),  # one that was started again counts from nothing
    ],
)
def test_what_became_of_the_messages_of_a_span(published: Any, received: Any, counts: tuple[int, ...]) -> None:
    found = messages(published, received, SPAN, RATE)
    assert found is not None
    assert (found.sent, found.lost, found.not_sent, found.duplicates) == counts
    assert found.lost_ranges == ([[1400, 1402]] if found.lost else [])
    assert processes(ANEW) == 2


@pytest.mark.parametrize(
    ("published", "received"),
    [
        ([], [[900, 2600]]),
        ([[900, 2600]], []),
        ([[900, 2600]], [[1100, 2600]]),  # the log begins too late
        ([[900, 2600]], [[900, 1800]]),  # and ends too early: the subscriber died, or the log was read too soon
    ],
)
def test_a_log_that_does_not_cover_the_span_gives_no_figures(
    published: list[list[int]], received: list[list[int]]
) -> None:
    assert messages([line(5.0, *published)], [line(5.0, *received)], SPAN, RATE) is None


def test_what_own_queues_dropped_is_told_apart() -> None:
    received = [line(1.9, stream_gaps=4), line(2.9, stream_gaps=6), line(3.9, stream_gaps=6), line(4.9, stream_gaps=9)]
    assert dropped_by_queues(received, SPAN) == 2
    assert dropped_by_queues([line(2.9)], SPAN) is None


REPORTED = [
    line(1.5, [900, 1000], longest_gap_ms=400.0),
    line(3.0, [1001, 1500], longest_gap_ms=12.5),
    line(4.5, [1501, 2250], longest_gap_ms=30.0),  # covers 3.5 to 4.5
    line(6.0, [2251, 3000], longest_gap_ms=900.0),
]
TWO = [line(3.0, [900, 1500], longest_gap_ms=4.0), line(4.5, [1600, 2250], longest_gap_ms=4.0, resumed_from=1500)]


@pytest.mark.parametrize(
    ("received", "gap"),
    [
        (REPORTED, 30.0),  # the longest of a process that reported within the span
        (TWO, 200.0),  # what neither received: 99 missing are 100 periods of 2 ms from one message to the next
        ([line(9.0, [1, 2], longest_gap_ms=1.0)], None),
    ],
)
def test_the_gap(received: Sequence[dict[str, Any]], gap: float | None) -> None:
    assert gap_ms(received, SPAN, RATE) == gap


def test_ranges() -> None:
    assert count(clip([[1, 5], [8, 9]], 4, 8)) == 3
    assert minus([[1, 10], [5, 12]], [[3, 4], [11, 11]]) == [[1, 2], [5, 10], [12, 12]]
    assert minus([[1, 3]], []) == [[1, 3]]
    assert minus([[1, 3]], [[0, 9]]) == minus([], [[0, 9]]) == []


def test_percentile_lies_between_neighbours() -> None:
    assert percentile([1.0, 2.0, 3.0, 4.0], 50) == 2.5
    assert percentile([7.0], 95) == 7.0
    assert percentile(range(101), 95) == 95
    assert percentile([], 95) is None


def test_spans() -> None:
    quiet, update = Span(100.0, 140.0), Span(150.0, 160.0)
    assert before(quiet, update.seconds) == Span(130.0, 140.0)
    assert before(quiet, 99.0) == quiet
    assert around(update, 200.0, 100.0) == Span(100.0, 300.0)
    assert around(update, 20.0, 100.0) == Span(140.0, 160.0)  # short runs: the span moves on to hold the update
    assert around(update, 4.0, 100.0) == update
    assert after_start(update, 30.0) == Span(150.0, 180.0)
    assert after_start(update, 5.0) == Span(150.0, 165.0)


def test_torn_lines_are_passed_over() -> None:
    assert lines('{"time": 1, "a": 2}\n{"time": 3, "a"\n\n[]\n{"a": 4}\n{"time": 5}') == [
        {"time": 1, "a": 2},
        {"time": 5},
    ]


def test_order_is_counted_over_the_span_and_unknown_where_a_subscriber_does_not_say() -> None:
    lines = [{"time": 10.0 + at, "ran_back": at, "furthest_back": 5 * at} for at in range(4)]
    assert order(lines, Span(10.0, 13.0), 500.0) == {"ran_back": 3, "furthest_back_ms": 20.0}
    assert order([*lines, {"time": 11.0}], Span(10.0, 13.0), 500.0)["ran_back"] is None
    assert order(lines, Span(20.0, 30.0), 500.0)["ran_back"] is None  # silence is not order
