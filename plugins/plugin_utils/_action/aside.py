# SPDX-License-Identifier: GPL-3.0-or-later
"""Work that goes on from one task of a run to another, in a process of its own.

A Lease has to be renewed while the user's tasks run, and each task has a worker of its own, which ends with it. So the
work lives beside them. It says whose turn it is, and a later task says what came of it: one line of JSON each way, over
a socket in a directory that nobody else can read. Whoever ends the run ends the work.
"""

from __future__ import annotations

import contextlib
import json
import os
import shutil
import signal
import socket
import tempfile
import traceback
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from ...module_utils._common.errors import FleetError
from .cancelled import cancellable
from .leftovers import started

Told = Mapping[str, Any]


class Turns:
    """The work's end of the line."""

    def __init__(self, server: socket.socket) -> None:
        """Wait for the first call, which never tells of a failure."""
        self._server = server
        self._next()

    def give(self, word: str) -> None:
        """Let the run go on with this, until it comes back; FleetError if that went wrong."""
        self.tell({"turn": word})
        failure = self._next()
        if failure:
            raise FleetError(failure)

    def _next(self) -> str:
        """The next call, and what it says went wrong."""
        self._caller = self._server.accept()[0]
        return str(_read(self._caller)["failure"])

    def tell(self, told: Told) -> None:
        """Answer whoever asked."""
        with contextlib.suppress(OSError), self._caller:  # a task that was cancelled does not listen
            self._caller.sendall(json.dumps(told).encode())


def begin(work: Callable[[Turns], Told]) -> dict[str, Any]:
    """Start the work; its first turn (`turn`, and in `line` how to come back), or what it returned if it has ended."""
    directory = Path(tempfile.mkdtemp(prefix="rosops-fleet-"))  # short: a socket's path may have 107 characters
    line, run, begun = directory / "line", os.getppid(), started(os.getppid())
    with socket.socket(socket.AF_UNIX) as server:
        server.bind(str(line))
        server.listen(1)
        if os.fork() == 0:
            _live(server, directory, lambda: started(run) == begun, work)
    return come_back(str(line))


def come_back(line: str, failure: str = "") -> dict[str, Any]:
    """Say what came of the turn; the next one, or what the work returned. FleetError if it has ended without a word."""
    with socket.socket(socket.AF_UNIX) as caller:
        try:
            caller.connect(line)
            caller.sendall(json.dumps({"failure": failure}).encode() + b"\n")
            answer = _read(caller)
        except OSError as error:
            raise FleetError(f"the process beside this run has ended: {error}") from error
    if not answer:
        raise FleetError("the process beside this run has ended without a word")
    return {**answer, "line": line}


def _live(server: socket.socket, directory: Path, run_lives: Callable[[], bool], work: Callable[[Turns], Told]) -> None:
    """What the new process does, to its end."""
    try:
        os.setsid()
        with Path(os.devnull).open("r+b") as nothing:  # whoever reads what the run prints does not wait for this
            for number in range(3):
                os.dup2(nothing.fileno(), number)
        for ending in (signal.SIGINT, signal.SIGTERM):
            signal.signal(ending, signal.SIG_IGN)  # the worker's own way to end is not this process'
        with cancellable(run_lives):  # also while nobody has called yet: the worker may have been killed before it did
            turns = Turns(server)
            try:
                told = work(turns)
            except Exception:  # whatever it was, the task that waits has to hear of it
                told = {"error": traceback.format_exc()}
        turns.tell(told)
    finally:
        shutil.rmtree(directory, ignore_errors=True)
        os._exit(0)  # nothing of the worker's is this process' to tidy up


def _read(line: socket.socket) -> dict[str, Any]:
    """One line, or all there is; empty where that is nothing."""
    with line.makefile() as file:
        data = file.readline()
    return dict(json.loads(data)) if data else {}
