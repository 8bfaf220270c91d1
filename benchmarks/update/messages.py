# SPDX-License-Identifier: GPL-3.0-or-later
"""Publisher's and subscriber's logs -> what became of the messages. Pure.

A reading's number is the sample's number on the robot's clock: time x rate. Two publishers that overlap send the same
numbers, and two subscribers that overlap receive the same ones, so that what nobody received can be counted exactly.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

from .jsonlog import Lines
from .numbers import Ranges, clip, count, holes, join_ranges, minus
from .windows import Span

REPORT_SECONDS = 1.0  # a line of the log covers so many seconds before its time


@dataclass(frozen=True)
class Messages:
    """What became of the messages of a span."""

    sent: int  # different numbers published
    lost: int  # published, and received by no subscriber of any version
    lost_ranges: Ranges
    not_sent: int  # numbers that no publisher published: samples that fell due and were skipped, or nobody was there
    duplicates: int  # deliveries beyond the first one of a number


def numbers_of(span: Span, rate: float) -> tuple[int, int]:
    """First and last number that falls into the span."""
    first = math.ceil(span.start * rate)
    return first, first + round(span.seconds * rate) - 1


def ranges_of(lines: Lines) -> Ranges:
    """All numbers of a log."""
    return join_ranges([list(item) for line in lines for item in line.get("ranges", [])])


def messages(published: Lines, received: Lines, span: Span, rate: float) -> Messages | None:
    """The account of the span; None where the logs do not cover it, so that a missing log is never `0 lost`."""
    first, last = numbers_of(span, rate)
    sent, got = ranges_of(published), ranges_of(received)
    if not _covers(sent, first, last) or not _covers(got, first, last):
        return None
    out, into = clip(sent, first, last), clip(got, first, last)
    lost = minus(out, into)
    return Messages(
        sent=count(out),
        lost=count(lost),
        lost_ranges=lost,
        not_sent=last - first + 1 - count(out),
        duplicates=_delivered(received, first, last) - count(into) + _counted(received, "duplicates", span),
    )


def _covers(ranges: Ranges, first: int, last: int) -> bool:
    return bool(ranges) and ranges[0][0] <= first and ranges[-1][1] >= last


def by_process(lines: Lines) -> Iterable[Lines]:
    """The lines of each subscriber process: every start goes on from a number of its own."""
    found: dict[tuple[Any, ...], Lines] = {}
    for line in lines:
        key = (line.get("node"), line.get("version"), line.get("resumed_from"), line.get("pid"))
        found.setdefault(key, []).append(line)
    return found.values()


def processes(received: Lines) -> int:
    """How many subscriber processes wrote the log: more than two versions' worth are restarts."""
    return len(list(by_process(received)))


def _delivered(received: Lines, first: int, last: int) -> int:
    """Numbers accepted, counted once per process."""
    return sum(count(clip(ranges_of(lines), first, last)) for lines in by_process(received))


def dropped_by_queues(received: Lines, span: Span) -> int | None:
    """What the applications' own full queues dropped: left out within a connection, where TCP loses nothing."""
    return _counted(received, "stream_gaps", span) if any("stream_gaps" in line for line in received) else None


def _counted(received: Lines, counter: str, span: Span) -> int:
    """How far a counter went within the span; every process counts for as long as it lives."""
    total = 0
    for lines in by_process(received):
        before = 0
        for line in lines:
            now = int(line.get(counter) or 0)
            if span.holds(line["time"]):
                total += max(0, now - before)
            before = now
    return total


def gap_ms(received: Lines, span: Span, rate: float) -> float | None:
    """The longest time between two messages, in ms.

    Within a subscriber process its own measure of arrivals, by lines: one that began up to a second before the span
    counts. Between processes (the old one is gone, the new one has not begun) the numbers that nobody received.
    """
    within = [
        float(line["longest_gap_ms"])
        for line in received
        if line.get("longest_gap_ms") is not None and span.overlaps(line["time"] - REPORT_SECONDS, line["time"])
    ]
    if not within:
        return None
    first, last = numbers_of(span, rate)
    missing = [item for item in holes(ranges_of(received)) if item[0] <= last and item[1] >= first]
    between = [(high - low + 2) / rate * 1e3 for low, high in missing]
    return round(max(within + between), 3)


def oldest_age_ms(received: Lines, span: Span) -> float | None:
    """The greatest age of a message when it arrived, by lines."""
    ages = [float(line["oldest_age_ms"]) for line in received if span.holds(line["time"]) and "oldest_age_ms" in line]
    return max(ages, default=None)


def order(received: Lines, span: Span, rate: float) -> Mapping[str, float | None]:
    """How many messages were older than the one before, by how much at most; None by subscribers that do not say."""
    lines = [line for line in received if span.holds(line["time"])]
    if not lines or any("ran_back" not in line for line in lines):
        return {"ran_back": None, "furthest_back_ms": None}
    furthest = max(int(line["furthest_back"]) for line in lines)
    return {"ran_back": sum(int(line["ran_back"]) for line in lines), "furthest_back_ms": furthest / rate * 1e3}


def as_fields(account: Messages | None) -> Mapping[str, int | None]:
    """The fields of a record."""
    if account is None:
        return {"sent": None, "lost": None, "duplicates": None}
    return {"sent": account.sent, "lost": account.lost, "duplicates": account.duplicates}
