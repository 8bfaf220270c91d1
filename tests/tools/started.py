# SPDX-License-Identifier: GPL-3.0-or-later
"""Processes that a test started, by a mark in their environment.

A process keeps the mark when its parent ends, when it becomes a session of its own, and when it is deaf to SIGTERM. So
the mark finds what a list of children does not.
"""

from __future__ import annotations

import os
import signal
import time
from collections.abc import Callable
from pathlib import Path

LONGEST = 30.0  # s that killed processes may take


def marked(name: str, value: str, proc: Path = Path("/proc")) -> dict[int, str]:
    """Number and command line of each process whose environment has NAME=VALUE; not the caller's own, no dead one."""
    wanted = f"{name}={value}".encode()
    found = {}
    for path in proc.glob("[0-9]*"):
        try:
            if wanted in (path / "environ").read_bytes().split(b"\0") and int(path.name) != os.getpid():
                found[int(path.name)] = (
                    (path / "cmdline").read_bytes().replace(b"\0", b" ").decode(errors="replace").strip()
                )
        except OSError:  # it has ended, or is another user's
            continue
    return found


def kill(look: Callable[[], dict[int, str]]) -> None:
    """SIGKILL to all that `look` finds, until it finds nothing.

    They are stopped first: nothing acts on the end of something else, and nothing starts another process meanwhile.
    """
    deadline = time.monotonic() + LONGEST
    while found := look():
        for number in (signal.SIGSTOP, signal.SIGKILL):
            for process in found:
                try:
                    os.kill(process, number)
                except ProcessLookupError:
                    continue
        if time.monotonic() > deadline:
            raise AssertionError(f"killed, and still there after {LONGEST:g} s: {found}")
        time.sleep(0.02)
