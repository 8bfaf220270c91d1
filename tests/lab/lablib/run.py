"""The only place that starts other programs: short commands with their output, long builds with a log and progress."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import IO

from .errors import LabError

PROGRESS_SECONDS = 10
TAIL_LINES = 30
_running: set[subprocess.Popen[bytes]] = set()


def say(text: str) -> None:
    """Progress goes to the standard error: the standard output belongs to the commands' results."""
    print(text, file=sys.stderr, flush=True)


def run(
    command: Sequence[str],
    *,
    check: bool = True,
    timeout: float = 120,
    stdin: bytes | None = None,
    todo: str = "",
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
        raise LabError(
            f"{' '.join(command[:4])} ... did not end within {timeout:g} s", where=said[-500:], todo=todo
        ) from error
    result = subprocess.CompletedProcess(
        done.args, done.returncode, done.stdout.decode(errors="replace"), done.stderr.decode(errors="replace")
    )
    if check and result.returncode != 0:
        said = (result.stderr.strip() or result.stdout.strip() or "it printed nothing")[-1500:]
        raise LabError(f"{' '.join(command)} failed with exit status {result.returncode}", where=said, todo=todo)
    return result


def build(
    command: Sequence[str],
    *,
    what: str,
    log: Path,
    env: Mapping[str, str] | None = None,
    cwd: Path | None = None,
    stdin: Path = Path(os.devnull),
    stdout: Path | None = None,
) -> None:
    """Runs a long build. Its output is appended to `log` (or `stdout` takes the standard output); every few seconds
    a line says what is being built and for how long."""
    started = time.monotonic()
    with log.open("ab") as sink, (stdout.open("wb") if stdout else _same(sink)) as out, stdin.open("rb") as source:
        sink.write(f"$ {' '.join(command)}\n".encode())
        sink.flush()
        try:
            process = subprocess.Popen(  # noqa: S603 - a list of our own making, no shell
                list(command),
                stdin=source,
                stdout=out,
                stderr=sink,
                env={**os.environ, **(env or {})},
                cwd=cwd,
                start_new_session=True,
            )
        except FileNotFoundError as error:
            raise LabError(f"{command[0]} is not installed", todo="run `make setup`, which installs it") from error
        _running.add(process)
        try:
            status = _wait(process, what, started)
        finally:
            stop_group(process)
            _running.discard(process)
    if status != 0:
        tail = "\n".join(f"    {line}" for line in tail_of(log))
        raise LabError(
            f"building {what} failed with exit status {status}", where=f"the end of {log}:\n{tail}", todo="run it again"
        )


def _same(sink: IO[bytes]) -> IO[bytes]:
    return os.fdopen(os.dup(sink.fileno()), "wb")


def _wait(process: subprocess.Popen[bytes], what: str, started: float) -> int:
    while True:
        try:
            return process.wait(timeout=PROGRESS_SECONDS)
        except subprocess.TimeoutExpired:
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


def stop_all() -> None:
    """After an interruption: builds run in threads, which the signal does not reach."""
    for process in list(_running):
        stop_group(process)


def tail_of(log: Path, lines: int = TAIL_LINES) -> list[str]:
    try:
        return log.read_text(errors="replace").splitlines()[-lines:]
    except FileNotFoundError:
        return []
