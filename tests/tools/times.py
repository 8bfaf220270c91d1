# SPDX-License-Identifier: GPL-3.0-or-later
"""How long the targets of make take, as a run wrote it: in `make help` and in docs/developing.md.

    python tests/tools/times.py keep    reports/stages/times.json, which the last run of `make test` or `make test-all`
                                        wrote, into tests/times.json, and from there into the page
    python tests/tools/times.py help    `make help`'s list, from the Makefile's and the kept times

A stage runs beside those of the other lane, so its time is that of one busy core of the two.
"""

from __future__ import annotations

import json
import re
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

CHECKOUT = Path(__file__).resolve().parents[2]
WRITTEN = CHECKOUT / "reports" / "stages" / "times.json"
KEPT = CHECKOUT / "tests" / "times.json"
PAGE = CHECKOUT / "docs" / "developing.md"
TARGET = re.compile(r"^([a-z0-9-]+):.*?## (.*)$", re.MULTILINE)
ROW = re.compile(r"^(\| `make ([a-z-]+)` \|.*\| )([^|]*)( \|)$", re.MULTILINE)


def merged(kept: Mapping[str, int], run: Mapping[str, Any], whole: str) -> dict[str, int]:
    """The kept seconds with those of a run, of which `whole` was the target; what the run has not stays."""
    of_all = {} if run["whole"] is None else {whole: run["whole"]}
    return dict(sorted({**kept, **run["stages"], **of_all}.items()))


def words(seconds: int) -> str:
    """As a reader wants it: 20 s, 3 min, 1.5 h."""
    if seconds < 90:
        return f"{max(seconds, 1)} s"
    return f"{seconds / 60:.0f} min" if seconds < 5400 else f"{seconds / 3600:.1f} h"


def listed(makefile: str, times: Mapping[str, int]) -> str:
    """Each target with its time, if a run has written one, and what it is for."""
    return "\n".join(
        f"  {name:<22} {words(times[name]) if name in times else '':>6}  {text}"
        for name, text in TARGET.findall(makefile)
    )


def page(text: str, times: Mapping[str, int]) -> str:
    """The page with the times in the last column of its rows `make TARGET`; a row without a time keeps its words."""
    return ROW.sub(lambda row: f"{row[1]}{words(times[row[2]]) if row[2] in times else row[3]}{row[4]}", text)


def kept() -> dict[str, int]:
    """Seconds by target."""
    found: dict[str, int] = json.loads(KEPT.read_text("utf-8"))
    return found


def main(word: str, whole: str = "test") -> int:
    """The command line; `whole` is the target that the run was of."""
    if word == "keep":
        KEPT.write_text(
            json.dumps(merged(kept(), json.loads(WRITTEN.read_text("utf-8")), whole), indent=2) + "\n", "utf-8"
        )
        PAGE.write_text(page(PAGE.read_text("utf-8"), kept()), "utf-8")
    else:
        print(listed((CHECKOUT / "Makefile").read_text("utf-8"), kept()))
    return 0


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
