# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""What a panel makes of its answers before anything is drawn: names of series, numbers with units, rows of tables."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from typing import Any

from .answers import Series
from .panels import Json

UNITS = {"cps": " c/s", "reqps": " req/s", "Bps": " B/s", "bytes": " B", "s": " s", "celsius": " °C", "percent": " %"}
SCALED = {"bytes", "Bps", "short"}
LARGE = (("G", 1e9), ("M", 1e6), ("k", 1e3))
LONG = (("days", 86400.0), ("hours", 3600.0), ("min", 60.0))


def number(value: float, unit: str) -> str:
    """As a person reads it.

    >>> [number(0.256, "percentunit"), number(498.3333, "cps"), number(2_500_000, "bytes"), number(2.0, "none")]
    ['25.6 %', '498 c/s', '2.5 MB', '2']
    """
    if math.isnan(value):
        return "-"
    if unit == "percentunit":
        return f"{value * 100:.3g} %"
    if unit == "s":
        for word, size in LONG:
            if abs(value) >= size:
                return f"{value / size:.3g} {word}"
    if unit in SCALED:
        for letter, size in LARGE:
            if abs(value) >= size:
                plain = UNITS.get(unit, " ").strip()
                return f"{value / size:.3g} {letter}{plain}".strip()
    return (f"{value:.0f}" if abs(value) >= 1000 else f"{value:.3g}") + UNITS.get(unit, "")


def name_of(series: Series, legend: str) -> str:
    """As the legend has it: `{{robot}} {{topic}}`, or all labels where it says nothing."""
    labels = series.get("metric", {})
    if not legend or legend == "__auto":
        shown = [f"{key}={value}" for key, value in sorted(labels.items()) if key != "__name__"]
        return ", ".join(shown) or labels.get("__name__", "")
    return re.sub(r"\{\{\s*(\w+)\s*\}\}", lambda found: str(labels.get(found[1], "")), legend)


def points(series: Series) -> list[tuple[float, float]]:
    """Time and value, however many the answer has."""
    values = series.get("values") or ([series["value"]] if "value" in series else [])
    return [(float(time), float(value)) for time, value in values]


def rows_of(panel: Json, answers: Sequence[tuple[str, Sequence[Series]]]) -> tuple[list[str], list[list[str]]]:
    """Headings and cells of a table, by its transformations: merged by labels, some fields, under other names.

    `answers`: each query's letter, and its series.
    """
    steps = {step["id"]: step["options"] for step in panel["transformations"]}
    fields: list[str] = steps["filterFieldsByName"]["include"]["names"]
    headings: Mapping[str, str] = steps["organize"]["renameByName"]
    looks = _looks(panel)
    merged: dict[tuple[tuple[str, str], ...], dict[str, Any]] = {}
    for letter, found in answers:
        value = "Value" if len(answers) == 1 else f"Value #{letter}"
        for series in found:
            labels = {key: text for key, text in series["metric"].items() if key != "__name__"}
            row = merged.setdefault(tuple(sorted(labels.items())), dict(labels))
            row[value] = points(series)[-1][1]
    cells = [
        [_cell(row.get(one), *looks.get(headings[one], ("none", {}))) for one in fields] for row in merged.values()
    ]
    return [headings[one] for one in fields], sorted(cells)


def _looks(panel: Json) -> dict[str, tuple[str, Mapping[str, str]]]:
    """Heading -> unit, and texts instead of values."""
    found: dict[str, tuple[str, Mapping[str, str]]] = {}
    for override in panel["fieldConfig"]["overrides"]:
        have = {one["id"]: one["value"] for one in override["properties"]}
        texts = {value: said["text"] for one in have.get("mappings", ()) for value, said in one["options"].items()}
        found[override["matcher"]["options"]] = (str(have.get("unit", "none")), texts)
    return found


def _cell(value: Any, unit: str, texts: Mapping[str, str]) -> str:
    if value is None:
        return ""
    if isinstance(value, str):
        return value
    return texts.get(f"{value:g}", number(value, unit))
