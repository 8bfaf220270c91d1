# SPDX-License-Identifier: GPL-3.0-or-later
"""How much processor time a process takes, and how much memory with all that it has started."""

from __future__ import annotations

import contextlib
import threading
import time
from pathlib import Path

PROC = Path("/proc")
PERIOD = 1.0  # s between two looks


def cpu_seconds(pid: int) -> float:
    """Of a process with all its threads, also those that have ended (CPUCLOCK_SCHED of Linux, posix-timers.h)."""
    return time.clock_gettime(~pid << 3 | 2)


def tree(root: int) -> set[int]:
    """The process and its descendants; what was left behind by one that ended belongs to nobody here."""
    parents = {}
    for path in PROC.glob("[0-9]*/stat"):
        with contextlib.suppress(OSError):  # it has ended meanwhile
            parents[int(path.parent.name)] = int(path.read_text().rpartition(")")[2].split()[1])
    found, more = set[int](), {root}
    while more:
        found |= more
        more = {pid for pid, parent in parents.items() if parent in more}
    return found


def memory_mb(root: int) -> float:
    """MB of the whole tree; pages that several of them have are counted once (Pss of proc(5))."""
    kilobytes = 0
    for pid in tree(root):
        with contextlib.suppress(OSError):
            lines = (PROC / str(pid) / "smaps_rollup").read_text().splitlines()
            kilobytes += sum(int(line.split()[1]) for line in lines if line.startswith("Pss:"))
    return kilobytes / 1024


class Peak(threading.Thread):
    """Looks at a process' tree once a second until it is told to end; `most` is what it saw at the worst moment."""

    def __init__(self, root: int) -> None:
        super().__init__(daemon=True)
        self.root, self.most, self._over = root, 0.0, threading.Event()

    def run(self) -> None:
        while not self._over.is_set():
            self.most = max(self.most, memory_mb(self.root))
            self._over.wait(PERIOD)

    def end(self) -> float:
        self._over.set()
        self.join()
        return self.most
