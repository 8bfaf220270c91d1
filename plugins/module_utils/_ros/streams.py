# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""The messages of topics as they come: counted, or handed on one by one."""

from __future__ import annotations

import contextlib
import selectors
import socket
import threading
import time
from typing import Any, Callable, Mapping

from .._common.errors import RosError
from .graph import Rate
from .rpc import Deadline, TimedSocket
from .tcpros import FrameCounter
from .transport import read_frame, subscribe

TICK = 0.005  # read a stream in batches: waking up for each message would cost the robot's CPU
MAX_MESSAGE = 64 * 1024 * 1024
SILENCE = 86400.0  # a stream that is silent for a day is connected anew


class TopicStream(threading.Thread):
    """The messages of one publisher, handed to `receive` one by one, until it ends or is closed."""

    def __init__(self, caller: str, topic: str, uri: str, receive: Callable[[bytes], None]) -> None:
        super().__init__(daemon=True, name=f"{topic} {uri}")
        self.caller, self.topic, self.uri, self.receive = caller, topic, uri, receive
        self.header: dict[str, str] = {}
        self.open = False
        self.sock: TimedSocket | None = None

    def connect(self, seconds: float) -> None:
        """Shake hands; after that, the publisher sends us everything."""
        self.sock, self.header = subscribe(self.topic, self.uri, self.caller, Deadline(seconds))
        self.open = True
        self.start()

    def run(self) -> None:
        if self.sock is None:  # only for the type checker: start() comes after the connection
            return
        try:
            while self.open:
                self.sock.deadline = Deadline(SILENCE)
                self.receive(read_frame(self.sock, MAX_MESSAGE))
        except (OSError, RosError):
            pass
        finally:
            self.open = False
            self.sock.close()

    def close(self) -> None:
        self.open = False
        if self.sock is not None:
            with contextlib.suppress(OSError):
                self.sock.shutdown(socket.SHUT_RDWR)


def count_messages(sockets: Mapping[Any, TimedSocket], seconds: Mapping[str, float]) -> dict[Any, Rate]:
    """Read all streams until each topic's time is over. One thread; messages are skipped, not copied.

    A stream's time begins when it was opened: what it sent while others were still being opened (one dead peer takes
    its whole time-out) waits here and belongs to that time.
    """
    start = time.monotonic()
    counters = {key: FrameCounter() for key in sockets}
    ends = {key: start + seconds[key[0]] for key in sockets}
    buffer = bytearray(1 << 18)
    view = memoryview(buffer)
    rates: dict[Any, Rate] = {}
    with selectors.DefaultSelector() as selector:
        for key, sock in sockets.items():
            sock.setblocking(False)
            selector.register(sock, selectors.EVENT_READ, key)
        while True:
            at = time.monotonic()
            for key in [key for key in sockets if key not in rates and ends[key] <= at]:
                began = sockets[key].opened
                counter = counters[key]
                steady = counter.steady(start, at)  # before that nobody read, and a tenth without a message is no news
                rates[key] = Rate(counter.rate(began, at), counter.count, at - began, steady=steady)
                _leave(selector, sockets[key])
            if len(rates) == len(sockets):
                return rates
            for ready, _events in selector.select(timeout=TICK * 4):
                if not _drain(sockets[ready.data], view, counters[ready.data]):
                    _leave(selector, sockets[ready.data])  # the rest of its window is silence
            time.sleep(TICK)


def _leave(selector: selectors.BaseSelector, sock: TimedSocket) -> None:
    if sock.fileno() >= 0:
        selector.unregister(sock)
        sock.close()


def _drain(sock: TimedSocket, view: memoryview, counter: FrameCounter) -> bool:
    """Feed what has arrived; False at the stream's end."""
    for _read in range(16):  # one fast stream must not keep the others waiting
        try:
            size = socket.socket.recv_into(sock, view)
        except (BlockingIOError, InterruptedError):
            return True
        except OSError:
            return False
        if not size:
            return False
        counter.feed(view[:size], time.monotonic())
        if size < len(view):
            return True
    return True


def hang_up(sock: socket.socket) -> None:
    """End a connection, or a listener, that another thread may be waiting on."""
    with contextlib.suppress(OSError):
        sock.shutdown(socket.SHUT_RDWR)
    sock.close()
