# SPDX-License-Identifier: GPL-3.0-or-later
"""Lines over an axis as SVG: the same figures give the same bytes, so that what the repository has can be checked."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from html import escape

WIDTH, HEIGHT = 760, 320
LEFT, RIGHT, TOP, BOTTOM = 60, 20, 34, 44
Points = Sequence[tuple[float, float]]


@dataclass(frozen=True)
class Line:
    """One of the picture; without a label it is not in the legend."""

    points: Points
    colour: str
    label: str = ""
    width: float = 1.5
    dashes: str = ""


@dataclass(frozen=True)
class Chart:
    """What is drawn: x linear, y by powers of ten or linear."""

    title: str
    x: str
    y: str
    lines: Sequence[Line]
    log: bool = False
    marks: Sequence[tuple[float, str]] = ()  # vertical: place, word


def ticks(low: float, high: float) -> list[float]:
    """Some five round numbers from low to high.

    >>> ticks(0, 100), ticks(-12.0, 31.0)
    ([0.0, 20.0, 40.0, 60.0, 80.0, 100.0], [-10.0, 0.0, 10.0, 20.0, 30.0])
    """
    span = (high - low) or 1.0
    unit = 10 ** math.floor(math.log10(span / 4))
    step = unit * min((1, 2, 5, 10), key=lambda many: abs(span / (unit * many) - 5))
    first = math.ceil(low / step)
    return [round(number * step, 6) for number in range(first, math.floor(high / step) + 1)]


def powers(low: float, high: float) -> list[float]:
    """Powers of ten that hold both, one at least on either side."""
    first, last = math.floor(math.log10(low)), math.ceil(math.log10(high))
    return [10.0**number for number in range(first, max(last, first + 1) + 1)]


def draw(chart: Chart) -> str:
    """The picture; without a point it says so."""
    body = _plot(chart) if any(line.points for line in chart.lines) else [_text(WIDTH / 2, HEIGHT / 2, "no trial yet")]
    space, box = "http://www.w3.org/2000/svg", f"0 0 {WIDTH} {HEIGHT}"
    head = f'<svg xmlns="{space}" viewBox="{box}" font-family="sans-serif" font-size="11">'
    frame = f'<rect width="{WIDTH}" height="{HEIGHT}" fill="#ffffff"/>'
    title = _text(LEFT, 18, chart.title, "start", size=13)
    return "\n".join([head, frame, title, *body, "</svg>"]) + "\n"


def _plot(chart: Chart) -> list[str]:
    xs = [x for line in chart.lines for x, _y in line.points] + [x for x, _word in chart.marks]
    ys = [max(y, 0.1) if chart.log else y for line in chart.lines for _x, y in line.points]
    marks = powers(min(ys), max(ys)) if chart.log else ticks(min(0.0, *ys), max(ys))
    low, high = min([*ys, marks[0]]), max([*ys, marks[-1]])
    left, right = min(xs), max(xs) if max(xs) > min(xs) else min(xs) + 1

    def across(x: float) -> float:
        return LEFT + (x - left) / (right - left) * (WIDTH - LEFT - RIGHT)

    def up(y: float) -> float:
        share = math.log(max(y, low) / low) / math.log(high / low) if chart.log else (y - low) / ((high - low) or 1)
        return HEIGHT - BOTTOM - share * (HEIGHT - TOP - BOTTOM)

    return [
        *(_rule(LEFT, up(y), WIDTH - RIGHT, up(y)) + _text(LEFT - 6, up(y) + 4, f"{y:g}", "end") for y in marks),
        *(_text(across(x), HEIGHT - BOTTOM + 16, f"{x:g}") for x in ticks(left, right)),
        *(_rule(across(x), TOP, across(x), HEIGHT - BOTTOM, "#555555") + _text(across(x) + 3, TOP + 8, word, "start")
          for x, word in chart.marks),
        _text((LEFT + WIDTH - RIGHT) / 2, HEIGHT - 10, chart.x),
        _text(LEFT - 6, TOP - 4, chart.y, "end"),
        *(_line([(across(x), up(y)) for x, y in line.points], line) for line in chart.lines if line.points),
        *_legend([line for line in chart.lines if line.label and line.points]),
    ]  # fmt: skip


def _legend(lines: Iterable[Line]) -> list[str]:
    found, place = [], float(WIDTH - RIGHT)
    for line in reversed(list(lines)):
        place -= 7 * len(line.label) + 34
        found.append(_line([(place, 30), (place + 22, 30)], line) + _text(place + 26, 34, line.label, "start"))
    return found


def _line(points: Points, line: Line) -> str:
    way = " ".join(f"{x:.1f},{y:.1f}" for x, y in points)
    dashes = f' stroke-dasharray="{line.dashes}"' if line.dashes else ""
    return f'<polyline points="{way}" fill="none" stroke="{line.colour}" stroke-width="{line.width:g}"{dashes}/>'


def _rule(x1: float, y1: float, x2: float, y2: float, colour: str = "#dddddd") -> str:
    return f'<line x1="{x1:.1f}" y1="{y1:.1f}" x2="{x2:.1f}" y2="{y2:.1f}" stroke="{colour}"/>'


def _text(x: float, y: float, text: str, anchor: str = "middle", size: int = 11) -> str:
    return f'<text x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}" font-size="{size}">{escape(text)}</text>'
