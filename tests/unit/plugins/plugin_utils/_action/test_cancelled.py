# SPDX-License-Identifier: GPL-3.0-or-later
"""What ends a worker: the signals of a cancelled run, and the end of the process that forked it."""

from __future__ import annotations

import multiprocessing
import os
import signal
import threading
from multiprocessing.connection import Connection

import pytest
from ansible_collections.rosops.fleet.plugins.plugin_utils._action.cancelled import cancellable
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.world import CancelledError

FORK = multiprocessing.get_context("fork")
PATIENCE = 30.0


def work(told: Connection) -> None:
    """A worker: it says its process id, and how it ended."""
    signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell's background job is begun without
    with cancellable():
        try:
            told.send(os.getpid())
            threading.Event().wait(PATIENCE)
            told.send("nobody ended it")
        except CancelledError as error:
            told.send(str(error))


def main(told: Connection) -> None:
    """ansible-playbook: it forks a worker."""
    FORK.Process(target=work, args=(told,)).start()
    signal.pause()


@pytest.mark.parametrize("ending", [signal.SIGTERM, signal.SIGINT])
def test_a_signal(ending: int) -> None:
    ours, its = FORK.Pipe()
    worker = FORK.Process(target=work, args=(its,))
    worker.start()
    os.kill(ours.recv(), ending)
    assert ours.poll(PATIENCE)
    assert ours.recv() == "the run was cancelled"
    worker.join(PATIENCE)
    assert worker.exitcode  # it ends by the signal


def test_the_end_of_ansible_playbook() -> None:
    ours, its = FORK.Pipe()
    parent = FORK.Process(target=main, args=(its,))
    parent.start()
    its.close()
    worker = ours.recv()
    parent.kill()
    parent.join(PATIENCE)
    assert ours.poll(PATIENCE), f"the worker {worker} goes on"
    assert ours.recv() == "the run was cancelled"
    with pytest.raises(EOFError):  # it holds the other end no more: it has ended
        ours.recv()
