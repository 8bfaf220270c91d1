# SPDX-License-Identifier: GPL-3.0-or-later
"""The robot under stress: stress-ng at 80 % CPU and 80 % memory of the robot host. I/O, but for the sums.

A lab host is a container on this machine. Its CPUs are the machine's, so 80 % of them is one worker per core at 80 %.
For its memory it gets, while the stress lasts, the limit that the dissertation's machine had (4 GB), and stress-ng
fills it until 80 % of that are in use, with what the host uses anyway. stress-ng itself is the machine's own (Debian's
package stress-ng), put into the host's cgroups: it counts, competes and is limited as a process of the host.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from types import TracebackType

from lab_environment import CHECKOUT

from .cores import ROBOT_CORES
from .errors import BenchError

sys.path.insert(0, str(CHECKOUT / "tests" / "lab"))

from lablib.names import checkout_id, container_name
from lablib.podman import podman

CPU_PERCENT = MEMORY_PERCENT = 80
MEMORY = 4 * 1024**3  # the dissertation's t2.medium (table 4.1)
LEAST = 256 * 1024**2
CGROUPS = Path("/sys/fs/cgroup")
V2 = (CGROUPS / "cgroup.controllers").exists()
SETTLE = 10.0


def fill_bytes(limit: int, used: int) -> int:
    """How much to allocate so that 80 % of the limit are in use."""
    return max(LEAST, limit * MEMORY_PERCENT // 100 - used)


def command(workers: int, fill: int) -> list[str]:
    """stress-ng's command line; it holds the memory and touches it again and again."""
    return [
        *("stress-ng", "--quiet", "--cpu", str(workers), "--cpu-load", str(CPU_PERCENT)),
        *("--vm", "1", "--vm-bytes", str(fill), "--vm-keep", "--vm-hang", "1"),
    ]


def describe(workers: int) -> str:
    """For the report."""
    return (
        f"stress-ng in the robot host's cgroups: {workers} workers at {CPU_PERCENT} % CPU, and memory until "
        f"{MEMORY_PERCENT} % of {MEMORY // 1024**3} GiB are in use (the host's limit meanwhile)"
    )


def host_groups(text: str) -> tuple[list[Path], Path]:
    """The host's cgroups that stress belongs into, and the one that counts its memory."""
    groups = parse_groups(text)
    names = ("",) if V2 else ("cpu", "cpuacct", "memory")
    parents = [CGROUPS / name / groups[name].lstrip("/") for name in names]
    return parents, parents[-1]


def parse_groups(text: str) -> dict[str, str]:
    """/proc/<pid>/cgroup -> controllers and the container's own group, without the init.scope of its systemd."""
    found = {}
    for line in text.splitlines():
        _number, controllers, path = line.split(":", 2)
        found[controllers] = path.removesuffix("/init.scope")
    return found


class Stress:
    """Stress on one lab host for as long as it is open."""

    def __init__(self, lab: str, host: str, keep: Path, say: Callable[[str], None]) -> None:
        if shutil.which("stress-ng") is None:
            raise BenchError("stress-ng is missing on this machine: apt-get install stress-ng, or --stress no")
        self._container = container_name(checkout_id(str(CHECKOUT)), lab, host)
        self._log = keep
        self._say = say
        self._groups: list[Path] = []
        self._limit: Path | None = None
        self._process: subprocess.Popen[bytes] | None = None

    def __enter__(self) -> Stress:
        pid = podman("container", "inspect", "--format", "{{.State.Pid}}", self._container).strip()
        parents, memory = host_groups(Path(f"/proc/{pid}/cgroup").read_text(encoding="utf-8"))
        self._limit = memory / ("memory.max" if V2 else "memory.limit_in_bytes")
        used = int((memory / ("memory.current" if V2 else "memory.usage_in_bytes")).read_text())
        fill = fill_bytes(MEMORY, used)
        self._groups = [parent / "stress" for parent in parents]
        try:
            self._limit.write_text(str(MEMORY))
            for group in self._groups:
                group.mkdir(exist_ok=True)
            self._start(command(len(ROBOT_CORES), fill))
            self._say(f"stress: {fill // 1024**2} MiB beside {used // 1024**2} MiB in use")
            time.sleep(SETTLE)
            self._check()
        except BaseException:
            self._stop()
            raise
        return self

    def _start(self, words: list[str]) -> None:
        # the shell puts itself into the groups, then becomes stress-ng: no child escapes
        script = 'for group in $GROUPS_OF_HOST; do echo $$ > "$group/cgroup.procs" || exit 1; done; exec "$@"'
        env = {**os.environ, "GROUPS_OF_HOST": " ".join(map(str, self._groups))}
        with self._log.open("ab") as file:
            self._process = subprocess.Popen(  # noqa: S603 - our own
                ["/bin/sh", "-c", script, "stress", *words], env=env, stdout=file, stderr=file, start_new_session=True
            )

    def _check(self) -> None:
        if self._process is None or self._process.poll() is not None:
            raise BenchError(f"stress-ng ended by itself; its log is {self._log}")

    def __exit__(
        self, kind: type[BaseException] | None, value: BaseException | None, trace: TracebackType | None
    ) -> None:
        try:
            if kind is None:
                self._check()  # a round without the stress that it claims is no measurement
        finally:
            self._stop()

    def _stop(self) -> None:
        if self._process is not None and self._process.poll() is None:
            self._process.terminate()
            try:
                self._process.wait(timeout=20)
            except subprocess.TimeoutExpired:
                self._process.kill()
                self._process.wait(timeout=20)
        if self._limit is not None:
            self._limit.write_text("max" if V2 else "-1")
        for group in self._groups:
            _remove(group)


def _remove(group: Path) -> None:
    """A cgroup can go only when the last of its processes has gone: the children go a moment after their parent."""
    deadline = time.monotonic() + 20
    while group.exists():
        try:
            group.rmdir()
        except OSError as error:
            if time.monotonic() > deadline:
                raise BenchError(f"{group} cannot be removed: {error}") from error
            time.sleep(0.2)
