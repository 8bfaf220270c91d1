# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Where the tasks of one run stand, by their own word, for whoever looks at a run that is silent.

A file in Ansible's own temporary directory of the run: its workers write, its main process reads.
"""

from __future__ import annotations

import json
import time
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

NAME = "rosops-fleet-standing.jsonl"


class Word(NamedTuple):
    """What the task of a host said: where it stands, or, without a text, that it has printed a line."""

    at: float  # by a clock that is the same in all processes
    host: str
    text: str = ""


class Standing:
    """`clock` has to be the same in all processes."""

    def __init__(self, directory: Path, clock: Callable[[], float] = time.monotonic) -> None:
        self._path, self._clock = directory / NAME, clock

    def note(self, host: str, text: str = "") -> None:
        """Write it down, in one write: others write, too."""
        with self._path.open("a", encoding="utf-8") as file:
            file.write(json.dumps(Word(self._clock(), host, text)) + "\n")

    def words(self, since: float) -> list[Word]:
        """Those that were said since then. A line that is being written is left for the next time."""
        if not self._path.exists():
            return []
        *lines, _unfinished = self._path.read_text(encoding="utf-8").split("\n")
        return [word for word in (Word(*json.loads(line)) for line in lines) if word.at >= since]
