# SPDX-License-Identifier: GPL-3.0-or-later
"""How much the persistent claims of one namespace hold on this node's disk, seldom and from a thread of its own.

Looks at names and sizes only, under the directory of the storage class local-path:
`pvc-<uid>_<namespace>_<claim>/...`.
"""

from __future__ import annotations

import contextlib
import os
import threading
import time

PERIOD = 60.0
SHARE = 0.02  # of the time: a large tree is looked at less often
BLOCK = 512  # of st_blocks, whatever the file system's own


def claim_of(directory: str, namespace: str) -> str:
    """The claim that a directory belongs to; nothing where it is another namespace's or no claim's."""
    parts = directory.split("_", 2)
    good = len(parts) == 3 and parts[0].startswith("pvc-") and parts[1] == namespace
    return parts[2] if good else ""


def used(path: str) -> int:
    """Bytes on disk under a directory: no links followed, no other file system entered, a file with two names once."""
    total, seen, todo = 0, set(), [path]
    device = os.stat(path).st_dev  # noqa: PTH116 - pathlib is not worth its memory here
    while todo:
        # what is gone, or not ours to read: the rest still counts
        with contextlib.suppress(OSError), os.scandir(todo.pop()) as entries:
            for entry in entries:
                try:
                    status = entry.stat(follow_symlinks=False)
                except OSError:
                    continue
                if status.st_dev != device or (status.st_nlink > 1 and status.st_ino in seen):
                    continue
                total += status.st_blocks * BLOCK
                if entry.is_dir(follow_symlinks=False):
                    todo.append(entry.path)
                elif status.st_nlink > 1:
                    seen.add(status.st_ino)
    return total


def look(path: str, namespace: str) -> dict[str, int]:
    """Bytes by claim; claims of which nothing is on this node are left out."""
    found: dict[str, int] = {}
    with contextlib.suppress(OSError), os.scandir(path) as entries:
        for entry in entries:
            claim = claim_of(entry.name, namespace) if entry.is_dir() else ""
            if claim:
                with contextlib.suppress(OSError):  # gone meanwhile
                    found[claim] = found.get(claim, 0) + used(entry.path)
    return found


class Claims(threading.Thread):
    """Keeps `used` at most a minute old, or as much older as the tree is large."""

    def __init__(self, path: str, namespace: str) -> None:
        super().__init__(daemon=True, name="claims")
        self.path, self.namespace = path, namespace
        self.used: dict[str, int] = {}

    def run(self) -> None:
        while True:
            time.sleep(self.once())

    def once(self) -> float:
        """Look, and say how long to wait before the next look."""
        began = time.monotonic()
        self.used = look(self.path, self.namespace)
        return max(PERIOD, (time.monotonic() - began) / SHARE)
