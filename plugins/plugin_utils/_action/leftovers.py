# SPDX-License-Identifier: GPL-3.0-or-later
"""What a killed run left in Ansible's temporary directory: an administrator's kubeconfig, which the next run removes.

Ansible names the directory after the process of the run; the names of our files say where that process is to be looked
for. What belongs to a run of which nobody can tell that it has ended stays: of another machine, or of a container with
processes of its own. A task that outlives its run for a moment has read the file, and needs it no more.
"""

from __future__ import annotations

import contextlib
import functools
import hashlib
import os
import re
import stat
import time
from pathlib import Path

RUN = re.compile(r"ansible-local-(\d+)\w{8}")


@functools.cache
def prefix() -> str:
    """What the names of a run's files begin with, on this machine and with the numbers of its processes; those that are
    being written after a dot."""
    with contextlib.suppress(OSError):
        told = os.uname().nodename, _read("/etc/machine-id"), str(Path("/proc/self/ns/pid").readlink())
        return f"rosops-fleet-{hashlib.sha256(repr(told).encode()).hexdigest()[:12]}-"
    return f"rosops-fleet-{os.getpid()}-"  # nobody else's, so that nobody removes them


def sweep(directory: Path) -> list[str]:
    """Remove our files from the directories of runs that have ended, beside this run's; their paths."""
    removed: list[str] = []
    for place in sorted({*directory.parent.glob("ansible-local-*")} - {directory}):
        # another run may be at the same one, and whoever ends tidies up himself
        with contextlib.suppress(OSError):
            run = RUN.fullmatch(place.name)
            if run and _is_written_by_us_alone(place) and _has_ended(int(run[1]), place):
                for path in sorted(place.iterdir()):
                    if path.name.removeprefix(".").startswith(prefix()):
                        path.unlink()
                        removed.append(str(path))
    return removed


def _is_written_by_us_alone(place: Path) -> bool:
    """So that nobody else can have put a link into it."""
    seen = place.lstat()
    return stat.S_ISDIR(seen.st_mode) and seen.st_uid == os.getuid() and not seen.st_mode & 0o022


def _has_ended(process: int, place: Path) -> bool:
    """Numbers are given out again: a process that is younger than the run's directory is another one."""
    ticks = started(process)
    age = time.clock_gettime(time.CLOCK_BOOTTIME) - int(ticks or 0) / os.sysconf("SC_CLK_TCK")
    return not ticks or age + 1 < time.time() - place.stat().st_mtime


def started(process: int) -> str:
    """When a process began, in ticks since the boot. Numbers are given out again.

    Empty where there is none, or one that has ended and that nobody has waited for.
    """
    try:
        after_name = _read(f"/proc/{process:d}/stat").rpartition(")")[2].split()
    except OSError:
        return ""
    return "" if after_name[0] in "ZX" else after_name[19]


def _read(path: str) -> str:
    return Path(path).read_text("utf-8", "replace").strip()
