# SPDX-License-Identifier: GPL-3.0-or-later
"""What every use of podman here has in common."""

from __future__ import annotations

import resource
import subprocess
from pathlib import Path

from .run import run

# cgroupfs: the machine may have no systemd as PID 1. runc: crun refuses hybrid cgroup trees.
PODMAN = ("podman", "--cgroup-manager", "cgroupfs", "--runtime", "runc")
_LIMITS = {"nofile": (resource.RLIMIT_NOFILE, 20000), "nproc": (resource.RLIMIT_NPROC, 8192)}


def limits() -> list[str]:
    """Explicit limits: podman's own defaults need CAP_SYS_RESOURCE, which a container or a small VM may lack."""
    flags: list[str] = []
    for name, (number, wanted) in _LIMITS.items():
        hard = resource.getrlimit(number)[1]
        value = wanted if hard == resource.RLIM_INFINITY else min(wanted, hard)
        flags.append(f"--ulimit={name}={value}:{value}")
    return flags


def podman(*arguments: str, stdin: bytes | None = None) -> str:
    return run([*PODMAN, *arguments], stdin=stdin).stdout


def podman_try(*arguments: str, timeout: float = 120) -> subprocess.CompletedProcess[str]:
    return run([*PODMAN, *arguments], check=False, timeout=timeout)


def cgroups() -> str:
    """How the machine's cgroups are set up: the same flags serve both, but a report should say which it was."""
    return "v2" if Path("/sys/fs/cgroup/cgroup.controllers").exists() else "v1 or hybrid"
