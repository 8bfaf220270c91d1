# SPDX-License-Identifier: GPL-3.0-or-later
"""The only place that starts other programs: short commands with their output, long builds with a log and progress."""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from .errors import LabError

PROGRESS_SECONDS = 10
TAIL_LINES = 30
_running: set[subprocess.Popen[bytes]] = set()
_interrupted = threading.Event()


def say(text: str) -> None:
    """Progress goes to the standard error: the standard output belongs to the commands' results."""
    print(text, file=sys.stderr, flush=True)


def run(
    command: Sequence[str],
    *,
    check: bool = True,
    timeout: float = 120,
    stdin: bytes | None = None,
) -> subprocess.CompletedProcess[str]:
    """Runs a short command and returns its output; a failure says the command and what it printed."""
    try:
        done = subprocess.run(  # noqa: S603 - a list of our own making, no shell
            list(command), input=stdin, capture_output=True, timeout=timeout, check=False
        )
    except FileNotFoundError as error:
        raise LabError(f"{command[0]} is not installed", todo="run `make setup`, which installs it") from error
    except subprocess.TimeoutExpired as error:
        said = ((error.stderr or b"") + (error.stdout or b"")).decode(errors="replace").strip()
        raise LabError(f"{' '.join(command[:4])} ... did not end within {timeout:g} s", where=said[-500:]) from error
    result = subprocess.CompletedProcess(
        done.args, done.returncode, done.stdout.decode(errors="replace"), done.stderr.decode(errors="replace")
    )
    if check and result.returncode != 0:
        said = (result.stderr.strip() or result.stdout.strip() or "it printed nothing")[-1500:]
        raise LabError(f"{' '.join(command)} failed with exit status {result.returncode}", where=said)
    return result


@dataclass(frozen=True)
class Job:
    """A long build: its output is appended to `log`; `stdout`, if given, takes the standard output."""

    command: Sequence[str]
    what: str
    log: Path
    env: Mapping[str, str] = field(default_factory=dict)
    cwd: Path | None = None
    stdin: Path = Path(os.devnull)
    stdout: Path | None = None


def build(job: Job) -> None:
    """Runs a job; every few seconds a line says what is being built and for how long."""
    started = time.monotonic()
    with (
        job.log.open("ab") as sink,
        job.stdin.open("rb") as source,
        job.stdout.open("wb") if job.stdout else contextlib.nullcontext(sink) as out,
    ):
        sink.write(f"$ {' '.join(job.command)}\n".encode())
        sink.flush()
        try:
            process = subprocess.Popen(  # noqa: S603 - a list of our own making, no shell
                list(job.command),
                stdin=source,
                stdout=out,
                stderr=sink,
                env={**os.environ, **job.env},
                cwd=job.cwd,
                start_new_session=True,
            )
        except FileNotFoundError as error:
            raise LabError(f"{job.command[0]} is not installed", todo="run `make setup`, which installs it") from error
        _running.add(process)
        try:
            status = _wait(process, job.what, started)
        finally:
            stop_group(process)
            _running.discard(process)
    if status != 0:
        lines = job.log.read_text(errors="replace").splitlines()[-TAIL_LINES:]
        tail = "\n".join(f"    {line}" for line in lines)
        raise LabError(
            f"building {job.what} failed with exit status {status}",
            where=f"the end of {job.log}:\n{tail}",
            todo="mend what the log says, then run it again",
        )


def _wait(process: subprocess.Popen[bytes], what: str, started: float) -> int:
    while True:
        try:
            return process.wait(timeout=PROGRESS_SECONDS)
        except subprocess.TimeoutExpired:
            if _interrupted.is_set():
                raise LabError(f"{what}: interrupted") from None
            say(f"  ... {what}: {time.monotonic() - started:.0f} s")


def stop_group(process: subprocess.Popen[bytes]) -> None:
    """Ends a build with all its children: an interrupted build must not go on in the background."""
    if process.poll() is not None:
        return
    for number in (signal.SIGTERM, signal.SIGKILL):
        try:
            os.killpg(process.pid, number)
        except ProcessLookupError:
            return
        try:
            process.wait(timeout=10)
            return
        except subprocess.TimeoutExpired:
            continue


def interrupt_all() -> None:
    """On a signal, from its handler: builds run in threads, which the signal does not reach."""
    _interrupted.set()
    for process in list(_running):
        with contextlib.suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGTERM)
