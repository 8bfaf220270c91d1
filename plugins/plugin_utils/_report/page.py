# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""The rows of a fleet's status as one HTML file that needs nothing else: no script, no server, no network.

How it looks is `page.html.j2`. The sections and columns are those of the page of text. All that comes from elsewhere is
escaped, and a policy in the page forbids a browser to run or to fetch anything, should something get through.
"""

from __future__ import annotations

import base64
import hashlib
import re
from collections.abc import Collection, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

from jinja2 import Environment, FileSystemLoader, StrictUndefined
from markupsafe import Markup

from .attention import attention
from .glance import counts, host_lines, hosts_off, level
from .rows import Row, Status
from .text import SECTIONS, Columns, Source, columns, grid, rate_words, words

UNFOLDED = 40  # a table of more rows is folded until somebody wants it
LONG = 28  # characters of a word from which it may be broken anywhere
NUMBERS = frozenset({
    "restarts", "publishes", "subscribes", "services", "publishers", "subscribers", "connections", "rate", "size",
    "used", "changed", "seconds", "waited for idle", "topics", "messages/s",
})  # fmt: skip
NAMES = frozenset({"app", "helper", "node", "topic", "claim", "step"})
# What a terminal has no room for.
MORE_COLUMNS: Mapping[str, Columns] = {"steps": [("phases, s", "phases"), ("id", "id")]}
COLUMNS: Mapping[tuple[str, str], Source] = {
    ("outcomes", "started"): lambda row: _when(row.started),
}
HOST_COLUMNS = columns(
    "host", "group", "state", "node", "master", ("apps ready", "apps"), ("ROS nodes up", "ros_nodes"), "topics",
    ("messages/s", lambda row: "" if row.messages is None else rate_words(row.messages)[: -len(" Hz")]),
    ("last outcome", "outcome"),
)  # fmt: skip
_MADE = re.compile(r'<time id="made"[^>]*>[^<]*</time>')
# control characters, halves of surrogate pairs, and the two that are no characters at all
_NOT_TEXT = re.compile("[\x00-\x08\x0b\x0c\x0e-\x1f\x7f-\x9f\ud800-\udfff\ufffe\uffff]")


class Section(NamedTuple):
    """A table with its heading. `levels` are those of the rows, `naming` is the column that names a row."""

    key: str
    title: str
    headers: Sequence[str]
    lines: Sequence[Sequence[str]]
    levels: Sequence[str]
    naming: int


def status_page(status: Status, made: str, previous: str = "", limit: str = "", name: str = "") -> str:
    """The page. `made` is when, as in 2026-11-21T09:07:52Z, `limit` is what a run was limited to, `name` the fleet's.

    With the text of the `previous` page that one is returned when nothing but the time is new.
    """
    page = _rendered(status, made, limit, name)
    return previous if _MADE.sub("", previous) == _MADE.sub("", page) else page


def _rendered(status: Status, made: str, limit: str, name: str) -> str:
    environment = Environment(
        loader=FileSystemLoader(Path(__file__).parent),
        autoescape=True,
        undefined=StrictUndefined,
        finalize=_text,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    environment.filters.update(digest=_digest, when=_when, words=words)
    environment.tests["long"] = lambda text: any(len(word) >= LONG for word in text.split())
    off = hosts_off(status)
    sections = [
        _section(key, _titled(title), shown, status.rows(key), off)
        for title, key, shown in SECTIONS
        if key != "problems"
    ]
    return environment.get_template("page.html.j2").render(
        made=made,
        limit=limit,
        title=f"{words(name)}: fleet status" if name else "Fleet status",
        counts=counts(status),
        attention=attention(status),
        hosts=_section("glance", "By host", HOST_COLUMNS, host_lines(status)),
        sections=sections,
        numbers=NUMBERS,
        unfolded=UNFOLDED,
    )


def _section(key: str, title: str, given: Columns, rows: Sequence[Row], off: Collection[str] = ()) -> Section:
    shown = [(header, COLUMNS.get((key, header), source)) for header, source in given]
    headers, lines = grid([*shown, *MORE_COLUMNS.get(key, ())], rows)
    # the first column names a row, but for the robot, where many rows share that
    naming = 1 if headers[:1] == ["robot"] and headers[1] in NAMES else 0
    cells = [[words(cell) for cell in line] for line in lines]
    return Section(key, title, headers, cells, [level(row, off) for row in rows], naming)


def _titled(title: str) -> str:
    """`ROS NODES` as a heading: words that are names stay as they are."""
    first, *rest = title.split()
    return " ".join([first if first == "ROS" else first.capitalize(), *(word.lower() for word in rest)])


def _when(time: str) -> str:
    return time.replace("T", " ").replace("Z", " UTC")


def _text(value: object) -> object:
    """What the template writes, without what no HTML document may hold."""
    return value if isinstance(value, Markup) else _NOT_TEXT.sub("\ufffd", str(value))


def _digest(style: str) -> str:
    """By which the page's policy knows the page's own style."""
    return base64.b64encode(hashlib.sha256(style.encode()).digest()).decode()
