# SPDX-License-Identifier: GPL-3.0-or-later
"""Tables that benchmarks publish: committed beside the experiment's trials, shown in docs/benchmarks.md."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

from lab_environment import CHECKOUT

PUBLISHED = CHECKOUT / "benchmarks" / "update" / "results"
SUFFIX = ".table.json"
HELP = "keep the result for docs/benchmarks.md"


@dataclass(frozen=True)
class Table:
    """A section of the page; every cell is text already."""

    title: str
    about: str  # what was measured, on what
    heads: Sequence[str]
    rows: Sequence[Sequence[str]]


def publish(name: str, table: Table, folder: Path = PUBLISHED) -> None:
    (folder / f"{name}{SUFFIX}").write_text(json.dumps(asdict(table), indent=1) + "\n", encoding="utf-8")


def published(folder: Path = PUBLISHED) -> Iterator[Table]:
    for path in sorted(folder.glob(f"*{SUFFIX}")):
        yield Table(**json.loads(path.read_text(encoding="utf-8")))
