# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""actionlib's messages: recorded ones, made ones, and broken ones."""

from __future__ import annotations

import struct

import pytest
from ansible_collections.rosops.fleet.plugins.module_utils._common.errors import RosError
from ansible_collections.rosops.fleet.plugins.module_utils._ros.actionlib import (
    cancel_id,
    decode_status,
    encode_cancel,
    goal_id,
)
from ansible_collections.rosops.fleet.tests.unit.plugins.fake_ros import frames


def states(body: bytes) -> tuple[int, ...]:
    return tuple(state for _goal, state in decode_status(body))


@pytest.mark.parametrize(
    ("key", "expected"), [("never had a goal", ()), ("active", (1,)), ("preempting", (6,)), ("preempted", (2,))]
)
def test_recorded_statuses(key: str, expected: tuple[int, ...]) -> None:
    assert states(frames("statuses", key)[-1]) == expected


def test_several_goals_in_one_status() -> None:
    def goal(name: bytes, state: int, text: bytes) -> bytes:
        return struct.pack("<III", 1, 2, len(name)) + name + bytes([state]) + struct.pack("<I", len(text)) + text

    header = struct.pack("<IIII", 7, 1, 2, 3) + b"map"
    body = header + struct.pack("<I", 3) + goal(b"a-1", 3, b"done") + goal(b"", 0, b"") + goal(b"b", 7, b"x" * 300)
    assert decode_status(body) == [("a-1", 3), ("", 0), ("b", 7)]


def test_a_status_cut_at_any_byte_is_an_error_not_a_crash() -> None:
    body = frames("statuses", "active")[-1]
    for length in range(len(body)):
        with pytest.raises(RosError):
            decode_status(body[:length])


def test_a_status_that_claims_four_billion_goals_is_an_error() -> None:
    with pytest.raises(RosError):
        decode_status(struct.pack("<IIII", 1, 0, 0, 0) + b"\xff\xff\xff\xff")


def text(value: str) -> bytes:
    return struct.pack("<I", len(value)) + value.encode()


HEADER = struct.pack("<III", 5, 100, 200) + text("map")


def test_ids_in_messages() -> None:
    identity = struct.pack("<II", 7, 8) + text("/boss-1-7.000")
    assert goal_id(HEADER + identity + b"whatever the goal is") == ("/boss-1-7.000", (7, 8))
    assert cancel_id(identity) == ("/boss-1-7.000", (7, 8))
    assert cancel_id(encode_cancel("/boss-1")) == ("/boss-1", (0, 0))
    status = HEADER + struct.pack("<I", 1) + identity + bytes([3]) + text("done")
    assert decode_status(status) == [("/boss-1-7.000", 3)]


@pytest.mark.parametrize("body", [b"", HEADER, HEADER + struct.pack("<I", 2**31)])
def test_messages_that_end_early(body: bytes) -> None:
    for decode in (goal_id, decode_status):
        with pytest.raises(RosError):
            decode(body)
