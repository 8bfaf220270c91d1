# SPDX-License-Identifier: GPL-3.0-or-later
"""Recorded bytes, made ones, and broken ones."""

from __future__ import annotations

import struct

import pytest
from ansible_collections.rosops.fleet.plugins.module_utils._common.errors import RosError
from ansible_collections.rosops.fleet.plugins.module_utils._ros.tcpros import (
    FrameCounter,
    cancel_id,
    decode_header,
    decode_status,
    encode_cancel,
    encode_header,
    goal_id,
)
from ansible_collections.rosops.fleet.tests.unit.plugins.fake_ros import frames


@pytest.mark.parametrize(
    ("part", "key", "expected"),
    [
        ("topics", "/chatter_relay by roscpp", {"callerid": "/relay", "topic": "/chatter_relay", "latching": "0"}),
        ("services", "/rosout/get_loggers by roscpp", {"callerid": "/rosout", "type": "roscpp/GetLoggers"}),
        ("services", "/trigger by rospy, unknown service", {"error": "[/helper] is not a provider of  [/nothing]"}),
        ("statuses", "active", {"callerid": "/worker", "latching": "1", "type": "actionlib_msgs/GoalStatusArray"}),
    ],
)
def test_recorded_headers(part: str, key: str, expected: dict[str, str]) -> None:
    fields = decode_header(frames(part, key)[0])
    assert {name: fields.get(name) for name in expected} == expected


def test_a_header_survives_both_ways() -> None:
    fields = {"callerid": "/us", "md5sum": "*", "message_definition": "a=b\nc", "empty": ""}
    data = encode_header(fields)
    assert struct.unpack("<I", data[:4])[0] == len(data) - 4
    assert decode_header(data[4:]) == fields


@pytest.mark.parametrize(
    "body", [b"\x05", b"\xff\xff\xff\xff", b"\x05\x00\x00\x00a=b", b"\x03\x00\x00\x00abc"], ids=repr
)
def test_a_malformed_header_is_an_error(body: bytes) -> None:
    with pytest.raises(RosError):
        decode_header(body)


# ---- counting


def stream(*sizes: int) -> bytes:
    return b"".join(struct.pack("<I", size) + b"\xff" * size for size in sizes)


@pytest.mark.parametrize("chunk", [1, 2, 3, 4, 5, 7, 64, 10_000])
def test_messages_are_counted_however_the_bytes_arrive(chunk: int) -> None:
    data = stream(10, 0, 1, 300, 0, 0, 4, 5)
    counter = FrameCounter()
    assert sum(counter.feed(data[start : start + chunk]) for start in range(0, len(data), chunk)) == 8


def test_an_unfinished_message_does_not_count() -> None:
    counter = FrameCounter()
    assert counter.feed(stream(10, 20)[:-1]) == 1
    assert counter.feed(b"x") == 1


# ---- actionlib


@pytest.mark.parametrize(
    ("key", "expected"), [("never had a goal", []), ("active", [1]), ("preempting", [6]), ("preempted", [2])]
)
def test_recorded_statuses(key: str, expected: list[int]) -> None:
    assert [state for _goal, state in decode_status(frames("statuses", key)[-1])] == expected


def text(value: str) -> bytes:
    return struct.pack("<I", len(value)) + value.encode()


HEADER = struct.pack("<III", 5, 100, 200) + text("map")


def test_ids_and_states_in_messages() -> None:
    identity = struct.pack("<II", 7, 8) + text("/boss-1-7.000")
    assert goal_id(HEADER + identity + b"whatever the goal is") == ("/boss-1-7.000", (7, 8))
    assert cancel_id(identity) == ("/boss-1-7.000", (7, 8))
    assert cancel_id(encode_cancel("/boss-1")) == ("/boss-1", (0, 0))
    unnamed = struct.pack("<II", 1, 2) + text("")
    status = (
        HEADER + struct.pack("<I", 2) + identity + bytes([3]) + text("done") + unnamed + bytes([7]) + text("x" * 300)
    )
    assert decode_status(status) == [("/boss-1-7.000", 3), ("", 7)]


ACTIVE = frames("statuses", "active")[-1]


def test_a_message_cut_at_any_byte_is_an_error_not_a_crash() -> None:
    for body in (HEADER + b"\xff\xff\xff\xff", *(ACTIVE[:length] for length in range(len(ACTIVE)))):
        with pytest.raises(RosError):
            decode_status(body)
    for body in (b"", HEADER, HEADER + struct.pack("<I", 2**31)):
        with pytest.raises(RosError):
            goal_id(body)
