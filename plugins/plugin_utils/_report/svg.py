# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Horizontal bars and dots as inline SVG. Pure.

Lengths along the axis are percentages and all else pixels, without a viewBox: a plot takes the width that it gets and
its text keeps its size, on a phone too. Colours are classes, for the page's style to set.
"""

from __future__ import annotations

import html
import math
import re
from dataclasses import dataclass, field
from typing import Callable, Sequence

ROW, LABEL_Y, BAR_Y, BAR = 38, 13, 19, 11
AXIS = 24
LABEL_KEPT, VALUE_KEPT = 32, 24  # characters that fit beside each other on a phone
# control characters, halves of surrogate pairs, and the two that are no characters at all
_NOT_TEXT = re.compile("[\x00-\x08\x0b\x0c\x0e-\x1f\x7f-\x9f\ud800-\udfff\ufffe\uffff]")
DECADE_FROM = 30.0  # from this ratio on a linear axis hides the small ones


def escaped(value: object) -> str:
    """Text as the content of an element or of a quoted attribute, without what no HTML document may hold."""
    text = _NOT_TEXT.sub("\ufffd", str(value))
    return html.escape(text, quote=True)


@dataclass(frozen=True)
class Bar:
    """A row: its parts are `(class, length, words)`, `value` stands at its end.

    Around a dot `spread` is drawn, from its lowest to its highest.
    """

    label: str
    parts: Sequence[tuple[str, float, str]]
    value: str
    spread: tuple[float, float] | None = None

    @property
    def length(self) -> float:
        return sum(length for _class, length, _words in self.parts)


@dataclass(frozen=True)
class Axis:
    """Where a value lies, in percent of the width, and what is written below."""

    place: Callable[[float], float]
    ticks: Sequence[tuple[float, str]] = field(default_factory=tuple)


def linear_axis(highest: float, unit: str = "") -> Axis:
    """From 0 to the next round number."""
    top = round_up(highest)
    steps = [top * quarter / 4 for quarter in range(5)]
    return Axis(lambda value: 100 * value / top, [(25.0 * n, f"{step:g}{unit}") for n, step in enumerate(steps)])


def round_up(value: float) -> float:
    """The next 1, 2, 4 or 8 times a power of ten: quarters of it are short numbers.

    >>> [round_up(value) for value in (0, 1, 9.5, 0.3, 130)]
    [1.0, 1.0, 10.0, 0.4, 200.0]
    """
    if value <= 0:
        return 1.0
    power = 10.0 ** math.floor(math.log10(value))
    return float(next(f"{step * power:.6g}" for step in (1, 2, 4, 8, 10) if step * power >= value * (1 - 1e-9)))


def decade_axis(lowest: float, highest: float, unit: str = "") -> Axis:
    """Powers of ten around both; what is below lies at the left end."""
    first = math.floor(math.log10(lowest))
    last = max(math.ceil(math.log10(highest)), first + 1)
    span = last - first
    ticks = [(100 * n / span, f"{10.0 ** (first + n):g}{unit}") for n in range(span + 1)]
    return Axis(lambda value: 100 * min(max((math.log10(value) - first) / span, 0), 1) if value > 0 else 0.0, ticks)


def axis_of(values: Sequence[float], unit: str = "") -> tuple[Axis, bool]:
    """An axis on which all can be told apart, and whether it is in decades."""
    above = [value for value in values if value > 0]
    if above and max(above) / min(above) >= DECADE_FROM:
        return decade_axis(min(above), max(above), unit), True
    return linear_axis(max(above, default=0), unit), False


def shortened(text: str, kept: int = LABEL_KEPT) -> str:
    """Without its middle where it is too long: ends of names tell more than their middles."""
    half = (kept - 1) // 2
    return text if len(text) <= kept else f"{text[: kept - 1 - half]}\u2026{text[-half:]}"


def plot(title: str, description: str, rows: Sequence[Bar], axis: Axis, dots: bool = False) -> str:
    """Rows. With `dots` each row's length is a point: on an axis in decades a bar's length means nothing."""
    ident = "plot-" + re.sub(r"[^a-z0-9]+", "-", title.lower())  # of one page, whose titles differ
    height = ROW * len(rows) + AXIS
    parts = [
        f'<svg class="plot" role="img" aria-labelledby="{ident}-t {ident}-d" width="100%" '
        f'height="{height}" xmlns="http://www.w3.org/2000/svg">',
        f'<title id="{ident}-t">{escaped(title)}</title>',
        f'<desc id="{ident}-d">{escaped(description)}</desc>',
        *_ticks(axis, height),
    ]
    for number, row in enumerate(rows):
        parts += _row(row, ROW * number, axis, dots)
    return "".join([*parts, "</svg>"])


def _percent(value: float) -> str:
    return f"{min(max(value, 0.0), 100.0):.2f}%"


def _ticks(axis: Axis, height: int) -> list[str]:
    parts = []
    for place, words in axis.ticks:
        anchor = "start" if place <= 0 else "end" if place >= 100 else "middle"
        at = _percent(place)
        parts.append(f'<line class="tick" x1="{at}" x2="{at}" y1="0" y2="{height - AXIS + 4}"/>')
        parts.append(f'<text class="tick" x="{at}" y="{height - 5}" text-anchor="{anchor}">{escaped(words)}</text>')
    return parts


def _row(row: Bar, top: int, axis: Axis, dots: bool) -> list[str]:
    label, value, bar_top = shortened(row.label), shortened(row.value, VALUE_KEPT), top + BAR_Y
    whole = f"<title>{escaped(row.label)}: {escaped(row.value)}</title>"
    parts = [
        f'<text class="label" x="0" y="{top + LABEL_Y}">{escaped(label)}{whole}</text>',
        f'<text class="value" x="100%" y="{top + LABEL_Y}" text-anchor="end">{escaped(value)}</text>',
        f'<rect class="track" x="0" y="{top + BAR_Y}" width="100%" height="{BAR}" rx="3"/>',
    ]
    if dots and row.spread:
        low, high = (axis.place(value) for value in row.spread)
        parts.append(
            f'<rect class="spread" x="{_percent(low)}" y="{bar_top}" width="{_percent(high - low)}" height="{BAR}"/>'
        )
    if dots:
        at, middle = axis.place(row.length), top + BAR_Y + BAR / 2
        name = escaped(row.parts[0][0]) if row.parts else ""
        # kept inside, where half a dot would be cut off
        inner = _percent(min(max(at, 1.5), 98.5))
        return [*parts, f'<circle class="{name}" cx="{inner}" cy="{middle:g}" r="{BAR / 2:g}">{whole}</circle>']
    begin = 0.0
    for name, length, words in row.parts:
        end = begin + length
        at, width = axis.place(begin), axis.place(end) - axis.place(begin)
        begin = end
        if width > 0:
            parts.append(
                f'<rect class="{escaped(name)}" x="{_percent(at)}" y="{top + BAR_Y}" width="{_percent(width)}" '
                f'height="{BAR}"><title>{escaped(words)}</title></rect>'
            )
    return parts
