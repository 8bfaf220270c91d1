# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Rows as an HTML table that a screen reader can walk through and that is a list of cards on a phone. Pure."""

from __future__ import annotations

from typing import Any, Mapping, Sequence

from ansible_collections.rosops.fleet.plugins.plugin_utils._report.glance import BAD, WARN
from ansible_collections.rosops.fleet.plugins.plugin_utils._report.svg import escaped
from ansible_collections.rosops.fleet.plugins.plugin_utils._report.table import words
from ansible_collections.rosops.fleet.plugins.plugin_utils._report.text import Columns, grid

NUMBERS = frozenset(
    {
        "restarts",
        "publishes",
        "subscribes",
        "services",
        "publishers",
        "subscribers",
        "connections",
        "rate",
        "size",
        "used",
        "changed",
        "seconds",
        "waited for idle",
        "topics",
        "messages/s",
    }
)
NAMES = frozenset({"app", "node", "topic", "claim", "step"})
LONG = 28  # characters of a word from which it may be broken anywhere


# The roles say again what the elements are: on a phone the style makes blocks of them, and then they are no tables.
def html_table(name: str, columns: Columns, rows: Sequence[Mapping[str, Any]], levels: Sequence[str]) -> str:
    headers, cells = grid(columns, rows)
    head = "".join(f'<th scope="col" role="columnheader"{_number(header)}>{escaped(header)}</th>' for header in headers)
    body = "".join(
        f'<tr role="row"{_class(of)}>'
        + "".join(_cell(number == _naming(headers), header, value)
                  for number, (header, value) in enumerate(zip(headers, line)))
        + "</tr>\n"
        for of, line in zip(levels, cells)
    )  # fmt: skip
    return (
        # in the order of the tab key, so that what is too wide can be seen without a mouse
        f'<div class="wide" role="region" aria-label="{escaped(name)}" tabindex="0">'
        f'<table role="table"><caption>{escaped(name)}</caption>'
        f'<thead role="rowgroup"><tr role="row">{head}</tr></thead>'
        f'<tbody role="rowgroup">{body}</tbody></table></div>'
    )


def _naming(headers: Sequence[str]) -> int:
    """The column that names a row: the first one but for the robot, where many rows share that."""
    return 1 if headers[:1] == ["robot"] and headers[1] in NAMES else 0


def _long(text: str) -> bool:
    return any(len(word) >= LONG for word in text.split())


def _class(of: str) -> str:
    return f' class="{of}"' if of in (WARN, BAD) else ""


def _number(header: str) -> str:
    return ' class="number"' if header in NUMBERS else ""


def _cell(names_row: bool, header: str, value: Any) -> str:
    text, label = words(value), f' data-label="{escaped(header)}"'
    if names_row:
        more = ' class="long"' if _long(text) else ""
        return f'<th scope="row" role="rowheader"{label}{more}><span>{escaped(text)}</span></th>'
    classes = [
        name for name, so in (("number", header in NUMBERS), ("nothing", text == "-"), ("long", _long(text))) if so
    ]
    more = f' class="{" ".join(classes)}"' if classes else ""
    return f'<td role="cell"{label}{more}><span>{escaped(text)}</span></td>'
