# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""The rows of a fleet's status as a page of text, and the tables of plain text that fit a terminal. Pure."""

from __future__ import annotations

import textwrap
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from ...module_utils._common.errors import printable
from . import rows
from .glance import OK, level
from .rows import Row, Status

WIDTH = 120
GAP = "  "
NARROWEST = 6  # no column is cut below this
NARROWEST_WRAPPED = 40  # what is read line by line
UNCUT = 10_000
WHOLE = frozenset({"problems", "went_back", "outcomes"})  # what kept or changed something is said whole
Source = str | Callable[[Any], object]  # of a cell: a field of the row, or a function of it
Columns = Sequence[tuple[str, Source]]  # with their headers


def size_words(count: int | None) -> str:
    """Bytes as a person reads them."""
    if count is None:
        return ""
    value = float(count)
    for unit in ("B", "KiB", "MiB", "GiB"):
        if value < 1024 or unit == "GiB":
            return f"{value:.0f} {unit}" if unit == "B" else f"{value:.1f} {unit}"
        value /= 1024
    return ""


def _node_state(row: rows.Node) -> str:
    state = "Ready" if row.ready else "NotReady"
    return f"{state}, {row.reason}" if row.reason else state


def _host_state(row: rows.Host) -> str:
    return "up" if row.reachable else f"offline {row.reason}"


def _used(row: rows.Claim) -> str:
    return size_words(row.used_bytes)


def _count(row: rows.Workload) -> str:
    return f"{row.ready}/{row.wanted}"


def rate_words(rate: float) -> str:
    """Three digits: what changes from one look to the next says nothing.

    >>> [rate_words(rate) for rate in (499.83, 10.04, 0.999, 0, 12345.6)]
    ['500 Hz', '10.0 Hz', '0.999 Hz', '0 Hz', '12346 Hz']
    """
    if rate <= 0:
        return "0 Hz"
    digits = 0 if rate >= 99.95 else 1 if rate >= 9.995 else 2 if rate >= 0.9995 else 3
    return f"{rate:.{digits}f} Hz"


def _rate(row: rows.Topic) -> str:
    return "" if row.rate is None else rate_words(row.rate)


def _promised(row: rows.Topic) -> str:
    """Marked where it is not kept; for that there is no colour on a terminal."""
    return f"{row.promised.min_rate:g} Hz{'' if level(row) == OK else ' not kept'}" if row.promised else ""


def _state(row: rows.RosNode) -> str:
    return "up" if row.reachable else f"down: {row.error or 'no answer'}"


def _unconnected(row: rows.Link) -> list[str]:
    return [f"{publisher} and {subscriber}" for publisher, subscriber in row.broken]


WORKLOAD = (("node", "nodes"), "restarts", ("image", "images"), "note")


def columns(*items: str | tuple[str, Source]) -> Columns:
    """A word alone is the header and the field."""
    return [(item, item) if isinstance(item, str) else item for item in items]


# Title, section, columns.
SECTIONS: Sequence[tuple[str, str, Columns]] = (
    ("PROBLEMS", "problems", columns("where", "what")),
    ("HOSTS", "hosts", columns(("host", "name"), "group", "address", "role", "cluster", ("state", _host_state))),
    ("NODES", "nodes", columns(
        ("node", "name"), ("state", _node_state), "version", "address", "roles", ("deploymentType", "placement"),
        "robot", ("other labels", "labels"),
    )),
    ("PLACEMENT", "placement", columns("node", ("deploymentType", "placement"), "runs")),
    ("ROS MASTERS", "masters", columns("robot", ("ready", _count), *WORKLOAD)),
    ("HELPERS", "helpers", columns("robot", ("helper", "name"), ("ready", _count), *WORKLOAD)),
    ("APPS", "apps", columns("robot", ("app", "name"), "placement", ("ready", _count), *WORKLOAD)),
    ("TAKEN BACK BY THE KEEPER", "went_back", columns(
        "robot", ("app", "name"), ("from", "before"), ("to", "after"), "at", "reason",
    )),
    ("ENDED IN LAUNCH FILES", "ended", columns("robot", "app", "node", "host")),
    ("ROS NODES", "ros_nodes", columns(
        "robot", ("node", "name"), ("on", "at"), ("state", _state), ("publishes", "publications"),
        ("subscribes", "subscriptions"), ("services", lambda row: len(row.services)),
    )),
    ("ROS GRAPHS", "links", columns(
        "robot", ("topic", "name"), "action", ("from", "publishers"), ("to", "subscribers"),
        ("not connected", _unconnected),
    )),
    ("TOPICS", "topics", columns(
        "robot", ("topic", "name"), "type", "publishers", "subscribers", "connections", ("rate", _rate),
        ("promised", _promised), "note",
    )),
    ("CLAIMS", "claims", columns(
        "robot", ("claim", "name"), ("state", "phase"), ("class", "storage_class"), "size", ("used", _used), "note",
    )),
    ("LAST OUTCOMES", "outcomes", columns("host", "outcome", ("run", "playbook"), "started", "changed", "note")),
    ("LAST UPDATE STEPS", "steps", columns(
        "robot", ("step", "name"), "handoff", "outcome", ("from", "before"), ("to", "after"), "seconds",
        ("waited for idle", "busy_wait"), "note",
    )),
)  # fmt: skip
OPTIONAL = frozenset(
    {"note", "other labels", "id", "promised", "not connected"}
)  # columns that go when nobody has anything in them
# Sections that are worth a line only when there is something in them.
ONLY_WITH_ROWS = frozenset({"problems", "helpers", "went_back", "ended", "links", "outcomes", "steps"})


