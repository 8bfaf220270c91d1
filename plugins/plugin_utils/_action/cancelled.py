# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""The end of a run that is cancelled: asked for by a signal, or seen by a worker whose ansible-playbook was killed."""

from __future__ import annotations

import contextlib
import multiprocessing
import os
import signal
import threading
from collections.abc import Iterator
from types import FrameType

from ansible_collections.rosops.fleet.plugins.plugin_utils._update.ticker import ticking
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.world import CancelledError

PARENT_SECONDS = 1.0  # a run that was killed is nobody's after that time


@contextlib.contextmanager
def cancellable() -> Iterator[None]:
    """SIGINT and SIGTERM end the step where it stands, held goals are let go, and only then the worker ends.

    So does the end of the process that started this worker. SIGKILL ends ansible-playbook alone, and that is how some
    tools cancel a run; its workers would go on by themselves, and nobody would ever hear of what they do.
    """
    caught: list[int] = []

    def cancel(number: int, _frame: FrameType | None) -> None:
        if not caught:  # whoever is impatient sends it again
            caught.append(number)
            raise CancelledError("the run was cancelled")

    before = {number: signal.signal(number, cancel) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        with ticking(PARENT_SECONDS, _end_with_parent):
            yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
        if caught:
            os.kill(os.getpid(), caught[0])


def _end_with_parent() -> None:
    """Send this process SIGTERM where the one that forked it has gone."""
    parent = multiprocessing.parent_process()
    if parent and os.getppid() != parent.pid:
        signal.pthread_kill(int(threading.main_thread().ident or 0), signal.SIGTERM)
