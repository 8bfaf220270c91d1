# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""What a person sees of a fleet on the screen before any table: what needs attention, and how many of what. Pure."""

from __future__ import annotations

from collections.abc import Iterator
from datetime import datetime

from .attention import Finding, attention
from .glance import BAD, counts
from .rows import Status
from .text import words

TABLES = "All tables: the same with -v."


def summary_text(status: Status, now: str, name: str = "") -> str:
    """Findings are said whole, however long the line. `now` is as in 2026-11-21T09:07:52Z, `name` is the fleet's."""
    findings = attention(status)
    lines = [*([f"FLEET {words(name)}", ""] if name else []), "NEEDS ATTENTION"]
    for finding in findings:
        lines += _finding(finding, now)
    lines += ["  nothing"] if not findings else []
    found = counts(status)
    size = max((len(count.label) for count in found), default=0)
    lines += ["", "SUMMARY"]
    lines += [f"  {count.label.lower() if count.label[:3] != 'ROS' else count.label:<{size}}  {words(count.words)}"
              for count in found] or ["  nothing was found"]  # fmt: skip
    return "\n".join(lines) + "\n"


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


def since_words(since: str, now: str) -> str:
    """A time, and how long ago that is.

    >>> since_words("2026-11-21T09:00:00Z", "2026-11-21T09:12:30Z")
    '2026-11-21 09:00:00 UTC (12 min)'
    """
    try:
        seconds = (datetime.fromisoformat(now) - datetime.fromisoformat(since)).total_seconds()
    except (ValueError, TypeError):
        return since
    ago = next((f"{seconds // size:.0f} {unit}" for unit, size in _UNITS if seconds >= 2 * size), "just now")
    return f"{since.replace('T', ' ').replace('Z', ' UTC')} ({ago})"


_UNITS = (("d", 86400), ("h", 3600), ("min", 60), ("s", 1))
