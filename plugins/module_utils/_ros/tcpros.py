# SPDX-License-Identifier: GPL-3.0-or-later
"""The bytes of TCPROS, ROS 1's transport: handshake headers, frames, and actionlib's messages. Pure, no sockets.

All integers are little-endian. A frame is a uint32 length and that many bytes. A handshake header is a frame of fields,
each a uint32 length and `name=value` (wiki: ROS/TCPROS, ROS/Connection Header). A message frame holds one message
(wiki: msg): strings and lists are a uint32 count and their items, a time is two uint32. The peers are not trusted:
every length is checked against what there is.

Of actionlib's messages ids and states are read, never a goal's content. By std_msgs' and actionlib_msgs' definitions:
    <Action>Goal        Header header, GoalID goal_id, <Goal> goal
    Header              uint32 seq, time stamp, string frame_id
    GoalID              time stamp, string id
    GoalStatusArray     Header header, GoalStatus[] status_list (md5sum 8b2b82f13216d0a8ea88bd3af735e619)
    GoalStatus          GoalID goal_id, uint8 status, string text; the states' names are graph.GOAL_STATES
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


class FrameCounter:
    """Counts messages in a stream without keeping them: reads each length, skips what it says."""

    def __init__(self) -> None:
        self._skip = 0
        self._prefix = b""

    def feed(self, data: bytes | memoryview) -> int:
        """How many messages end in `data`, which follows what was fed before."""
        position, size, ended = 0, len(data), 0
        while True:
            if self._skip > size - position:
                self._skip -= size - position
                return ended
            position += self._skip
            self._skip = 0
            if len(self._prefix) == 4:  # a message ends here
                self._prefix = b""
                ended += 1
            take = min(4 - len(self._prefix), size - position)
            self._prefix += bytes(data[position : position + take])
            position += take
            if len(self._prefix) < 4:
                return ended
            self._skip = _LENGTH.unpack(self._prefix)[0]


# ---- actionlib

STATUS_TYPE = "actionlib_msgs/GoalStatusArray"
CANCEL_TYPE = "actionlib_msgs/GoalID"
CANCEL_MD5SUM = "302881f31927c1df708a2dbab0e80ee8"
CANCEL_DEFINITION = "time stamp\nstring id\n"
RECALLING = 7  # also what a server lists for a goal that it never got, but was told to cancel

NO_STAMP = (0, 0)


def _goal_id(reader: Reader) -> tuple[str, tuple[int, int]]:
    stamp = (reader.uint32(), reader.uint32())
    return reader.text(), stamp


def _header(reader: Reader) -> None:
    reader.take(12)
    reader.text()


def goal_id(body: bytes) -> tuple[str, tuple[int, int]]:
    """Id and stamp of an <Action>Goal."""
    reader = Reader(body)
    _header(reader)
    return _goal_id(reader)


def cancel_id(body: bytes) -> tuple[str, tuple[int, int]]:
    """Id and stamp of a cancel, a GoalID."""
    return _goal_id(Reader(body))


def encode_cancel(goal: str) -> bytes:
    """A cancel of this one goal: without a stamp, as that would cancel all earlier goals, too."""
    text = goal.encode()
    return struct.pack("<III", *NO_STAMP, len(text)) + text


def decode_status(body: bytes) -> list[tuple[str, int]]:
    """(goal id, state) of everything that a GoalStatusArray lists; RosError where the bytes are none."""
    reader = Reader(body)
    _header(reader)
    listed = []
    for _goal in range(reader.uint32()):  # a count that lies runs into the message's end
        goal, _stamp = _goal_id(reader)
        listed.append((goal, reader.take(1)[0]))
        reader.text()
    return listed
