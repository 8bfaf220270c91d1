# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""The plots of the status page: rates of topics, phases of the last update's steps, how full the claims are. Pure."""

from __future__ import annotations

import statistics
from typing import Any, Mapping, Sequence

from ansible_collections.rosops.fleet.plugins.plugin_utils._report.glance import BAD, WARN, level, used_share
from ansible_collections.rosops.fleet.plugins.plugin_utils._report.svg import Bar, axis_of, escaped, linear_axis, plot
from ansible_collections.rosops.fleet.plugins.plugin_utils._report.text import size_words

Rows = Sequence[Mapping[str, Any]]

MOST = 24  # rows of one plot; the tables have all
PHASES = {"gate": "c7", "wait": "c2", "apply": "c1", "rollout": "c3", "verify": "c4", "rollback": "c6"}
OTHER = "c5"
LEVEL_COLOURS = {WARN: "c2", BAD: "c6"}


def rate_words(rate: float) -> str:
    """Three digits: what changes from one look to the next says nothing.

    >>> [rate_words(rate) for rate in (499.83, 10.04, 0.999, 0, 12345.6)]
    ['500 Hz', '10.0 Hz', '0.999 Hz', '0 Hz', '12346 Hz']
    """
    if rate <= 0:
        return "0 Hz"
    digits = 0 if rate >= 99.95 else 1 if rate >= 9.995 else 2 if rate >= 0.9995 else 3
    return f"{rate:.{digits}f} Hz"


def plots(status: Mapping[str, Rows]) -> list[str]:
    """Figures of what there is something of."""
    made = [
        _rates(status.get("topics") or []),
        _steps(status.get("steps") or []),
        _claims(status.get("claims") or []),
    ]
    return [figure for figure in made if figure]


def _figure(title: str, caption: str, drawing: str, legend: str = "") -> str:
    head = f"<figcaption><strong>{escaped(title)}</strong>{escaped(caption)}</figcaption>"
    return f"<figure>{head}{drawing}{legend}</figure>"


def _of_all(shown: int, total: int, which: str) -> str:
    return f" The {which} {shown} of {total}; the table below has all." if shown < total else ""


def _rates(topics: Rows) -> str:
    known = [row for row in topics if row.get("rate") is not None]
    if not known:
        return ""
    robots = len({row["robot"] for row in known})
    # a row of each is too much to look at, and what one wants to see then is the robot that differs
    by_name = len(known) > MOST and robots > 1
    bars = _rates_by_name(known) if by_name else [_rate_bar(row) for row in known]
    shown = sorted(bars, key=lambda one: -one.length)[:MOST]
    axis, decades = axis_of([value for one in shown for value in one.spread or (one.length,)], " Hz")
    caption = "Messages per second" + (", a power of ten from line to line." if decades else ".")
    if by_name:
        caption += f" Each dot is the median of {robots} robots; the band reaches from the lowest to the highest."
    caption += _of_all(len(shown), len(bars), "fastest")
    drawing = plot("Rates of topics", "The table Topics has the values.", shown, axis, dots=decades or by_name)
    return _figure("Rates of topics", caption, drawing)


def _rate_bar(row: Mapping[str, Any]) -> Bar:
    rate = float(row["rate"])
    return Bar(f"{row['robot']} {row['name']}", [("c1", rate, "")], rate_words(rate))


def _rates_by_name(known: Rows) -> list[Bar]:
    rates: dict[str, list[float]] = {}
    for row in known:
        rates.setdefault(str(row["name"]), []).append(float(row["rate"]))
    bars = []
    for name, values in rates.items():
        low, high = min(values), max(values)
        said = rate_words(high) if rate_words(low) == rate_words(high) else f"{rate_words(low)} to {rate_words(high)}"
        bars.append(Bar(name, [("c1", statistics.median(values), "")], said, (low, high)))
    return bars


def _steps(steps: Rows) -> str:
    shown = [row for row in steps if row.get("phases")]
    slowest = sorted(shown, key=lambda row: -float(row["seconds"]))[:MOST]
    kept = [row for row in shown if any(row is one for one in slowest)]  # in their order
    if not kept:
        return ""
    bars = [
        Bar(
            f"{row['robot']} {row['name']}",
            [(PHASES.get(name, OTHER), value, f"{name} {value:.1f} s") for name, value in row["phases"].items()],
            f"{row['outcome']}, {float(row['seconds']):.1f} s",
        )
        for row in kept
    ]
    axis = linear_axis(max(one.length for one in bars), " s")
    drawing = plot("Steps of the last update", "The table Last update steps has the values.", bars, axis)
    there = dict.fromkeys(name for row in kept for name in row["phases"])
    names = [*(name for name in PHASES if name in there), *(name for name in there if name not in PHASES)]
    caption = "Seconds of each phase." + _of_all(len(kept), len(shown), "slowest")
    return _figure("Steps of the last update", caption, drawing, _legend(names))


def _legend(names: Sequence[str]) -> str:
    items = "".join(
        f'<li><svg aria-hidden="true"><rect class="{PHASES.get(name, OTHER)}" width="12" height="12"/></svg>'
        f"{escaped(name)}</li>"
        for name in names
    )
    return f'<ul class="legend" aria-label="Colours">{items}</ul>'


def _claims(claims: Rows) -> str:
    known = [(share, row) for row in claims for share in [used_share(row)] if share is not None]
    shown = sorted(known, key=lambda pair: -pair[0])[:MOST]
    if not shown:
        return ""
    bars = [
        Bar(
            f"{row['robot']} {row['name']}",
            # a full claim is full, even where its storage lets it grow beyond what was asked for
            [(LEVEL_COLOURS.get(level("claims", row), "c1"), min(100 * share, 100.0), f"{100 * share:.1f} %")],
            f"{size_words(row.get('used_bytes'))} of {row['size']}",
        )
        for share, row in shown
    ]
    drawing = plot("Claims", "The table Claims has the values.", bars, linear_axis(100, " %"))
    caption = "How full they are." + _of_all(len(shown), len(known), "fullest")
    return _figure("Claims", caption, drawing)
