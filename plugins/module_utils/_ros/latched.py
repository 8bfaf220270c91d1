# SPDX-License-Identifier: GPL-3.0-or-later
"""Latched messages: taken from a publisher into a file, given out of it. Never whole in memory, a map is large."""

from __future__ import annotations

import socket
import time
from functools import partial
from pathlib import Path
from typing import Callable

from .rpc import Deadline
from .streams import read_exactly, subscribe
from .tcpros import FrameCounter

PIECE = 1 << 16
NOTHING = 0.3  # seconds after which a publisher has nothing latched: it sends that at once
AT_ONCE = 1.0  # seconds within which the first message of one that latches is an old one
FIELDS = ("type", "md5sum", "message_definition")


Reserve = Callable[[str, int], None]  # topic, bytes; RosError: there is no room for them


def take(topic: str, uri: str, caller: str, path: Path, reserve: Reserve, seconds: float) -> dict[str, str] | None:  # noqa: PLR0913 - what is to be had where, and within which bounds
    """Write what is latched to `path`, as it comes on the wire; the publisher's header, or None: nothing is latched.

    RosError or OSError: the publisher or the disk does not do its part, or there is no room.
    """
    sock, header = subscribe(topic, uri, caller, Deadline(seconds))
    with sock:
        if header.get("latching") != "1":
            return None
        sock.deadline = Deadline(min(NOTHING, seconds))
        try:
            prefix = read_exactly(sock, 4)
        except socket.timeout:
            return None
        size = int.from_bytes(prefix, "little")
        reserve(topic, size)
        sock.deadline = Deadline(seconds)
        with path.open("wb") as file:
            file.write(prefix)
            while size:
                piece = read_exactly(sock, min(size, PIECE))
                file.write(piece)
                size -= len(piece)
    return {field: header.get(field, "") for field in FIELDS}


def give(path: Path, sock: socket.socket, seconds: float) -> None:
    """Send it to a subscriber, that has so long for each piece."""
    sock.settimeout(seconds)
    with path.open("rb") as file:
        for piece in iter(partial(file.read, PIECE), b""):
            sock.sendall(piece)


class Ear:
    """Listens whether a publisher says anything, without keeping what."""

    def __init__(self, topic: str, uri: str, caller: str, seconds: float) -> None:
        """RosError or OSError where the publisher does not open a stream within so many seconds."""
        self.topic, self.uri = topic, uri
        self.sock, header = subscribe(topic, uri, caller, Deadline(seconds))
        self.latching, self.md5sum = header.get("latching") == "1", header.get("md5sum", "")
        self.heard = False
        self.news = 0  # messages, without one that had been latched before
        self._frames = FrameCounter()
        self.sock.setblocking(False)

    def listen(self) -> bool:
        """Take what has come; whether it is still connected."""
        try:
            data = socket.socket.recv(self.sock, PIECE)  # TimedSocket's own would wait
        except BlockingIOError:
            return True
        except OSError:
            return False
        if data and not self.heard:
            self.heard = True
            self.news -= self.latching and time.monotonic() - self.sock.opened < AT_ONCE
        self.news += self._frames.feed(data)
        return bool(data)
