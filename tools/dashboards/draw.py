# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Draws a dashboard of ours as one SVG, from what Prometheus and Loki answer to its queries, in the panels' layout.

PYTHONPATH=tools python -m dashboards.draw fleet --prometheus URL --loki URL [--robot NAME] [--minutes N] > fleet.svg
PYTHONPATH=tools python -m dashboards.draw fleet --answers FILE > fleet.svg

It shows which figures stand where. It is not Grafana's picture, and says so in itself.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from itertools import pairwise
from pathlib import Path
from xml.sax.saxutils import escape

from .answers import Answers, Series, key, read, record, server
from .build import dashboards
from .panels import Json
from .queries import of_page
from .values import name_of, number, points, rows_of

CELL, ROW, GAP, HEAD, FOOT = 50, 32, 8, 26, 46  # px: a column, a unit of height, between panels, a title, the caption
LETTER, LINE = 6.2, 16  # a letter's width at the size of 11 px, a line of text
MOST = 10  # names in a legend
CAPTION = "Drawn from the dashboard's queries by tools/dashboards, not by Grafana"
COLOURS = ("#0072b2", "#e69f00", "#009e73", "#cc79a7", "#56b4e9", "#d55e00", "#7a5cc0", "#8a8f98")
NAMED = {"green": "#1a7f4b", "red": "#b3261e", "orange": "#b25e00", "blue": "#1f5fa8", "purple": "#7a5cc0"}
Box = tuple[float, float, float, float]  # left, top, width, height
Found = Sequence[tuple[Json, Sequence[Series]]]  # each query of a panel, with its answer


def draw(page: Json, answers: Answers) -> str:
    """The whole dashboard."""
    tall = max(panel["gridPos"]["y"] + panel["gridPos"]["h"] for panel in page["panels"])
    width, height = 24 * CELL + GAP, tall * ROW + FOOT + GAP
    queries = (query for query in of_page(page, answers.robot) if query.kind == "panel")  # panel by panel
    body: list[str] = []
    for panel in page["panels"]:
        found = [(target, answers.results.get(key(next(queries)), [])) for target in panel["targets"]]
        body += _panel(panel, found, answers)
    times = [time.strftime("%Y-%m-%d %H:%M:%S", time.gmtime(at)) for at in (answers.begin, answers.end)]
    of = "" if answers.robot == ".*" else f" of {answers.robot}"
    says = f"{page['title']}{of}, {times[0]} to {times[1]} UTC. {CAPTION}."
    head = (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" font-family="sans-serif"'
        f' font-size="11" role="img" aria-label="{_safe(says)}">'
    )
    style = '<rect width="100%" height="100%" fill="#eef1f4"/>'
    return "\n".join([head, style, *body, _text(GAP, height - 16, says, size=13), "</svg>"]) + "\n"


def _panel(panel: Json, found: Found, answers: Answers) -> Iterator[str]:
    place = panel["gridPos"]
    left, top = place["x"] * CELL + GAP, place["y"] * ROW + GAP
    width, height = place["w"] * CELL - GAP, place["h"] * ROW - GAP
    yield _rect(left, top, width, height, "#ffffff", "#cfd6dd")
    yield _text(left + 8, top + 17, panel["title"], width - 16, weight="bold")
    inside = (left + 8, top + HEAD, width - 16, height - HEAD - 6)
    if any(series for _target, series in found):
        yield from _KINDS[panel["type"]](panel, found, inside, answers)
    else:
        yield _text(left + width / 2, top + height / 2 + 6, "no data", anchor="middle", colour="#7a848e")


def _stat(panel: Json, found: Found, box: Box, _answers: Answers) -> Iterator[str]:
    """One value, or its name where that says it, on the colour of the step that it has reached."""
    left, top, width, height = box
    [(target, series)] = [(target, series[0]) for target, series in found if series][:1]
    value = points(series)[-1][1]
    defaults = panel["fieldConfig"]["defaults"]
    steps = defaults["thresholds"]["steps"]
    colour = [step["color"] for step in steps if step["value"] is None or value >= step["value"]][-1]
    by_name = panel["options"]["textMode"] == "name"
    words = name_of(series, target.get("legendFormat", "")) if by_name else number(value, defaults["unit"])
    yield _rect(left, top, width, height, NAMED[colour])
    size = min(26, width / max(len(words), 1) * 1.6)
    yield _text(left + width / 2, top + height / 2 + size / 3, words, anchor="middle", colour="#ffffff", size=size)


