# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""The bytes of TCPROS, ROS 1's transport: handshake headers and message frames. Pure, no sockets.

All integers are little-endian. A frame is a uint32 length and that many bytes. A handshake header is a frame of fields,
each a uint32 length and `name=value` (wiki: ROS/TCPROS, ROS/Connection Header). A message frame holds one message
(wiki: msg): strings and lists are a uint32 count and their items, a time is two uint32. The peers are not trusted:
every length is checked against what there is.
"""

from __future__ import annotations

import struct
from typing import Mapping

from .._common.errors import RosError

_LENGTH = struct.Struct("<I")


def encode_header(fields: Mapping[str, str]) -> bytes:
    """A handshake header with its length in front."""
    items = [f"{name}={value}".encode() for name, value in fields.items()]
    body = b"".join(_LENGTH.pack(len(item)) + item for item in items)
    return _LENGTH.pack(len(body)) + body


def decode_header(body: bytes) -> dict[str, str]:
    """The fields of a handshake header (without its own length)."""
    reader = Reader(body)
    fields = {}
    while reader.left:
        name, separator, value = reader.text().partition("=")
        if not separator:
            raise RosError("a field of the handshake has no value")
        fields[name] = value
    return fields


class Reader:
    """Takes values from the front of a message."""

    def __init__(self, data: bytes) -> None:
        self.data = data
        self.at = 0

    @property
    def left(self) -> int:
        return len(self.data) - self.at

    def take(self, count: int) -> bytes:
        if count > self.left:
            raise RosError(f"the message ends early: {count} bytes expected, {self.left} there")
        self.at += count
        return self.data[self.at - count : self.at]

    def uint32(self) -> int:
        value: int = _LENGTH.unpack(self.take(4))[0]
        return value

    def text(self) -> str:
        return self.take(self.uint32()).decode("utf-8", "replace")


STEADY_MESSAGES, STEADY_TENTHS = 50, 8  # for tenths of a second to tell a rate


class FrameCounter:
    """Counts messages in a stream without keeping them: reads each length, skips what it says."""

    def __init__(self) -> None:
        self.count = 0
        self.second = 0.0  # when the second message was there, and
        self.last = 0.0  # the last one
        self._tenths: dict[int, int] = {}  # messages by tenth of a second
        self._skip = 0
        self._prefix = b""

    def feed(self, data: bytes | memoryview, at: float) -> None:
        """`data` arrived at time `at`."""
        position, size = 0, len(data)
        while True:
            if self._skip > size - position:
                self._skip -= size - position
                return
            position += self._skip
            self._skip = 0
            if len(self._prefix) == 4:  # a message ends here
                self._prefix = b""
                self._ended(at)
            take = min(4 - len(self._prefix), size - position)
            self._prefix += bytes(data[position : position + take])
            position += take
            if len(self._prefix) < 4:
                return
            self._skip = _LENGTH.unpack(self._prefix)[0]

    def _ended(self, at: float) -> None:
        self.count += 1
        if self.count == 2:
            self.second = at
        self.last = at
        tenth = int(at * 10)
        self._tenths[tenth] = self._tenths.get(tenth, 0) + 1

    def steady(self, start: float, end: float) -> float | None:
        """Messages per second without what is sent all at once, after the publisher was held up; None where too few.

        The mean of the middle half of the tenths of a second: a burst, and the stall before it, are in the others.
        """
        tenths = range(int(start * 10) + 1, int(end * 10))
        if self.count < STEADY_MESSAGES or len(tenths) < STEADY_TENTHS:
            return None
        counts = sorted(self._tenths.get(tenth, 0) for tenth in tenths)
        cut = len(counts) // 4
        middle = counts[cut : len(counts) - cut]
        return 10 * sum(middle) / len(middle)

    def rate(self, start: float, end: float) -> float:
        """Messages per second between `start` and `end`.

        Taken between arrivals, which is exact where a window holds only a few messages. The first message does not
        count: it may be a latched one of any age. A silence at the end does: it is no part of a steady stream. Nor is
        one at the beginning, after which a publisher that was held up sends all at once what it owes: never more than
        what the whole window holds.
        """
        if self.count < 3:
            return self.count / (end - start) if end > start else 0.0
        intervals, most = self.count - 2, (self.count + 1) / (end - start)
        if end - self.last > 2 * (self.last - self.second) / intervals + 0.05:
            return min(most, intervals / (end - self.second))
        if self.last <= self.second:
            return self.count / (end - start)
        return min(most, intervals / (self.last - self.second))
