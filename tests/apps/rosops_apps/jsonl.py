# SPDX-License-Identifier: GPL-3.0-or-later
"""A log of JSON lines on a volume that outlives the process, and that an overlapping process may write as well."""

from __future__ import annotations

import json
import os
import time
from pathlib import Path
from typing import Any, Callable

TAIL_BYTES = 65_536


class JsonLinesLog:
    """Appends one line per record.

    A line goes out in one write to a file opened for appending, so the lines of two processes do not mix; at most there
    is an empty line, where one opened the file in the middle of the other's write. The disk
    is made to follow at most every `sync_seconds`: a crash of the machine costs no more than that.
    """

    def __init__(self, path: Path, sync_seconds: float = 1.0, clock: Callable[[], float] = time.monotonic) -> None:
        path.parent.mkdir(parents=True, exist_ok=True)
        self.path = path
        self._clock = clock
        self._sync_seconds = sync_seconds
        self._synced = clock()
        self._file = os.open(path, os.O_WRONLY | os.O_APPEND | os.O_CREAT, 0o644)
        if torn_end(path):  # a crash in the middle of a line: end it, so that only this line is lost
            os.write(self._file, b"\n")

    def write(self, record: dict[str, Any]) -> None:
        os.write(self._file, json.dumps(record, separators=(",", ":")).encode() + b"\n")
        if self._clock() - self._synced >= self._sync_seconds:
            self.sync()

    def sync(self) -> None:
        """Have it on the disk."""
        os.fdatasync(self._file)
        self._synced = self._clock()

    def close(self) -> None:
        """Have it on the disk and close it."""
        self.sync()
        os.close(self._file)


def torn_end(path: Path) -> bool:
    """Whether the file ends in the middle of a line."""
    with path.open("rb") as file:
        if file.seek(0, os.SEEK_END) == 0:
            return False
        file.seek(-1, os.SEEK_END)
        return file.read(1) != b"\n"


def last_record(path: Path, key: str) -> dict[str, Any] | None:
    """The record at the file's end with the highest `key`; lines that are no records are passed over.

    Not simply the last line: while two processes overlap, the older one may have written last.
    """
    try:
        with path.open("rb") as file:
            size = file.seek(0, os.SEEK_END)
            file.seek(max(0, size - TAIL_BYTES))
            lines = file.read().splitlines()
    except FileNotFoundError:
        return None
    best: dict[str, Any] | None = None
    for line in lines:
        try:
            record = json.loads(line)
        except ValueError:
            continue
        if not isinstance(record, dict) or not isinstance(record.get(key), int):
            continue
        if best is None or record[key] >= best[key]:
            best = record
    return best
