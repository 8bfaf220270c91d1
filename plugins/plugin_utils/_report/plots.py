# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""What the plots of the status page show: rates of topics, phases of the last steps, how full the claims are. Pure.

Places and lengths are percent of a plot's width; the page's template draws them.
"""

from __future__ import annotations

import math
import statistics
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from ansible_collections.rosops.fleet.plugins.plugin_utils._report.glance import (
    BAD,
    WARN,
    Rows,
    Status,
    level,
    used_share,
)
from ansible_collections.rosops.fleet.plugins.plugin_utils._report.text import size_words

MOST = 24  # bars of one plot; the tables have all
DECADE_FROM = 30.0  # from this ratio on a linear axis hides the small ones
# Classes of the page's style.
PHASES = {"gate": "c7", "wait": "c2", "apply": "c1", "rollout": "c3", "verify": "c4", "rollback": "c6"}
OTHER = "c5"
LEVEL_COLOURS = {WARN: "c2", BAD: "c6"}


@dataclass(frozen=True)
class Part:
    """A piece of a bar: where it begins, how long it is, and what is said of it."""

    colour: str
    begin: float
    length: float
    words: str = ""


@dataclass(frozen=True)
class Bar:
    """`value` stands at its end. On an axis in decades a length means nothing: there a `dot` marks the place."""

    label: str
    value: str
    parts: Sequence[Part] = ()
    dot: float | None = None


@dataclass(frozen=True)
class Plot:
    """`ticks` are `(place, words)`, `legend` is `(colour, words)`."""

    title: str
    caption: str
    bars: Sequence[Bar]
    ticks: Sequence[tuple[float, str]]
    legend: Sequence[tuple[str, str]] = ()


@dataclass(frozen=True)
class Axis:
    """`place` says where a value lies."""

    place: Callable[[float], float]
    ticks: Sequence[tuple[float, str]]
    decades: bool = False

    def part(self, colour: str, low: float, high: float, words: str = "") -> Part:
        begin, end = (min(max(self.place(value), 0.0), 100.0) for value in (low, high))
        return Part(colour, round(begin, 2), round(end - begin, 2), words)


def linear_axis(highest: float, unit: str) -> Axis:
    """From 0 to the next round number."""
    top = round_up(highest)
    return Axis(lambda value: 100 * value / top, [(25.0 * n, f"{top * n / 4:g}{unit}") for n in range(5)])


def round_up(value: float) -> float:
    """The next 1, 2, 4 or 8 times a power of ten: quarters of it are short numbers.

    >>> [round_up(value) for value in (0, 1, 9.5, 0.3, 130)]
    [1.0, 1.0, 10.0, 0.4, 200.0]
    """
    if value <= 0:
        return 1.0
    power = 10.0 ** math.floor(math.log10(value))
    return float(next(f"{step * power:.6g}" for step in (1, 2, 4, 8, 10) if step * power >= value * (1 - 1e-9)))


def decade_axis(lowest: float, highest: float, unit: str) -> Axis:
    """Powers of ten around both; what is below lies at the left end."""
    first = math.floor(math.log10(lowest))
    span = max(math.ceil(math.log10(highest)) - first, 1)
    ticks = [(round(100 * n / span, 2), f"{10.0 ** (first + n):g}{unit}") for n in range(span + 1)]
    return Axis(lambda value: 100 * (math.log10(value) - first) / span if value > 0 else 0.0, ticks, decades=True)


def axis_of(values: Iterable[float], unit: str) -> Axis:
    """An axis on which all can be told apart."""
    above = [value for value in values if value > 0]
    if above and max(above) / min(above) >= DECADE_FROM:
        return decade_axis(min(above), max(above), unit)
    return linear_axis(max(above, default=0), unit)


def rate_words(rate: float) -> str:
    """Three digits: what changes from one look to the next says nothing.

    >>> [rate_words(rate) for rate in (499.83, 10.04, 0.999, 0, 12345.6)]
    ['500 Hz', '10.0 Hz', '0.999 Hz', '0 Hz', '12346 Hz']
    """
    if rate <= 0:
        return "0 Hz"
    digits = 0 if rate >= 99.95 else 1 if rate >= 9.995 else 2 if rate >= 0.9995 else 3
    return f"{rate:.{digits}f} Hz"


def plots(status: Status) -> list[Plot]:
    """Plots of what there is something of."""
    made = (
        _rates(status.get("topics") or []),
        _steps(status.get("steps") or []),
        _claims(status.get("claims") or []),
    )
    return [one for one in made if one]


def _of_all(shown: int, total: int, which: str) -> str:
    return f" The {which} {shown} of {total}; the table below has all." if shown < total else ""


def _rates(topics: Rows) -> Plot | None:
    """A bar per topic; of a large fleet the median of each topic's name, and how far the robots lie apart."""
    known = [row for row in topics if row.get("rate") is not None]
    robots = len({row["robot"] for row in known})
    # a row of each is too much to look at, and what one wants to see then is the robot that differs
    by_name = len(known) > MOST and robots > 1
    rates: dict[str, list[float]] = {}
    for row in known:
        rates.setdefault(str(row["name"]) if by_name else f"{row['robot']} {row['name']}", []).append(
            float(row["rate"])
        )
    fastest = sorted(rates.items(), key=lambda item: -statistics.median(item[1]))[:MOST]
    if not fastest:
        return None
    axis = axis_of([rate for _label, found in fastest for rate in found], " Hz")
    caption = "Messages per second" + (", a power of ten from line to line." if axis.decades else ".")
    if by_name:
        caption += f" Each dot is the median of {robots} robots; the band reaches from the lowest to the highest."
    caption += _of_all(len(fastest), len(rates), "fastest")
    bars = [_rate_bar(label, found, axis, by_name) for label, found in fastest]
    return Plot("Rates of topics", caption, bars, axis.ticks)


