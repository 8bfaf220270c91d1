# SPDX-License-Identifier: GPL-3.0-or-later
"""What a run of the tests leaves on the machine: processes, containers, networks, volumes, mounts, files.

A run may leave files in its checkout and in the cache, nothing else. What was there before is not the run's, nor is
what another checkout or another program makes meanwhile: processes are known by a mark in their environment, podman's
objects by the checkout's part of their names, mounts and files by their places.
"""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
import tempfile
import time
import uuid
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path

from started import kill, marked

CHECKOUT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(CHECKOUT / "tests" / "lab"))

from lablib.names import checkout_id, network_name  # noqa: E402 - found through the line above

MARK = "ROSOPS_TEST_STAGES"
PATIENCE = 75.0  # s: SSH keeps a connection for a minute after the last command
# Where tools put files when nothing tells them another place. What is temporary goes into the run's TMPDIR.
# ~/.ansible/tmp is where Ansible has modules run on the control node: every run of a user makes it.
PLACES = ("~/.ansible/[!t]*", "~/.kube", "~/.ros")
PODMAN = {
    "container": ("ps", "--all", "Names"),
    "network": ("network", "ls", "Name"),
    "volume": ("volume", "ls", "Name"),
}


class Watched:
    """A run: what its stages get in their environment, and what is left of it."""

    def __init__(self) -> None:
        self._mark = uuid.uuid4().hex
        # Short, because paths of sockets may have 107 bytes; open to read, because apt's own user looks into it.
        self._directory = Path(tempfile.mkdtemp(prefix="rosops-"))
        self._directory.chmod(0o755)
        self.environment = {MARK: self._mark, "TMPDIR": str(self._directory)}
        self._before = self._things()

    def end(self, patience: float) -> list[str]:
        """Wait for what ends by itself, and take away the rest; a line for each thing that had to be taken away."""
        deadline = time.monotonic() + patience
        while (left := self._processes()) and time.monotonic() < deadline:
            time.sleep(0.2)
        kill(self._processes)
        things = sorted(self._things() - self._before)
        shutil.rmtree(self._directory, ignore_errors=True)
        return [f"process {number}: {command}" for number, command in left.items()] + things

    def _processes(self) -> dict[int, str]:
        return marked(MARK, self._mark)

    def _things(self) -> set[str]:
        return {*podmans(_podman), *mounts(Path("/proc/self/mounts").read_text("utf-8"), _own_places()), *files(PLACES)}


def podmans(ask: Callable[[list[str]], list[Mapping[str, object]]], checkout: str = str(CHECKOUT)) -> list[str]:
    """Containers, networks and volumes of the checkout's labs."""
    ours = network_name(checkout_id(checkout), "")
    found = []
    for kind, (*words, key) in PODMAN.items():
        for one in ask(words):
            name = one.get(key) or one.get(key.lower())
            name = name[0] if isinstance(name, list) else name
            if str(name).startswith(ours):
                found.append(f"{kind} {name}")
    return found


def mounts(table: str, below: Iterable[str]) -> list[str]:
    """Mount points of /proc/self/mounts in these directories."""
    places = tuple(f"{place}/" for place in below)
    return [f"mount {line.split()[1]}" for line in table.splitlines() if line.split()[1].startswith(places)]


def files(patterns: Iterable[str]) -> list[str]:
    """What is there of these patterns, the directory's own name only."""
    places = [Path(pattern).expanduser() for pattern in patterns]
    return [f"file {path}" for place in places for path in place.parent.glob(place.name)]


def _own_places() -> list[str]:
    return [str(CHECKOUT), tempfile.gettempdir(), str(Path.home())]


def _podman(words: list[str]) -> list[Mapping[str, object]]:
    podman = shutil.which("podman")
    if not podman:  # the first stage installs it
        return []
    command = [podman, *words, "--format", "json"]
    said = subprocess.run(command, capture_output=True, text=True, check=True).stdout  # noqa: S603 - fixed words
    found: list[Mapping[str, object]] = json.loads(said or "[]")
    return found