def _curves(panel: Json, found: Found, box: Box, answers: Answers) -> Iterator[str]:
    """Curves with their axis and, below, the legend with the last values."""
    left, top, width, height = box
    unit = panel["fieldConfig"]["defaults"]["unit"]
    named = [(name_of(one, target.get("legendFormat", "")), points(one)) for target, series in found for one in series]
    if panel["fieldConfig"]["defaults"]["custom"]["stacking"]["mode"] == "normal":
        named = _stacked(named)
    shown = sorted(named, key=lambda one: one[0])
    columns = 2 if width > 500 else 1
    lines = -(-min(len(shown), MOST) // columns)
    plot = height - lines * LINE - 20
    values = [value for _name, line in shown for _time, value in line if value == value]  # noqa: PLR0124 - without NaN
    low = min([panel["fieldConfig"]["defaults"].get("min", min(values, default=0)), *values])
    high = max([*values, low + 1e-9])
    room = 62

    def place(at: float, value: float) -> str:
        x = left + room + (at - answers.begin) / (answers.end - answers.begin) * (width - room)
        return f"{x:.1f},{top + plot - (value - low) / (high - low) * (plot - 8):.1f}"

    for share in (0.0, 0.5, 1.0):
        y = top + plot - share * (plot - 8)
        yield f'<line x1="{left + room}" x2="{left + width}" y1="{y:.1f}" y2="{y:.1f}" stroke="#dde2e7"/>'
        yield _text(left + room - 5, y + 4, number(low + share * (high - low), unit), room, anchor="end")
    for at, anchor in ((answers.begin, "start"), (answers.end, "end")):
        x = left + room if anchor == "start" else left + width
        yield _text(x, top + plot + 13, time.strftime("%H:%M:%S", time.gmtime(at)), anchor=anchor, colour="#55626f")
    for index, (name, line) in enumerate(shown):
        colour = COLOURS[index % len(COLOURS)]
        way = " ".join(place(at, value) for at, value in line if value == value)  # noqa: PLR0124 - without NaN
        look = f'fill="none" stroke="{colour}" stroke-width="1.5"'
        yield f'<polyline points="{way}" {look}><title>{_safe(name)}</title></polyline>'
        if index < MOST:
            x, y = left + index % columns * width / columns, top + plot + 30 + index // columns * LINE
            yield _rect(x, y - 8, 9, 9, colour)
            said = f"{name}  {number(line[-1][1], unit)}" if line else name
            more = f" (and {len(shown) - MOST} more)" if index == MOST - 1 and len(shown) > MOST else ""
            yield _text(x + 14, y, said, width / columns - 20 - len(more) * LETTER, more=more)


def _stacked(named: Sequence[tuple[str, list[tuple[float, float]]]]) -> list[tuple[str, list[tuple[float, float]]]]:
    below: dict[float, float] = {}
    found = []
    for name, line in named:
        for at, value in line:
            below[at] = below.get(at, 0.0) + value
        found.append((name, [(at, below[at]) for at, _value in line]))
    return found


def _bands(panel: Json, found: Found, box: Box, answers: Answers) -> Iterator[str]:
    """A band per series, in the colour that its value has at each time."""
    left, top, width, height = box
    options = panel["fieldConfig"]["defaults"]["mappings"][0]["options"]
    named = sorted(
        (name_of(one, target.get("legendFormat", "")), points(one)) for target, series in found for one in series
    )
    room = min(width * 0.35, 210)
    fits = max(int((height - 16) // 13), 1)
    tall = min((height - 16) / min(len(named), fits), 24)
    for index, (name, line) in enumerate(named[:fits]):
        y = top + index * tall
        more = f" (and {len(named) - fits} more)" if index == fits - 1 and len(named) > fits else ""
        yield _text(left, y + tall / 2 + 4, name, room - 6 - len(more) * LETTER, more=more)
        step = min((later - at for (at, _value), (later, _next) in pairwise(line)), default=1.0)
        for begin, end, value in _runs(line, step):
            said = options.get(f"{value:g}", {"text": f"{value:g}", "color": "blue"})
            x = left + room + (begin - answers.begin) / (answers.end - answers.begin) * (width - room)
            wide = min((end - begin) / (answers.end - answers.begin) * (width - room), left + width - x)
            yield _rect(x, y + 2, max(wide, 1), tall - 4, NAMED[said["color"]], title=f"{name}: {said['text']}")
    for at, x, anchor in ((answers.begin, left + room, "start"), (answers.end, left + width, "end")):
        yield _text(x, top + height, time.strftime("%H:%M:%S", time.gmtime(at)), anchor=anchor, colour="#55626f")


def _runs(line: Sequence[tuple[float, float]], step: float) -> list[tuple[float, float, float]]:
    """Begin, end and value of the times in which the value was the same; a gap ends one."""
    runs: list[tuple[float, float, float]] = []
    for at, value in line:
        if runs and runs[-1][2] == value and at - runs[-1][1] <= step / 2:
            runs[-1] = (runs[-1][0], at + step, value)
        else:
            runs.append((at, at + step, value))
    return runs


def _table(panel: Json, found: Found, box: Box, _answers: Answers) -> Iterator[str]:
    left, top, width, height = box
    headings, cells = rows_of(panel, [(target["refId"], series) for target, series in found])
    fits = max(int(height // LINE) - 1, 1)
    widths = [max(len(line[column]) for line in [headings, *cells]) + 2 for column in range(len(headings))]
    scale = min(width / (sum(widths) * LETTER), 1.6)
    lefts = [left + sum(widths[:column]) * LETTER * scale for column in range(len(widths))]
    for index, line in enumerate([headings, *cells[:fits]]):
        y = top + LINE * index + 11
        for x, wide, text in zip(lefts, widths, line):
            colour = {"yes": NAMED["green"], "no": NAMED["red"]}.get(text, "#16202a" if index else "#55626f")
            weight = "normal" if index else "bold"
            yield _text(x, y, text, wide * LETTER * scale, colour=colour, weight=weight)
    if len(cells) > fits:
        yield _text(left + width, top + 11, f"{fits} of {len(cells)} rows", anchor="end", colour="#55626f")


def _lines(_panel: Json, found: Found, box: Box, _answers: Answers) -> Iterator[str]:
    """Log lines, the newest first."""
    left, top, width, height = box
    lines = [(int(at), line) for _target, streams in found for one in streams for at, line, *_more in one["values"]]
    for index, (at, line) in enumerate(sorted(lines, reverse=True)[: int(height // LINE)]):
        when = time.strftime("%H:%M:%S", time.gmtime(at / 1e9))
        yield _text(left, top + LINE * index + 11, f"{when}  {line}", width)


_KINDS: dict[str, Callable[[Json, Found, Box, Answers], Iterator[str]]] = {
    "stat": _stat,
    "timeseries": _curves,
    "state-timeline": _bands,
    "table": _table,
    "logs": _lines,
}


def _safe(text: str) -> str:
    """As an XML document may hold it."""
    return escape("".join(one if one.isprintable() else " " for one in text), {'"': "&quot;"})


def _rect(  # noqa: PLR0913 - what a rectangle of SVG has
    left: float, top: float, width: float, height: float, fill: str, line: str = "none", title: str = ""
) -> str:
    more = f"<title>{_safe(title)}</title>" if title else ""
    place = f'x="{left:.1f}" y="{top:.1f}" width="{width:.1f}" height="{height:.1f}"'
    return f'<rect {place} rx="3" fill="{fill}" stroke="{line}">{more}</rect>'


def _text(  # noqa: PLR0913 - what a text of SVG has
    left: float,
    top: float,
    text: str,
    width: float = 0,
    *,
    anchor: str = "start",
    colour: str = "#16202a",
    size: float = 11,
    weight: str = "normal",
    more: str = "",
) -> str:
    """`width`: where it ends, what is too long loses its end; `more` stays in any case."""
    room = int(width / (LETTER * size / 11)) if width else len(text)
    shown = text if len(text) <= room else text[: max(room - 1, 1)] + "…"
    place = f'x="{left:.1f}" y="{top:.1f}" font-size="{size:.1f}" text-anchor="{anchor}" font-weight="{weight}"'
    return f'<text {place} fill="{colour}">{_safe(shown + more)}</text>'


def main() -> int:
    """Draw one dashboard."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("dashboard", choices=sorted(dashboards()))
    parser.add_argument("--answers", type=Path, help="a file of recorded answers")
    parser.add_argument("--prometheus", default="http://localhost:9090")
    parser.add_argument("--loki", default="http://localhost:3100")
    parser.add_argument("--robot", default=".*")
    parser.add_argument("--minutes", type=float, default=15)
    given = parser.parse_args()
    page = dashboards()[given.dashboard]
    if given.answers:
        answers = read(given.answers)
    else:
        now = time.time()
        ask = server(given.prometheus, given.loki)
        answers = record(page, ask, now - given.minutes * 60, now, given.robot)
    for where, why in answers.refused.items():
        print(f"no answer to {where}: {why}", file=sys.stderr)
    sys.stdout.write(draw(page, answers))
    return 0


if __name__ == "__main__":
    sys.exit(main())
