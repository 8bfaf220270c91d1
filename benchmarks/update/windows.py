# SPDX-License-Identifier: GPL-3.0-or-later
"""Spans of time that are measured. Pure."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Span:
    """From `start` to `end`, in seconds of the wall clock (all lab hosts share the machine's)."""

    start: float
    end: float

    @property
    def seconds(self) -> float:
        """How long."""
        return self.end - self.start

    def overlaps(self, start: float, end: float) -> bool:
        """Whether something of start..end lies in it."""
        return start < self.end and end > self.start

    def holds(self, time: float) -> bool:
        """Whether the moment lies in it."""
        return self.start <= time < self.end


def before(quiet: Span, seconds: float) -> Span:
    """The control: the last so many seconds of the round's quiet beginning, all of it where it is shorter."""
    return Span(max(quiet.start, quiet.end - seconds), quiet.end)


def around(update: Span, seconds: float, first: float) -> Span:
    """A span of so many seconds that contains the update: from `first` on, moved on where the update ends later.

    An update that takes longer than that gets a longer span: none is left half outside.
    """
    end = max(first + seconds, update.end)
    return Span(min(update.start, max(first, end - seconds)), end)


def after_start(update: Span, seconds: float, more: float = 5.0) -> Span:
    """A span of fixed length from the update's start, at least until `more` seconds after its end."""
    return Span(update.start, max(update.start + seconds, update.end + more))
