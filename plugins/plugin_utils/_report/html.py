# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""The rows of `_status` as one HTML file that needs nothing else: no script, no server, no network. Pure.

The sections and columns are those of the page of text. All that comes from elsewhere goes through `escaped`, and a
policy in the page forbids a browser to run or to fetch anything, should something get through.
"""

from __future__ import annotations

import base64
import hashlib
import re
from typing import Any, Collection, Mapping, Sequence

from ansible_collections.rosops.fleet.plugins.plugin_utils._report.glance import (
    BAD,
    OK,
    WARN,
    attention,
    counts,
    host_lines,
    hosts_off,
    level,
)
from ansible_collections.rosops.fleet.plugins.plugin_utils._report.html_plots import plots, rate_words
from ansible_collections.rosops.fleet.plugins.plugin_utils._report.html_style import STYLE
from ansible_collections.rosops.fleet.plugins.plugin_utils._report.html_table import html_table
from ansible_collections.rosops.fleet.plugins.plugin_utils._report.svg import escaped
from ansible_collections.rosops.fleet.plugins.plugin_utils._report.table import words
from ansible_collections.rosops.fleet.plugins.plugin_utils._report.text import SECTIONS, Columns

Rows = Sequence[Mapping[str, Any]]
Status = Mapping[str, Rows]

POLICY = "default-src 'none'; style-src 'sha256-{}'; img-src data:; base-uri 'none'; form-action 'none'"
UNFOLDED = 40  # a table of more rows is folded until somebody wants it
MARKS = {OK: "✓", WARN: "!", BAD: "✗"}
SAID = {OK: "in order", WARN: "needs a look", BAD: "needs attention"}
# What a terminal has no room for.
MORE_COLUMNS: Mapping[str, Columns] = {"steps": [("phases, s", "phases"), ("id", "id")]}
# A rate with the digits that mean something, so that a page is new only when the fleet is.
COLUMNS: Mapping[tuple[str, str], Any] = {
    ("outcomes", "started"): lambda row: _when(str(row.get("started", ""))),
    ("topics", "rate"): lambda row: "" if row.get("rate") is None else rate_words(float(row["rate"])),
}
NONE = {
    "steps": "No update has been reported yet.",
    "outcomes": "No run has been reported yet. The callback fleet_report writes one at the end of each.",
}
HOST_COLUMNS: Columns = [
    ("host", "host"),
    ("group", "group"),
    ("state", "state"),
    ("node", "node"),
    ("master", "master"),
    ("apps ready", "apps"),
    ("ROS nodes up", "ros_nodes"),
    ("topics", "topics"),
    ("messages/s", lambda row: "" if row["messages"] is None else rate_words(row["messages"])[: -len(" Hz")]),
    ("last outcome", "outcome"),
]
_MADE = re.compile(r'<time id="made"[^>]*>[^<]*</time>')


def status_html(status: Status, made: str, previous: str = "", limit: str = "") -> str:
    """The page. `made` is when, as in 2026-11-21T09:07:52Z, `limit` is what a run was limited to.

    With the text of the `previous` page that one is returned when nothing but the time is new.
    """
    page = _page(status, made, limit)
    return previous if _MADE.sub("", previous) == _MADE.sub("", page) else page


def _page(status: Status, made: str, limit: str) -> str:
    only = f"<p>Only a part of the fleet was looked at: <code>{escaped(limit)}</code></p>" if limit else ""
    off = hosts_off(status)
    tables = [_section(title, key, columns, status[key], off) for title, key, columns in SECTIONS
              if status.get(key) is not None and key != "problems"]  # fmt: skip
    places = [("problems", "Needs attention"), ("glance", "By host"), ("plots", "Plots")]
    places += [(key, _titled(title)) for title, key, _columns in SECTIONS if status.get(key) and key != "problems"]
    links = "".join(f'<li><a href="#{key}">{escaped(name)}</a></li>' for key, name in places)
    digest = base64.b64encode(hashlib.sha256(STYLE.encode()).digest()).decode()
    return "\n".join(
        [
            '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">',
            f'<meta http-equiv="Content-Security-Policy" content="{POLICY.format(digest)}">',
            '<meta name="viewport" content="width=device-width, initial-scale=1">',
            # names and addresses of hosts are nobody else's business
            '<meta name="referrer" content="no-referrer">\n<meta name="robots" content="noindex">',
            f'<link rel="icon" href="data:,">\n<title>Fleet status</title>\n<style>{STYLE}</style>\n</head>\n<body>',
            '<a class="skip" href="#content">To the content</a>',
            f'<header><h1>Fleet status</h1>\n<p>As of <time id="made" datetime="{escaped(made)}">'
            f"{escaped(_when(made))}</time></p>{only}",
            f'<nav aria-label="Sections"><ul>{links}</ul></nav></header>\n<main id="content">',
            _tiles(status),
            _attention(status),
            _hosts(status),
            _plots(status),
            *tables,
            "</main>\n</body>\n</html>\n",
        ]
    )


def _when(time: str) -> str:
    return time.replace("T", " ").replace("Z", " UTC")


def _titled(title: str) -> str:
    """`ROS NODES` as a heading: words that are names stay as they are."""
    first, *rest = title.split()
    return " ".join([first if first == "ROS" else first.capitalize(), *(word.lower() for word in rest)])


def _mark(of: str) -> str:
    return f'<span class="mark" role="img" aria-label="{SAID[of]}">{MARKS[of]}</span>'


def _tiles(status: Status) -> str:
    tiles = "".join(
        f'<li><a class="{one["level"]}" href="#{one["section"]}"><strong>{_mark(one["level"])} '
        f"{one['good']}/{one['total']}</strong>{escaped(one['label'])}</a></li>"
        for one in counts(status)
    )
    return f'<ul class="tiles" aria-label="Counts">{tiles}</ul>' if tiles else "<p>Nothing was found.</p>"


def _attention(status: Status) -> str:
    found = attention(status)
    items = "".join(
        f'<li class="{one["level"]}">{_mark(one["level"])} <strong>{escaped(words(one["where"]))}</strong>: '
        f"{escaped(words(one['what']))}</li>"
        for one in found
    )
    said = f'<ul class="wants">{items}</ul>' if items else "<p>Nothing that was looked at.</p>"
    return f'<section id="problems"><h2>Needs attention</h2> <span class="count">{len(found)}</span>{said}</section>'


def _hosts(status: Status) -> str:
    lines = host_lines(status)
    return _folded("By host", "glance", HOST_COLUMNS, lines, [str(line["level"]) for line in lines])


def _plots(status: Status) -> str:
    made = "".join(plots(status))
    return f'<section class="plots" id="plots" aria-label="Plots">{made}</section>'


def _section(title: str, key: str, columns: Columns, rows: Rows, off: Collection[str]) -> str:
    shown = [(header, COLUMNS.get((key, header), source)) for header, source in columns]
    levels = [level(key, row, off) for row in rows]
    return _folded(_titled(title), key, [*shown, *MORE_COLUMNS.get(key, ())], rows, levels)


def _folded(name: str, key: str, columns: Columns, rows: Rows, levels: Sequence[str]) -> str:
    """A section whose table can be folded away; a long one is until somebody wants it."""
    count = f'<span class="count">{len(rows)}</span>'
    if not rows:
        said = escaped(NONE.get(key, "None."))
        return f'<section id="{key}"><h2>{escaped(name)}</h2> {count}<p class="soft">{said}</p></section>'
    unfolded = " open" if len(rows) <= UNFOLDED else ""
    return (
        f'<section id="{key}"><details{unfolded}><summary><h2>{escaped(name)}</h2> {count}</summary>'
        f"{html_table(name, columns, rows, levels)}</details></section>"
    )
