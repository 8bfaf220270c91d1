# SPDX-License-Identifier: GPL-3.0-or-later
"""A fleet's status as text: what needs attention and how many of what, the rows as tables that fit a terminal. Pure."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from datetime import datetime
from operator import attrgetter
from typing import Any

from ...module_utils._common.errors import printable
from .attention import Finding, attention
from .glance import counts, level
from .rows import BAD, OK, Row, Status, Topic

WIDTH = 120
GAP = "  "
NARROWEST = 6  # no column is cut below this
UNCUT = 10_000
TABLES = "All tables: the same with -v."
WHOLE = frozenset({"problems", "went_back", "outcomes"})  # what kept or changed something is said whole
Columns = Sequence[tuple[str, Callable[[Any], object]]]  # headers, and what makes a cell of a row


def size_words(count: int | None) -> str:
    """Bytes as a person reads them."""
    if count is None:
        return ""
    power = min(max(count.bit_length() - 1, 0) // 10, 3)
    return f"{count / 1024**power:.{min(power, 1)}f} {('B', 'KiB', 'MiB', 'GiB')[power]}"


def rate_words(rate: float) -> str:
    """Three digits, as `10.0 Hz`: what changes from one look to the next says nothing."""
    if rate <= 0:
        return "0 Hz"
    digits = 0 if rate >= 99.95 else 1 if rate >= 9.995 else 2 if rate >= 0.9995 else 3
    return f"{rate:.{digits}f} Hz"


def _promised(row: Topic) -> str:
    """Marked where it is not kept; for that there is no colour on a terminal."""
    return f"{row.promised.min_rate:g} Hz{'' if level(row) == OK else ' not kept'}" if row.promised else ""


WORKLOAD = (
    ("ready", lambda row: f"{row.ready}/{row.wanted}"), ("node", "nodes"), "restarts", ("image", "images"), "note",
)  # fmt: skip


def columns(*items: str | tuple[str, str | Callable[[Any], object]]) -> Columns:
    """A word alone is the header and the field of the row."""
    pairs = [(item, item) if isinstance(item, str) else item for item in items]
    return [(header, attrgetter(of) if isinstance(of, str) else of) for header, of in pairs]


# Title, section, columns.
SECTIONS: Sequence[tuple[str, str, Columns]] = (
    ("PROBLEMS", "problems", columns("where", "what")),
    ("HOSTS", "hosts", columns(
        ("host", "name"), "group", "address", "role", "cluster",
        ("state", lambda row: "up" if row.reachable else f"offline {row.reason}"),
    )),
    ("NODES", "nodes", columns(
        ("node", "name"),
        ("state", lambda row: ("Ready" if row.ready else "NotReady") + (f", {row.reason}" if row.reason else "")),
        "version", "address", "roles", ("deploymentType", "placement"), "robot", ("other labels", "labels"),
    )),
    ("ROS MASTERS", "masters", columns("robot", *WORKLOAD)),
    ("HELPERS", "helpers", columns("robot", ("helper", "name"), *WORKLOAD)),
    ("APPS", "apps", columns("robot", ("app", "name"), "placement", *WORKLOAD)),
    ("TAKEN BACK BY THE KEEPER", "went_back", columns(
        "robot", ("app", "name"), ("from", "before"), ("to", "after"), "at", "reason",
    )),
    ("ENDED IN LAUNCH FILES", "ended", columns("robot", "app", "node", "host")),
    ("ROS NODES", "ros_nodes", columns(
        "robot", ("node", "name"), ("on", "at"),
        ("state", lambda row: "up" if row.reachable else f"down: {row.error or 'no answer'}"),
        ("publishes", "publications"), ("subscribes", "subscriptions"), ("services", lambda row: len(row.services)),
    )),
    ("ROS GRAPHS", "links", columns(
        "robot", ("topic", "name"), "action", ("from", "publishers"), ("to", "subscribers"),
        ("not connected", lambda row: [" and ".join(pair) for pair in row.broken]),
    )),
    ("TOPICS", "topics", columns(
        "robot", ("topic", "name"), "type", "publishers", "subscribers", "connections",
        ("rate", lambda row: "" if row.rate is None else rate_words(row.rate)), ("promised", _promised), "note",
    )),
    ("CLAIMS", "claims", columns(
        "robot", ("claim", "name"), ("state", "phase"), ("class", "storage_class"), "size",
        ("used", lambda row: size_words(row.used_bytes)), "note",
    )),
    ("LAST OUTCOMES", "outcomes", columns(
        "host", "outcome", ("run", "playbook"), ("started", lambda row: when(row.started)), "changed", "note",
    )),
    ("LAST UPDATE STEPS", "steps", columns(
        "robot", ("step", "name"), "handoff", "outcome", ("from", "before"), ("to", "after"), "seconds",
        ("waited for idle", "busy_wait"), "note",
    )),
)  # fmt: skip
# As headings: words that are names stay as they are.
TITLES = {key: title.capitalize().replace("Ros ", "ROS ") for title, key, _columns in SECTIONS}
# columns that go when nobody has anything in them
OPTIONAL = frozenset({"note", "other labels", "promised", "not connected"})
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
        return ", ".join(f"{words(key)}={words(item)}" for key, item in value.items()) or "-"
    return printable(" ".join(str(value).split())) or "-"


def _cut(text: str, width: int) -> str:
    return text if len(text) <= width else text[: max(width - 2, 0)].rstrip() + ".."


def _fit(widths: list[int], room: int) -> list[int]:
    """Take from the widest column until all fit."""
    fitted = list(widths)
    while sum(fitted) > room and max(fitted) > NARROWEST:
        fitted[fitted.index(max(fitted))] -= 1
    return fitted


def table(headers: Sequence[str], rows: Sequence[Sequence[object]], width: int = UNCUT) -> list[str]:
    """Lines of a table; what is too wide is cut, the widest column first."""
    cells = [[words(cell) for cell in row] for row in rows]
    natural = [max(len(line[column]) for line in [list(headers), *cells]) for column in range(len(headers))]
    widths = _fit(natural, width - len(GAP) * (len(headers) - 1))
    lines = [list(headers), *cells]
    return [GAP.join(_cut(cell, size).ljust(size) for cell, size in zip(line, widths)).rstrip() for line in lines]


def grid(columns: Columns, rows: Sequence[Row]) -> tuple[list[str], list[list[object]]]:
    """Headers and cells of the columns that are shown; the same for every rendering."""
    cells = {header: [source(row) for row in rows] for header, source in columns}
    shown = {header: found for header, found in cells.items() if header not in OPTIONAL or any(found)}
    return list(shown), [list(line) for line in zip(*shown.values())]


def status_text(status: Status) -> str:
    """All tables. A section without rows says so, where it is worth a line."""
    lines: list[str] = []
    for title, key, columns in SECTIONS:
        if rows := status.rows(key):
            wide = UNCUT if key in WHOLE else WIDTH - 2
            lines += [title, *(f"  {line}" for line in table(*grid(columns, rows), wide)), ""]
        elif key not in ONLY_WITH_ROWS:
            lines += [title, "  none", ""]
    return "\n".join(lines).rstrip() + "\n"


# ---- before any table


def summary_text(status: Status, now: str, name: str = "") -> str:
    """Findings are said whole, however long the line. `now` is as in 2026-11-21T09:07:52Z, `name` is the fleet's."""
    head = [f"FLEET {words(name)}", ""] if name else []
    told = [line for finding in attention(status) for line in _finding(finding, now)] or ["  nothing"]
    found = counts(status)
    labels = [title if (title := TITLES[count.section])[:3] == "ROS" else title.lower() for count in found]
    size = max(map(len, labels), default=0)
    counted = [f"  {label:<{size}}  {words(one.words)}" for label, one in zip(labels, found)] or ["  nothing was found"]
    return "\n".join([*head, "NEEDS ATTENTION", *told, "", "SUMMARY", *counted]) + "\n"


def _finding(finding: Finding, now: str) -> Iterator[str]:
    told = finding.told
    yield f"  {'x' if finding.level == BAD else '!'} {words(told.where)}: {words(told.what)}"
    for label, text in (
        ("since", since_words(told.since, now)),
        ("with it", "; ".join(finding.takes)),
        ("do", told.todo),
        ("see", finding.link),
    ):
        if text:
            yield f"      {label:<8} {words(text)}"


def when(time: str) -> str:
    return time.replace("T", " ").replace("Z", " UTC")


def since_words(since: str, now: str) -> str:
    """A time, and how long ago that is: `2026-11-21 09:00:00 UTC (12 min)`."""
    try:
        seconds = (datetime.fromisoformat(now) - datetime.fromisoformat(since)).total_seconds()
    except (ValueError, TypeError):
        return since
    ago = next((f"{seconds // size:.0f} {unit}" for unit, size in _UNITS if seconds >= 2 * size), "just now")
    return f"{when(since)} ({ago})"


_UNITS = (("d", 86400), ("h", 3600), ("min", 60), ("s", 1))