def _rate_bar(label: str, rates: Sequence[float], axis: Axis, by_name: bool) -> Bar:
    low, middle, high = min(rates), statistics.median(rates), max(rates)
    said = " to ".join(dict.fromkeys((rate_words(low), rate_words(high))))
    if not (by_name or axis.decades):
        return Bar(label, said, [axis.part("c1", 0, middle)])
    place = axis.part("c1", 0, middle).length
    return Bar(label, said, [axis.part("spread", low, high)] if by_name else [], place)


def _steps(steps: Rows) -> Plot | None:
    shown = [row for row in steps if row.get("phases")]
    slowest = sorted(shown, key=lambda row: -float(row["seconds"]))[:MOST]
    kept = [row for row in shown if any(row is one for one in slowest)]  # in their order
    if not kept:
        return None
    axis = linear_axis(max(sum(row["phases"].values()) for row in kept), " s")
    there = dict.fromkeys(name for row in kept for name in row["phases"])
    names = [*(name for name in PHASES if name in there), *(name for name in there if name not in PHASES)]
    return Plot(
        "Steps of the last update",
        "Seconds of each phase." + _of_all(len(kept), len(shown), "slowest"),
        [_step_bar(row, axis) for row in kept],
        axis.ticks,
        [(PHASES.get(name, OTHER), name) for name in names],
    )


def _step_bar(row: Mapping[str, Any], axis: Axis) -> Bar:
    parts, begin = [], 0.0
    for name, seconds in row["phases"].items():
        words = f"{name} {seconds:.1f} s"
        parts.append(axis.part(PHASES.get(name, OTHER), begin, begin + seconds, words))
        begin += seconds
    return Bar(f"{row['robot']} {row['name']}", f"{row['outcome']}, {float(row['seconds']):.1f} s", parts)


def _claims(claims: Rows) -> Plot | None:
    known = [(share, row) for row in claims for share in [used_share(row)] if share is not None]
    fullest = sorted(known, key=lambda pair: -pair[0])[:MOST]
    if not fullest:
        return None
    axis = linear_axis(100, " %")
    bars = [
        Bar(
            f"{row['robot']} {row['name']}",
            f"{size_words(row.get('used_bytes'))} of {row['size']}",
            # a full claim is full, even where its storage lets it grow beyond what was asked for
            [axis.part(LEVEL_COLOURS.get(level("claims", row), "c1"), 0, 100 * share, f"{100 * share:.1f} %")],
        )
        for share, row in fullest
    ]
    return Plot("Claims", "How full they are." + _of_all(len(fullest), len(known), "fullest"), bars, axis.ticks)