def words(value: object) -> str:
    """A cell's text: one line of what may be printed, nothing for nothing."""
    if value is None or value == "":
        return "-"
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, float):
        return f"{value:.1f}"
    if isinstance(value, (list, tuple)):
        return ", ".join(words(item) for item in value) or "-"
    if isinstance(value, Mapping):
        return ", ".join(f"{key}={words(item)}" for key, item in value.items()) or "-"
    return printable(" ".join(str(value).split())) or "-"


def _cut(text: str, width: int) -> str:
    return text if len(text) <= width else text[: max(width - 2, 0)].rstrip() + ".."


def _fit(widths: list[int], room: int) -> list[int]:
    """Take from the widest column until all fit."""
    fitted = list(widths)
    while sum(fitted) > room and max(fitted) > NARROWEST:
        widest = fitted.index(max(fitted))
        rest = sorted(fitted)[-2] if len(fitted) > 1 else 0
        spare = sum(fitted) - room
        fitted[widest] = max(NARROWEST, min(fitted[widest] - 1, max(rest, fitted[widest] - spare)))
    return fitted


def table(
    headers: Sequence[str], rows: Sequence[Sequence[object]], width: int = WIDTH, wrapped: bool = False
) -> list[str]:
    """Lines of a table; what is too wide is cut, the widest column first. The last one may be `wrapped` instead."""
    cells = [[words(cell) for cell in row] for row in rows]
    natural = [max(len(line[column]) for line in [list(headers), *cells]) for column in range(len(headers))]
    widths = _fit(natural, width - len(GAP) * (len(headers) - 1))
    if wrapped:
        widths[-1] = max(widths[-1], min(natural[-1], NARROWEST_WRAPPED))
    lines = [line for row in [list(headers), *cells] for line in (_wrapped(row, widths[-1]) if wrapped else [row])]
    return [GAP.join(_cut(cell, size).ljust(size) for cell, size in zip(line, widths)).rstrip() for line in lines]


def _wrapped(row: Sequence[str], width: int) -> list[list[str]]:
    """The row, and one for each further line of its last cell."""
    first, *more = textwrap.wrap(row[-1], width) or [""]
    return [[*row[:-1], first], *([*("" for _cell in row[:-1]), line] for line in more)]


def _cell(row: Row, source: Source) -> object:
    return source(row) if callable(source) else getattr(row, source)


def grid(columns: Columns, rows: Sequence[Row]) -> tuple[list[str], list[list[object]]]:
    """Headers and cells of the columns that are shown; the same for every rendering."""
    shown = [
        (header, source)
        for header, source in columns
        if header not in OPTIONAL or any(_cell(row, source) for row in rows)
    ]
    return [header for header, _source in shown], [[_cell(row, source) for _header, source in shown] for row in rows]


def _section(title: str, columns: Columns, rows: Sequence[Row], width: int) -> list[str]:
    if not rows:
        return [title, "  none", ""]
    lines = table(*grid(columns, rows), width - 2)
    return [title, *(f"  {line}" for line in lines), ""]


def status_text(status: Status, width: int = WIDTH) -> str:
    """All tables. A section without rows says so, where it is worth a line."""
    lines: list[str] = []
    for title, key, columns in SECTIONS:
        if status.rows(key) or key not in ONLY_WITH_ROWS:
            lines += _section(title, columns, status.rows(key), UNCUT if key in WHOLE else width)
    return "\n".join(lines).rstrip() + "\n"
