# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Plain text tables that fit a terminal. Pure."""

from __future__ import annotations

from typing import Any, Sequence

WIDTH = 120
GAP = "  "
NARROWEST = 6  # no column is cut below this


def words(value: Any) -> str:
    """A cell's text: one line, nothing for nothing."""
    if value is None or value == "":
        return "-"
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, float):
        return f"{value:.1f}"
    if isinstance(value, (list, tuple)):
        return ", ".join(words(item) for item in value) or "-"
    if isinstance(value, dict):
        return ", ".join(f"{key}={words(item)}" for key, item in value.items()) or "-"
    return " ".join(str(value).split()) or "-"


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


def table(headers: Sequence[str], rows: Sequence[Sequence[Any]], width: int = WIDTH) -> list[str]:
    """Lines of a table; what is too wide is cut, the widest column first."""
    cells = [[words(cell) for cell in row] for row in rows]
    natural = [max(len(line[column]) for line in [list(headers), *cells]) for column in range(len(headers))]
    widths = _fit(natural, width - len(GAP) * (len(headers) - 1))
    lines = [list(headers), *cells]
    return [GAP.join(_cut(cell, size).ljust(size) for cell, size in zip(line, widths)).rstrip() for line in lines]
