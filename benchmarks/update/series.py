# SPDX-License-Identifier: GPL-3.0-or-later
"""Response times over the time of a run, small enough to be kept. Pure."""

from __future__ import annotations

from collections.abc import Iterable

from .windows import Span

AROUND = 15.0  # seconds before and after the run
Series = list[list[float]]


def series(points: Iterable[tuple[float, float]], run: Span) -> Series:
    """[seconds from the command's start, milliseconds], in order.

    >>> series([(100.5, 7.04), (10.0, 1.0)], Span(100.0, 104.0))
    [[0.5, 7.0]]
    """
    around = Span(run.start - AROUND, run.end + AROUND)
    return sorted([round(at - run.start, 2), round(value, 1)] for at, value in points if around.holds(at))
