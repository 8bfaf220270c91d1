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
_NO_LINK = os.O_RDONLY | os.O_NOFOLLOW | os.O_CLOEXEC | os.O_NONBLOCK

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
        if place != directory:
            # another run may be at the same one, and whoever ends tidies up himself
            with contextlib.suppress(OSError, ValueError), _opened(place) as at:
                removed += [str(place / name) for name in _swept(at)]
    return removed


def _swept(at: int) -> Iterator[str]:
    with _opened(OWNER, at) as file:
        owner = json.loads(os.read(file, 4096))
    if not (isinstance(owner, dict) and has_ended(owner)):
        return
    with _opened(USED, at) as used:
        fcntl.flock(used, fcntl.LOCK_EX | fcntl.LOCK_NB)  # BlockingIOError: a task outlives its run for a moment
        names = [name for name in os.listdir(at) if name.removeprefix(".").startswith(OURS)]
        # that of the owner is the last one, so that a sweep can be gone on with
        for name in sorted(names, key=lambda name: (name == OWNER, name)):
            if _is_own(os.stat(name, dir_fd=at, follow_symlinks=False), stat.S_IFREG):
                os.unlink(name, dir_fd=at)
                yield name


def started(process: int) -> str:
    """When a process began, in ticks since the boot. Numbers are given out again.

    Empty where there is none, or one that has ended and that nobody has waited for.
    """
    try:
        after_name = _read(f"/proc/{process:d}/stat").rpartition(")")[2].split()
    except OSError:
        return ""
    return "" if after_name[0] in "ZX" else after_name[19]


@contextlib.contextmanager
def _opened(path: str | Path, at: int | None = None) -> Iterator[int]:
    """A directory, or a file in one, of this user's own; OSError for a link or anything else."""
    handle = os.open(path, _NO_LINK, dir_fd=at)
    try:
        if not _is_own(os.fstat(handle), stat.S_IFDIR if at is None else stat.S_IFREG):
            raise PermissionError(path)
        yield handle
    finally:
        os.close(handle)


def _is_own(seen: os.stat_result, kind: int) -> bool:
    return seen.st_uid == os.getuid() and stat.S_IFMT(seen.st_mode) == kind


def _read(path: str) -> str:
    return Path(path).read_text("utf-8", "replace").strip()
