# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
from __future__ import annotations

import struct

import pytest
from ansible_collections.rosops.fleet.plugins.module_utils._common.errors import RosError
from ansible_collections.rosops.fleet.plugins.module_utils._ros.tcpros import (
    FrameCounter,
    decode_header,
    encode_header,
)
from ansible_collections.rosops.fleet.tests.unit.plugins.fake_ros import frames


@pytest.mark.parametrize(
    ("part", "key", "expected"),
    [
        (
            "topics",
            "/chatter by rospy",
            {"callerid": "/talker_a", "topic": "/chatter", "type": "std_msgs/String", "latching": "0"},
        ),
        (
            "topics",
            "/chatter_relay by roscpp",
            {"callerid": "/relay", "topic": "/chatter_relay", "type": "std_msgs/String", "latching": "0"},
        ),
        ("services", "/trigger by rospy", {"callerid": "/helper", "type": "std_srvs/Trigger"}),
        ("services", "/rosout/get_loggers by roscpp", {"callerid": "/rosout", "type": "roscpp/GetLoggers"}),
        ("services", "/trigger by rospy, unknown service", {"error": "[/helper] is not a provider of  [/nothing]"}),
        (
            "services",
            "/rosout/get_loggers by roscpp, unknown service",
            {"error": "received a tcpros connection for a nonexistent service [/nothing]."},
        ),
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
    for start in range(0, len(data), chunk):
        counter.feed(data[start : start + chunk], float(start))
    assert counter.count == 8


def test_an_unfinished_message_does_not_count() -> None:
    counter = FrameCounter()
    counter.feed(stream(10, 20)[:-1], 1.0)
    assert counter.count == 1
    counter.feed(b"x", 2.0)
    assert (counter.count, counter.last) == (2, 2.0)


def arrivals(*times: float) -> FrameCounter:
    counter = FrameCounter()
    for at in times:
        counter.feed(stream(8), at)
    return counter


@pytest.mark.parametrize(
    ("times", "end", "expected"),
    [
        ([], 1.0, 0.0),
        ([0.5], 2.0, 0.5),
        ([0.1, 0.6], 2.0, 1.0),
        # one per second: an odd phase of the window does not matter
        ([0.9, 1.9, 2.9, 3.9], 4.0, 1.0),
        ([0.01, 1.01, 2.01, 3.01], 4.0, 1.0),
        # a latched message of any age comes first
        ([0.0, 0.3, 1.3, 2.3, 3.3], 4.0, 1.0),
        # 10 Hz that stopped half-way is not 10 Hz
        ([0.1 * i for i in range(1, 11)], 2.0, 8 / 1.8),
        # held up for half the window, then twice as fast to catch up
        ([0.5 + 0.001 * i for i in range(1, 500)], 1.0, 500.0),
        # all at once, in one read
        ([0.2, 0.2, 0.2], 0.25, 12.0),
    ],
)
def test_rates(times: list[float], end: float, expected: float) -> None:
    assert arrivals(*times).rate(0.0, end) == pytest.approx(expected)


def test_the_rate_of_a_steady_stream_read_in_batches() -> None:
    """500 Hz, seen every 7 ms: within half a per cent, though no arrival time is exact."""
    times = [0.007 * (int(0.002 * i / 0.007) + 1) for i in range(500)]
    assert arrivals(*[t for t in times if t <= 1.0]).rate(0.0, 1.0) == pytest.approx(500, rel=0.006)


def test_the_steady_rate_leaves_out_what_is_sent_all_at_once() -> None:
    """500 Hz; 125 messages that a stall had kept back come in one burst within the window."""
    burst = [1.35] * 125
    counter = arrivals(*sorted([1.0 + 0.002 * i for i in range(1, 500)] + burst))
    assert counter.rate(1.0, 2.0) > 600
    assert counter.steady(1.0, 2.0) == pytest.approx(500, rel=0.01)


def test_the_steady_rate_of_a_steady_stream_is_its_rate() -> None:
    counter = arrivals(*[0.005 * (int(0.002 * i / 0.005) + 1) for i in range(1, 500)])  # read in batches
    assert counter.steady(0.0, 1.0) == pytest.approx(500, rel=0.02)


def test_too_few_messages_tell_no_steady_rate() -> None:
    assert arrivals(*[0.05 * i for i in range(1, 20)]).steady(0.0, 1.0) is None
    assert arrivals(*[0.002 * i for i in range(1, 200)]).steady(0.0, 0.4) is None
