# SPDX-License-Identifier: GPL-3.0-or-later
"""The rows of a fleet's status as one HTML file that needs nothing else: no script, no server, no network.

How it looks is `page.html.j2`. The sections and columns are those of the page of text. All that comes from elsewhere is
escaped, and a policy in the page forbids a browser to run or to fetch anything, should something get through.
"""

from __future__ import annotations

import base64
import hashlib
import re
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from jinja2 import Environment, FileSystemLoader, StrictUndefined
from markupsafe import Markup

from ...module_utils._common.documents import Data
from .attention import attention
from .glance import counts, host_level, hosts_off, level, share
from .rows import Host, Row, Status
from .text import SECTIONS, TITLES, Columns, columns, grid, rate_words, when, words

UNFOLDED = 40  # a table of more rows is folded until somebody wants it
LONG = 28  # characters of a word from which it may be broken anywhere
NUMBERS = frozenset({
    "restarts", "publishes", "subscribes", "services", "publishers", "subscribers", "connections", "rate", "size",
    "used", "changed", "seconds", "waited for idle", "topics", "messages/s",
})  # fmt: skip
NAMES = frozenset({"app", "helper", "node", "topic", "claim", "step"})
_MADE = re.compile(r'<time id="made"[^>]*>[^<]*</time>')
# control characters, halves of surrogate pairs, and the two that are no characters at all
_NOT_TEXT = re.compile("[\x00-\x08\x0b\x0c\x0e-\x1f\x7f-\x9f\ud800-\udfff\ufffe\uffff]")


def status_page(status: Status, made: str, previous: str = "", limit: str = "", name: str = "") -> str:
    """The page. `made` is when, as in 2026-11-21T09:07:52Z, `limit` is what a run was limited to, `name` the fleet's.

    With the text of the `previous` page that one is returned when nothing but the time is new.
    """
    loader = FileSystemLoader(Path(__file__).parent)
    environment = Environment(
        trim_blocks=True, lstrip_blocks=True, keep_trailing_newline=True,
        loader=loader, autoescape=True, undefined=StrictUndefined, finalize=_text,
    )  # fmt: skip
    environment.filters.update(digest=_digest, when=when, words=words)
    environment.tests["long"] = lambda text: any(len(word) >= LONG for word in text.split())
    off = hosts_off(status)
    sections = [
        _section(key, TITLES[key], shown, status.rows(key), lambda row: level(row, off))
        for _title, key, shown in SECTIONS
        if key != "problems"
    ]
    page = environment.get_template("page.html.j2").render(
        made=made,
        limit=limit,
        title=f"{words(name)}: fleet status" if name else "Fleet status",
        counts=counts(status),
        titles=TITLES,
        attention=attention(status),
        hosts=_section("glance", "By host", host_columns(status), status.hosts, partial(host_level, status)),
        sections=sections,
        numbers=NUMBERS,
        unfolded=UNFOLDED,
    )
    return previous if _MADE.sub("", previous) == _MADE.sub("", page) else page


def host_columns(status: Status) -> Columns:
    """Of a line per host: what runs for it, as shares that are in order, and what became of it."""
    nodes = {row.name: "Ready" if row.ready else "NotReady" for row in status.nodes}
    outcomes = {row.host: row.outcome for row in status.outcomes}
    rates = {host.name: [row.rate or 0.0 for row in status.topics if row.robot == host.name] for host in status.hosts}

    def messages(host: Host) -> str:
        rate = sum(rates[host.name])
        return rate_words(rate).removesuffix(" Hz") if rate else ""

    return columns(
        ("host", "name"), "group", ("state", lambda host: "up" if host.reachable else "offline"),
        ("node", lambda host: nodes.get(host.name)), ("master", lambda host: share(status.masters, host.name)),
        ("apps ready", lambda host: share(status.apps, host.name)),
        ("ROS nodes up", lambda host: share(status.ros_nodes, host.name)),
        ("topics", lambda host: len(rates[host.name]) or None), ("messages/s", messages),
        ("last outcome", lambda host: outcomes.get(host.name)),
    )  # fmt: skip


def _section(key: str, title: str, given: Columns, rows: Sequence[Row], level_of: Callable[[Any], str]) -> Data:
    """A table with its heading. `naming` is the column that names a row."""
    headers, lines = grid(given, rows)
    # the first column names a row, but for the robot, where many rows share that
    naming = 1 if headers[:1] == ["robot"] and headers[1] in NAMES else 0
    about = {"key": key, "title": title, "headers": headers, "naming": naming, "levels": [*map(level_of, rows)]}
    return {**about, "lines": [[words(cell) for cell in line] for line in lines]}


def _text(value: object) -> object:
    """What the template writes, without what no HTML document may hold."""
    return value if isinstance(value, Markup) else _NOT_TEXT.sub("\ufffd", str(value))


def _digest(style: str) -> str:
    """By which the page's policy knows the page's own style."""
    return base64.b64encode(hashlib.sha256(style.encode()).digest()).decode()
