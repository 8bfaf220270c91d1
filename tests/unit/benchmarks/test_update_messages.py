# SPDX-License-Identifier: GPL-3.0-or-later
"""What the experiment makes of publishers' and subscribers' logs."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import pytest
from update.jsonlog import lines
from update.messages import Messages, dropped_by_queues, gap_ms, messages, order, processes
from update.numbers import clip, count, minus, percentile
from update.windows import Span, after_start, around, before

RATE = 500.0
SPAN = Span(2.0, 4.0)  # numbers 1000 to 1999


def line(time: float, *ranges: list[int], **more: Any) -> dict[str, Any]:
    return {"time": time, "node": "/s", "version": "1.0", "resumed_from": None, "ranges": list(ranges), **more}


def found(published: Sequence[dict[str, Any]], received: Sequence[dict[str, Any]]) -> Messages:
    account = messages(published, received, SPAN, RATE)
    assert account is not None
    return account


def test_lost_is_what_nobody_received_of_what_anybody_published() -> None:
    published = [line(3.0, [900, 1500]), line(5.0, [1450, 2600], node="/p_new")]
    received = [line(3.0, [900, 1399]), line(5.0, [1403, 2600], version="1.1", resumed_from=1399)]
    account = found(published, received)
    assert (account.sent, account.lost, account.lost_ranges) == (1000, 3, [[1400, 1402]])
    assert account.not_sent == 0


def test_a_message_that_only_one_of_two_versions_received_is_not_lost() -> None:
    published = [line(5.0, [900, 2600])]
    received = [line(3.0, [900, 1500]), line(5.0, [1400, 2600], node="/s_new")]
    account = found(published, received)
    assert (account.lost, account.duplicates) == (0, 101)


def test_loss_outside_of_the_span_does_not_count() -> None:
    published = [line(5.0, [900, 2600])]
    received = [line(5.0, [900, 950], [990, 1999], [2200, 2600])]
    account = found(published, received)
    assert account.lost == 0


def test_what_nobody_published_is_not_lost_but_said() -> None:
    published = [line(5.0, [900, 1199], [1300, 2600])]
    account = found(published, published)
    assert (account.sent, account.lost, account.not_sent) == (900, 0, 100)


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


def test_duplicates_that_a_process_dropped_count_once_and_only_within_the_span() -> None:
    published = [line(5.0, [900, 2600])]
    received = [
        line(1.9, [900, 999], duplicates=5),
        line(2.9, [1000, 1450], duplicates=7),
        line(3.9, [1451, 2100], duplicates=7),
        line(4.9, [2101, 2600], duplicates=90),
    ]
    account = found(published, received)
    assert account.duplicates == 2


def test_a_process_that_was_started_again_counts_its_duplicates_from_nothing() -> None:
    published = [line(5.0, [900, 2600])]
    received = [
        line(2.5, [900, 1250], duplicates=40),
        line(3.5, [1251, 2600], duplicates=3, resumed_from=1250),
    ]
    account = found(published, received)
    assert account.duplicates == 43
    assert processes(received) == 2


def test_what_own_queues_dropped_is_told_apart() -> None:
    received = [line(1.9, stream_gaps=4), line(2.9, stream_gaps=6), line(3.9, stream_gaps=6), line(4.9, stream_gaps=9)]
    assert dropped_by_queues(received, SPAN) == 2
    assert dropped_by_queues([line(2.9)], SPAN) is None


def test_the_gap_is_the_longest_of_a_process_that_reported_within_the_span() -> None:
    received = [
        line(1.5, [900, 1000], longest_gap_ms=400.0),
        line(3.0, [1001, 1500], longest_gap_ms=12.5),
        line(4.5, [1501, 2250], longest_gap_ms=30.0),  # covers 3.5 to 4.5
        line(6.0, [2251, 3000], longest_gap_ms=900.0),
    ]
    assert gap_ms(received, SPAN, RATE) == 30.0


def test_the_gap_between_two_processes_is_what_neither_received() -> None:
    received = [
        line(3.0, [900, 1500], longest_gap_ms=4.0),
        line(4.5, [1600, 2250], longest_gap_ms=4.0, resumed_from=1500),
    ]
    assert gap_ms(received, SPAN, RATE) == 200.0  # 99 missing: 100 periods of 2 ms from one message to the next


def test_no_line_within_the_span_is_no_gap_of_nothing() -> None:
    assert gap_ms([line(9.0, [1, 2], longest_gap_ms=1.0)], SPAN, RATE) is None


def test_ranges() -> None:
    assert clip([[1, 5], [8, 9]], 4, 8) == [[4, 5], [8, 8]]
    assert count([[4, 5], [8, 8]]) == 3
    assert minus([[1, 10], [5, 12]], [[3, 4], [11, 11]]) == [[1, 2], [5, 10], [12, 12]]
    assert minus([[1, 3]], []) == [[1, 3]]
    assert minus([[1, 3]], [[0, 9]]) == []
    assert minus([], [[0, 9]]) == []


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
