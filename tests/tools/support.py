# SPDX-License-Identifier: GPL-3.0-or-later
"""Which pinned parts are past the end of their support, by the table in docs/versions.md; as warnings for a job's page.

python tests/tools/support.py
"""

from __future__ import annotations

import datetime
import re
from pathlib import Path

PAGE = Path(__file__).resolve().parents[2] / "docs" / "versions.md"
ROW = re.compile(r"^\| ([\w-]+) \| (v?\d\S*) \| (\d{4}-\d\d-\d\d|not said) \|", re.MULTILINE)


def rows(page: str) -> dict[str, tuple[str, str]]:
    """Part -> version, and the day on which its support ends, or `not said`."""
    return {part: (version, end) for part, version, end in ROW.findall(page)}


def past(page: str, today: datetime.date) -> list[str]:
    """One line for each part whose support has ended."""
    return [
        f"{part} {version}: its support ended on {end}"
        for part, (version, end) in rows(page).items()
        if end != "not said" and datetime.date.fromisoformat(end) < today
    ]


if __name__ == "__main__":
    for line in past(PAGE.read_text(encoding="utf-8"), datetime.datetime.now(datetime.UTC).date()):
        print(f"::warning file=docs/versions.md::{line}")
