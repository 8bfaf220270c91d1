# SPDX-License-Identifier: GPL-3.0-or-later
"""Logs of JSON lines, as the applications write them. Pure."""

from __future__ import annotations

import json
from typing import Any

Lines = list[dict[str, Any]]


def lines(text: str) -> Lines:
    """The records of a log; a line torn by a kill is passed over, as the applications themselves do."""
    found = []
    for line in text.splitlines():
        try:
            record = json.loads(line)
        except ValueError:
            continue
        if isinstance(record, dict) and isinstance(record.get("time"), (int, float)):
            found.append(record)
    return found
