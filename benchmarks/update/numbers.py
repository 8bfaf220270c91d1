# SPDX-License-Identifier: GPL-3.0-or-later
"""Sets of sequence numbers as ranges `[first, last]`, and percentiles. Pure."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

from .paths import apps_library

apps_library()

from rosops_apps.sequence import holes, join_ranges  # noqa: E402 - found through the line above

__all__ = ["clip", "count", "holes", "join_ranges", "minus", "percentile"]

Ranges = list[list[int]]


def clip(ranges: Iterable[Sequence[int]], first: int, last: int) -> Ranges:
    """What of them lies in first..last."""
    cut = [[max(low, first), min(high, last)] for low, high in ranges]
    return [item for item in cut if item[0] <= item[1]]


def count(ranges: Iterable[Sequence[int]]) -> int:
    """How many numbers."""
    return sum(high - low + 1 for low, high in ranges)


def minus(ranges: Ranges, taken: Ranges) -> Ranges:
    """The numbers of `ranges` that are not in `taken`; both may be in any order and overlap."""
    if not ranges:
        return []
    whole = join_ranges([list(item) for item in ranges])
    first, last = whole[0][0], whole[-1][1]
    # holes() says what is missing between ranges: with a fence on either side that is all that is not taken
    gaps = holes([[first - 1, first - 1], [last + 1, last + 1], *clip(taken, first, last)])
    return [part for low, high in gaps for part in clip(whole, low, high)]


def percentile(values: Iterable[float], share: float) -> float | None:
    """The value below which so many per cent lie, interpolated between neighbours; None without values."""
    ordered = sorted(values)
    if not ordered:
        return None
    place = (len(ordered) - 1) * share / 100
    low, high = math.floor(place), math.ceil(place)
    return ordered[low] + (ordered[high] - ordered[low]) * (place - low)
