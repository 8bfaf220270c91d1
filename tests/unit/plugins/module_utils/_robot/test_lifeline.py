# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""The connection that tells of the master's end."""

from __future__ import annotations

import contextlib
import socket
import threading
import time
from collections.abc import Callable, Iterator

import pytest
from ansible_collections.rosops.fleet.plugins.module_utils._robot import lifeline as module
from ansible_collections.rosops.fleet.plugins.module_utils._robot.lifeline import Lifeline


class Master:
    """It accepts, and hangs up when it is told to, or after `idle` seconds."""

    def __init__(self, idle: float = 60.0) -> None:
        self.server = socket.create_server(("127.0.0.1", 0))
        self.address: tuple[str, int] = self.server.getsockname()
        self.idle, self.came, self.open = idle, 0, [self.server]
        threading.Thread(target=self._accept, daemon=True).start()

    def _accept(self) -> None:
        with contextlib.suppress(OSError):
            while True:
                peer, _address = self.server.accept()
                self.came += 1
                self.open.append(peer)
                threading.Timer(self.idle, peer.close).start()

    def end(self) -> None:
        """As a process that ends: nothing listens first, then the connections go."""
        for sock in self.open:
            with contextlib.suppress(OSError):
                sock.shutdown(socket.SHUT_RDWR)
            sock.close()


@pytest.fixture
def woken() -> threading.Event:
    return threading.Event()


@pytest.fixture
def masters(monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[[float], Master]]:
    monkeypatch.setattr(module, "LEAST", 0.05)
    made: list[Master] = []

    def master(idle: float = 5.0) -> Master:
        made.append(Master(idle))
        return made[-1]

    yield master
    for one in made:
        one.end()


def until(true: Callable[[], bool]) -> None:
    end = time.monotonic() + 5
    while not true():
        assert time.monotonic() < end
        time.sleep(0.005)


def test_the_end_is_noticed_at_once_and_the_next_master_is_held(
    masters: Callable[..., Master], woken: threading.Event
) -> None:
    master = masters()
    line = Lifeline(master.address, woken.set)
    until(line.hold)
    assert not woken.is_set()
    master.end()
    assert woken.wait(2)
    until(lambda: not line.stands)


def test_a_master_that_hangs_up_on_the_silent_has_not_ended(
    masters: Callable[..., Master], woken: threading.Event
) -> None:
    master = masters(idle=0.1)
    line = Lifeline(master.address, woken.set)
    line.hold()
    until(lambda: master.came >= 4)
    assert not woken.is_set()
    master.end()
    assert woken.wait(2)


def test_one_that_hangs_up_at_once_is_not_connected_to_all_the_time(
    masters: Callable[..., Master], woken: threading.Event
) -> None:
    master = masters(idle=0.0)
    line = Lifeline(master.address, woken.set)
    began = time.monotonic()
    line.hold()
    until(lambda: master.came == 4)
    assert time.monotonic() - began >= 3 * module.LEAST
    assert not woken.is_set()


def test_a_master_that_is_away_wakes_nobody(woken: threading.Event) -> None:
    with socket.create_server(("127.0.0.1", 0)) as closed:
        address = closed.getsockname()
    line = Lifeline(address, woken.set)
    line.hold()
    until(lambda: not line._thread.is_alive())  # type: ignore[union-attr]
    assert not line.hold()
    assert not woken.is_set()
