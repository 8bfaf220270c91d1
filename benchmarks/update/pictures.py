# SPDX-License-Identifier: GPL-3.0-or-later
"""Trials -> the pictures of docs/benchmarks.md: response over the time of a run, and its distribution. Pure."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from . import seed
from .numbers import percentile
from .svg import Chart, Line, draw
from .tables import seconds

Details = Mapping[str, Any]
COLOURS = {"plain": "#c0504d", "fleet": "#1f77b4"}
GREY = "#7f7f7f"
BIN = 0.5  # seconds
KINDS = {  # case -> name of its pictures, what is shown
    "service/server": ("service", "Response of a service"),
    "action/server": ("action", "Completion of a goal"),
    "pubsub/simultaneous": ("pubsub", "Longest gap between messages, each second"),
}
THEIRS = {"service/server": seed.SERVICE_P95_MS["during"], "action/server": seed.ACTION_MS["during"]}


def pictures(details: Iterable[Details]) -> dict[str, str]:
    """File name -> SVG; of every kind and condition, so that the page's links always lead somewhere."""
    every = list(details)
    found = {}
    for case, (name, what) in KINDS.items():
        for stress in (False, True):
            chosen = [item for item in every if _case(item) == case and bool(item["stress"]) is stress]
            suffix, words = ("-stress", ", 80 % CPU and memory") if stress else ("", "")
            found[f"{name}-time{suffix}.svg"] = draw(_over_time(f"{what}{words}", chosen))
            found[f"{name}-distribution{suffix}.svg"] = draw(_distribution(f"{what}{words}", chosen, THEIRS.get(case)))
    return found


def _case(item: Details) -> str:
    return f"{item['app']}/{item['update']}"


def _points(chosen: Sequence[Details], arm: str) -> list[tuple[float, float]]:
    return [(at, value) for item in chosen if item["arm"] == arm for at, value in item.get("series") or ()]


def _over_time(title: str, chosen: Sequence[Details]) -> Chart:
    lines = []
    for arm, colour in COLOURS.items():
        bins: dict[int, list[float]] = {}
        for at, value in _points(chosen, arm):
            bins.setdefault(int(at // BIN), []).append(value)
        for share, width, dashes in ((50, 1.8, ""), (95, 1.0, "4 2")):
            points = [((place + 0.5) * BIN, percentile(values, share) or 0.0) for place, values in sorted(bins.items())]
            lines.append(Line(points, colour, f"{arm} p{share}", width, dashes))
    marks = [(0.0, "command")] if any(line.points for line in lines) else []
    return Chart(f"{title}, all trials", "seconds from the command's start", "ms", lines, log=True, marks=marks)


def _distribution(title: str, chosen: Sequence[Details], theirs: float | None) -> Chart:
    lines: list[Line] = []
    marks: list[tuple[float, str]] = []
    for arm, colour in COLOURS.items():
        mine = [item for item in chosen if item["arm"] == arm]
        calm = [value for item in mine for at, value in item.get("series") or () if at < 0]
        busy = [value for item in mine for at, value in item.get("series") or () if 0 <= at < seconds(item["run_span"])]
        lines.append(Line(_shares(calm), colour, f"{arm} before", 1.0, "4 2"))
        lines.append(Line(_shares(busy), colour, f"{arm} during", 1.8))
    if theirs is not None and any(line.points for line in lines):
        lines.append(Line([(0.0, theirs), (100.0, theirs)], GREY, "dissertation", 1.0, "1 3"))
    return Chart(f"{title}, distribution over all trials", "per cent of all are not above", "ms", lines, True, marks)


def _shares(values: Sequence[float]) -> list[tuple[float, float]]:
    return (
        [(float(share), percentile(values, share) or 0.0) for share in (*range(0, 100, 5), 98, 99, 100)]
        if values
        else []
    )
