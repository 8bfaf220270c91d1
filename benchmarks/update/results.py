# SPDX-License-Identifier: GPL-3.0-or-later
"""The files of a run. A record is written the moment it is known: a run that breaks off leaves what it has."""

from __future__ import annotations

import json
import time
from pathlib import Path
from typing import Any

from .measure import Measured
from .paths import RESULTS
from .records import Record


class Results:
    """A directory of its own per run; below it `raw/` with the logs and counters that the figures are from."""

    def __init__(self, run: str | None = None) -> None:
        self.directory = RESULTS / (run or time.strftime("%Y%m%d-%H%M%S", time.gmtime()))
        self.raw = self.directory / "raw"
        self.raw.mkdir(parents=True, exist_ok=True)
        (self.directory / ".gitignore").write_text("*\n", encoding="utf-8")  # a run is not for the repository
        self.records: list[Record] = []
        self.details: list[dict[str, Any]] = []

    def add(self, measured: Measured) -> None:
        """Keep what a round gave."""
        self.records.append(measured.record)
        self.details.append(measured.details)
        _append(self.directory / "records.jsonl", measured.record)
        _append(self.directory / "details.jsonl", measured.details)

    def write(self, name: str, content: str) -> Path:
        """A file of the run, and the same under a name that does not change."""
        path = self.directory / name
        path.write_text(content, encoding="utf-8")
        (RESULTS / name).write_text(content, encoding="utf-8")
        return path


def _append(path: Path, value: Any) -> None:
    with path.open("a", encoding="utf-8") as file:
        file.write(json.dumps(value, separators=(",", ":")) + "\n")


def load(directory: Path) -> tuple[list[Record], list[dict[str, Any]]]:
    """Records and details of an earlier run."""
    return _read(directory / "records.jsonl"), _read(directory / "details.jsonl")


def _read(path: Path) -> list[dict[str, Any]]:
    return [json.loads(line) for line in path.read_text(encoding="utf-8").splitlines() if line]
