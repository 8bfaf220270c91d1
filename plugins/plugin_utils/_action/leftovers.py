# SPDX-License-Identifier: GPL-3.0-or-later
"""What a killed run left in Ansible's temporary directory: an administrator's kubeconfig, which the next run removes.

Every run says in its own directory whose it is, and each task that uses the access holds a lock there. What belongs to
a run of which nobody can tell that it has ended stays: of another machine, or of a container with processes of its own.
"""

from __future__ import annotations

import contextlib
import fcntl
import functools
import json
import multiprocessing
import os
import stat
from collections.abc import Iterator
from pathlib import Path
from typing import Any

OURS = "rosops-fleet-"  # what the names of a run's files begin with, those that are being written after a dot
OWNER, USED = f"{OURS}owner.json", f"{OURS}used.lock"

Owner = dict[str, Any]


@functools.cache
def hold(directory: Path, _process: int) -> None:
    """Say whose directory it is, and that this process uses what lies there, as long as it lives."""
    used = os.open(directory / USED, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o600)  # the end of the process closes it
    fcntl.flock(used, fcntl.LOCK_SH)
    (directory / OWNER).write_text(json.dumps(owner_at_work()), "utf-8")


def owner_at_work() -> Owner:
    """The run of this process, as another process can find it again."""
    parent = multiprocessing.parent_process()
    process = (parent.pid if parent else None) or os.getpid()
    with contextlib.suppress(OSError):
        return {
            "machine": f"{os.uname().nodename} {_read('/etc/machine-id')}",
            "boot": _read("/proc/sys/kernel/random/boot_id"),
            "processes": str(Path("/proc/self/ns/pid").readlink()),
            "process": process,
            "started": started(process),
        }
    return {}


def has_ended(owner: Owner) -> bool:
    """Whether that run is over for certain."""
    now = owner_at_work()
    if not now or owner.keys() != now.keys() or owner["machine"] != now["machine"]:
        return False
    if owner["boot"] != now["boot"]:
        return True
    return bool(owner["processes"] == now["processes"] and owner["started"] != started(owner["process"]))


def sweep(directory: Path) -> list[str]:
    """Remove our files from the directories of runs that have ended, beside this run's; their paths."""
    removed: list[str] = []
    for place in sorted(directory.parent.glob("ansible-local-*")):
        # another run may be at the same one, and whoever ends tidies up himself
        with contextlib.suppress(OSError, ValueError):
            if place != directory and _is_written_by_us_alone(place):
                removed += _swept(place)
    return removed


def _is_written_by_us_alone(place: Path) -> bool:
    """So that nobody else can have put a link into it."""
    seen = place.lstat()
    return stat.S_ISDIR(seen.st_mode) and seen.st_uid == os.getuid() and not seen.st_mode & 0o022


def _swept(place: Path) -> Iterator[str]:
    owner = json.loads((place / OWNER).read_text("utf-8"))
    if not (isinstance(owner, dict) and has_ended(owner)):
        return
    with (place / USED).open("rb") as used:
        fcntl.flock(used, fcntl.LOCK_EX | fcntl.LOCK_NB)  # BlockingIOError: a task outlives its run for a moment
        ours = [path for path in place.iterdir() if path.name.removeprefix(".").startswith(OURS)]
        # that of the owner is the last one, so that a sweep can be gone on with
        for path in sorted(ours, key=lambda path: (path.name == OWNER, path.name)):
            path.unlink()
            yield str(path)


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
