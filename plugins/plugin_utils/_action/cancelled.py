# SPDX-License-Identifier: GPL-3.0-or-later
"""The end of a run that is cancelled: asked for by a signal, or seen by a worker whose ansible-playbook was killed."""

from __future__ import annotations

import contextlib
import multiprocessing
import os
import signal
import threading
from collections.abc import Callable, Iterator
from types import FrameType

from .._update.world import CancelledError, ticking

PARENT_SECONDS = 1.0  # a run that was killed is nobody's after that time


def parent_lives() -> bool:
    """Whether the process that forked this one is there."""
    parent = multiprocessing.parent_process()
    return parent is None or os.getppid() == parent.pid


@contextlib.contextmanager
def cancellable(run_lives: Callable[[], bool] = parent_lives) -> Iterator[None]:
    """SIGINT and SIGTERM end the step where it stands, held goals are let go, and only then the worker ends.

    So does the end of the run, as `run_lives` sees it. SIGKILL ends ansible-playbook alone, and that is how some tools
    cancel a run; its workers would go on by themselves, and nobody would ever hear of what they do.
    """
    caught: list[int] = []

    def cancel(number: int, _frame: FrameType | None) -> None:
        if not caught:  # whoever is impatient sends it again
            caught.append(number)
            raise CancelledError("the run was cancelled")

    before = {number: signal.signal(number, cancel) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        with ticking(PARENT_SECONDS, lambda: None if run_lives() else _end()):
            yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
        if caught:
            os.kill(os.getpid(), caught[0])


def _end() -> None:
    signal.pthread_kill(int(threading.main_thread().ident or 0), signal.SIGTERM)
