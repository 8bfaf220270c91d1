# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""The bytes of actionlib's messages: ids and states, never a goal's content. Pure.

Layout, from std_msgs' and actionlib_msgs' definitions (see also `tcpros`):
    <Action>Goal        Header header, GoalID goal_id, <Goal> goal
    Header              uint32 seq, time stamp, string frame_id
    GoalID              time stamp, string id
    GoalStatusArray     Header header, GoalStatus[] status_list (md5sum 8b2b82f13216d0a8ea88bd3af735e619)
    GoalStatus          GoalID goal_id, uint8 status, string text; the states' names are graph.GOAL_STATES
"""

from __future__ import annotations

import struct

from .tcpros import Reader

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
