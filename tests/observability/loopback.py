# SPDX-License-Identifier: GPL-3.0-or-later
"""The lab's real observability programs, started on loopback with ports and directories of their own."""

from __future__ import annotations

import contextlib
import shutil
import socket
import ssl
import subprocess
import time
import urllib.error
import urllib.request
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

import pytest

CHECKOUT = Path(__file__).resolve().parents[2]
LAB = CHECKOUT / "tests" / "lab" / "lab"
START_SECONDS = 60
T = TypeVar("T")


def program(name: str) -> str:
    """Its path; the test is skipped, with the reason, where the program is not built."""
    command = [str(LAB), "program", name, "--no-build"]
    found = subprocess.run(command, capture_output=True, text=True, check=False)  # noqa: S603 - a command of our own
    if found.returncode != 0:
        pytest.skip(found.stderr.strip())
    return found.stdout.strip()


def image_files(path: str, inside: str, target: Path) -> Path:
    """A copy of the files of the image that has the program at `inside`."""
    shutil.copytree(path.removesuffix(inside), target)
    return target


def free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


def get(url: str, context: ssl.SSLContext | None = None) -> str:
    with urllib.request.urlopen(url, timeout=5, context=context) as answer:  # noqa: S310 - loopback, or the lab's hub
        return str(answer.read().decode())


def moved(text: str, words: Mapping[str, str]) -> str:
    """A configuration or an argument with directories and ports of the test's own."""
    for word, other in words.items():
        text = text.replace(word, other)
    return text


def eventually(what: str, probe: Callable[[], T], seconds: float = START_SECONDS) -> T:
    """The first true answer of the probe; at the deadline a failure that carries the last thing seen."""
    deadline = time.monotonic() + seconds
    seen: object = None
    while time.monotonic() < deadline:
        try:
            answer = probe()
            if answer:
                return answer
            seen = answer
        except (OSError, urllib.error.URLError, ValueError) as error:
            seen = error
        time.sleep(0.2)
    raise AssertionError(f"{what}: not within {seconds:g} s; last seen: {seen!r}")


@dataclass(frozen=True)
class Program:
    """One that runs: its process, and what it has written."""

    process: subprocess.Popen[bytes]
    log: Path
    url: str

    @property
    def tail(self) -> str:
        return "\n".join(self.log.read_text(errors="replace").splitlines()[-20:])

    def ready(self, path: str, context: ssl.SSLContext | None = None) -> Program:
        """Once it answers there."""

        def probe() -> bool:
            assert self.process.poll() is None, f"{self.process.args!r} ended:\n{self.tail}"
            get(f"{self.url}{path}", context)
            return True

        eventually(f"{self.url}{path}\n{self.tail}", probe)
        return self


@contextlib.contextmanager
def running(directory: Path, port: int, *command: str, scheme: str = "http") -> Iterator[Program]:
    directory.mkdir(parents=True, exist_ok=True)
    log = directory / "log"
    with log.open("ab") as sink:
        process = subprocess.Popen(command, stdout=sink, stderr=sink, cwd=directory)  # noqa: S603 - as above
        try:
            yield Program(process, log, f"{scheme}://127.0.0.1:{port}")
        finally:
            process.terminate()
            try:
                process.wait(timeout=10)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()
