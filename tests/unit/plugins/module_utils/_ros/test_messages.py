# SPDX-License-Identifier: GPL-3.0-or-later
"""Fields of messages, by definitions good and bad; and what was heard of them means, on a clock that the tests turn."""

from __future__ import annotations

import math
import struct
from typing import Any

import pytest
from ansible_collections.rosops.fleet.plugins.module_utils._common.errors import RosError
from ansible_collections.rosops.fleet.plugins.module_utils._common.poll import FAIL, PASS, WAIT
from ansible_collections.rosops.fleet.plugins.module_utils._ros.backend import MasterState
from ansible_collections.rosops.fleet.plugins.module_utils._ros.conditions import ValueCondition
from ansible_collections.rosops.fleet.plugins.module_utils._ros.graph import Graph
from ansible_collections.rosops.fleet.plugins.module_utils._ros.messages import (
    Definition,
    Heard,
    check_value,
    numbers,
    value_at,
)
from hypothesis import given
from hypothesis import strategies as st

LINE = "=" * 80
HEADER = f"{LINE}\nMSG: std_msgs/Header\n# Two-integer timestamp\nuint32 seq\ntime stamp\nstring frame_id\n"
POSE = f"""# This contains the position of a point
Header header
Pose pose  # in a frame
uint8[] flags
float32[2] size
geometry_msgs/Point[] path
duration age
{HEADER}{LINE}
MSG: geometry_msgs/Pose
Point position
{LINE}
MSG: geometry_msgs/Point
float64 x
float64 y
"""
STATUS = """byte OK=0
string WORD=a # b
int8 level
string name
bool good
"""


def header(frame: bytes = b"odom") -> bytes:
    return struct.pack("<IIII", 7, 1, 500_000_000, len(frame)) + frame


def point(x: float, y: float) -> bytes:
    return struct.pack("<dd", x, y)


MESSAGE = (
    header()
    + point(1.5, -2.0)
    + struct.pack("<I3B", 3, 1, 2, 255)
    + struct.pack("<ff", 0.25, 4.0)
    + struct.pack("<I", 2)
    + point(3.0, 4.0)
    + point(5.0, 6.0)
    + struct.pack("<ii", -2, 500_000_000)
)


def test_a_message_with_messages_and_lists_in_it() -> None:
    found = Definition("geometry_msgs/PoseThing", POSE).decode(MESSAGE)
    assert found == {
        "header": {"seq": 7, "stamp": 1.5, "frame_id": "odom"},
        "pose": {"position": {"x": 1.5, "y": -2.0}},
        "flags": (1, 2, 255),
        "size": (0.25, 4.0),
        "path": ({"x": 3.0, "y": 4.0}, {"x": 5.0, "y": 6.0}),
        "age": -1.5,
    }
    assert value_at(found, "pose.position.y") == -2.0
    assert value_at(found, "path[1].x") == 5.0
    assert value_at(found, "flags[2]") == 255
    assert list(numbers(found)) == [1.5, -2.0, 1, 2, 255, 0.25, 4.0, 3.0, 4.0, 5.0, 6.0, -1.5]  # without the header's


def test_constants_are_no_fields() -> None:
    body = struct.pack("<bI3s?", -1, 3, b"arm", True)
    found = Definition("a/Status", STATUS).decode(body)
    assert found == {"level": -1, "name": "arm", "good": True}


@pytest.mark.parametrize(
    ("path", "why"),
    [
        ("speed", "it has no field speed: there is header, pose, flags, size, path, age where speed is looked for"),
        ("pose.position.z", "it has no field pose.position.z: there is x, y where z is looked for"),
        ("pose.position.x.y", "there is no fields where y is looked for"),
        ("path[2]", r"where \[2\] is looked for"),
        ("pose[0]", r"there is position where \[0\] is looked for"),
    ],
)
def test_fields_that_are_not_there(path: str, why: str) -> None:
    with pytest.raises(RosError, match=why):
        value_at(Definition("geometry_msgs/PoseThing", POSE).decode(MESSAGE), path)


def many(depth: int) -> str:
    parts = [f"{LINE}\nMSG: a/T{number}\nT{number + 1} one\nT{number + 1} two\n" for number in range(depth)]
    return f"T0 all\n{''.join(parts)}{LINE}\nMSG: a/T{depth}\nbool x\n"


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("Pose pose\n", "does not say what a/Pose is"),
        (f"T0 again\n{LINE}\nMSG: a/T0\nT0 itself\n", "does not say what a/T0 is"),
        ("float64\n", "a line that makes no sense: 'float64'"),
        ("float64[x] y\n", "makes no sense"),
        pytest.param(f"float64[{'9' * 5000}] y\n", "makes no sense", id="digits"),  # which Python would not read
        (many(40), "more than 10000 values"),
    ],
)
def test_definitions_that_are_none(text: str, why: str) -> None:
    with pytest.raises(RosError, match=why):
        Definition("a/B", text)


@given(st.binary(max_size=200), st.integers(0, len(MESSAGE)))
def test_bytes_that_are_no_such_message(rest: bytes, whole: int) -> None:
    """Whatever comes, it is a message or an error of ours, and in time."""
    definition = Definition("geometry_msgs/PoseThing", POSE)
    try:
        found: Any = definition.decode(MESSAGE[:whole] + rest)
    except RosError:
        return
    assert set(found) == {"header", "pose", "flags", "size", "path", "age"}


def test_a_list_that_says_it_is_longer_than_the_message() -> None:
    with pytest.raises(RosError, match="4294967295 of x expected"):
        Definition("a/B", f"E[] x\n{LINE}\nMSG: a/E\n").decode(b"\xff\xff\xff\xff")


# ---- what was heard

STAMP = {"seq": 1, "stamp": 100.0, "frame_id": ""}


def graph(*publishers: str) -> Graph:
    return MasterState({"/t": publishers}, {}, {}).graph


def seen(heard: Heard, now: float = 0.0, *publishers: str) -> tuple[str, str]:
    found = check_value(graph(*(publishers or ("/p",))), heard, now)
    return found.verdict, found.reason


@pytest.mark.parametrize(
    ("bounds", "value", "verdict", "reason"),
    [
        ({"above": 0.4}, 0.41, PASS, "is 0.41"),
        ({"above": 0.4}, 0.4, WAIT, "is 0.4, not above 0.4"),
        ({"above": 0.4}, math.nan, WAIT, "is nan, not above 0.4"),
        ({"above": 0.4}, "full", WAIT, "is 'full', not above 0.4"),
        ({"above": 1.0, "below": 3.0}, 3.5, WAIT, "is 3.5, not above 1.0 and below 3.0"),
        ({"equals": 0.4}, 0.4000000059604645, PASS, "is 0.4"),  # as 32 bits have it
        ({"equals": True}, True, PASS, "is True"),
        ({"equals": True}, 0, WAIT, "is 0, not equal to True"),
        ({"equals": "1"}, 1, WAIT, "is 1, not equal to '1'"),
        ({"equals": "docked"}, "a" * 99, WAIT, f"is '{'a' * 56}..., not equal to 'docked'"),
    ],
)
def test_the_last_value_counts(bounds: dict[str, Any], value: Any, verdict: str, reason: str) -> None:
    heard = Heard(ValueCondition("/t", "a.b", **bounds), 0.0)
    assert seen(heard, 2.0) == (WAIT, "no message in 2.0 s")
    heard.take({"a": {"b": "another"}}, 1.0)
    heard.take({"a": {"b": value}}, 2.0)
    assert seen(heard, 2.0) == (verdict, reason)
    heard.forget()
    assert seen(heard, 2.0)[0] == WAIT


def test_what_was_heard_stands_in_the_check() -> None:
    heard = Heard(ValueCondition("/t", "a", above=1.0), 0.0)
    heard.take({"a": ("x", "y")}, 2.0)
    found = check_value(graph("/p", "/q"), heard, 2.0)
    assert (found.kind, found.name) == ("value", "/t a above 1.0")
    assert found.observed == {"publishers": ["/p", "/q"], "value": "('x', 'y')"}


@pytest.mark.parametrize("wanted", [{"above": 1.0}, {"quiet": 1.0}])
def test_a_field_that_no_message_has_fails_at_once_and_who_cannot_be_heard_may_say_anything(wanted: Any) -> None:
    heard = Heard(ValueCondition("/t", "b", **wanted), 0.0)
    heard.take({"a": 1}, 1.0)
    assert seen(heard, 5.0) == (FAIL, "it has no field b: there is a where b is looked for")
    heard.unheard = {"/q": "no answer"}
    assert seen(heard, 9.0, "/p", "/q") == (WAIT, "not known, as publishers cannot be heard: /q (no answer)")


def test_nobody_publishes() -> None:
    found = check_value(Graph(), Heard(ValueCondition("/t", "a", above=1.0), 0.0), 1.0)
    assert (found.verdict, found.reason) == (WAIT, "nobody publishes it")
    quiet = check_value(Graph(), Heard(ValueCondition("/t", quiet=3.0), 0.0), 3.0)
    assert (quiet.verdict, quiet.reason) == (PASS, "nothing in 3.0 s")


def test_quiet_is_nothing_or_only_zeros() -> None:
    heard = Heard(ValueCondition("/t", quiet=3.0), 10.0)
    assert seen(heard, 12.0) == (WAIT, "2.0 s of 3 s since it is listened to")
    assert seen(heard, 13.0)[0] == PASS
    heard.take({"header": STAMP, "x": 0.0, "name": "a"}, 13.0)
    assert seen(heard, 13.0) == (PASS, "nothing but zeros in 3.0 s")
    heard.take({"x": 0.5}, 14.0)
    heard.take({"x": 0.0}, 16.4)
    assert seen(heard, 16.5) == (WAIT, "2.5 s of 3 s since {'x': 0.5} came")
    assert seen(heard, 17.0) == (PASS, "nothing but zeros in 3.0 s")


def test_still_is_something_and_only_zeros() -> None:
    heard = Heard(ValueCondition("/t", "twist", still=3.0, tolerance=0.01), 10.0)
    assert seen(heard, 13.0) == (WAIT, "not known: no message in 3 s")
    for at in (13.0, 15.0):
        heard.take({"twist": {"x": 0.009, "y": -0.01}, "covariance": (1.0,)}, at)
    assert seen(heard, 16.0) == (PASS, "nothing but zeros in 6.0 s")
    assert seen(heard, 18.1) == (WAIT, "not known: no message in 3 s")  # a driver that died does not stand still
    heard.take({"twist": {"x": -0.011}}, 19.0)
    assert seen(heard, 20.0) == (WAIT, "1.0 s of 3 s since {'x': -0.011} came")
    heard.take({"twist": {"x": math.nan}}, 21.0)
    assert seen(heard, 22.5)[0] == WAIT


def test_a_message_that_cannot_be_read() -> None:
    heard = Heard(ValueCondition("/t", quiet=1.0), 0.0)
    heard.take({}, 5.0, "the message ends early")
    assert seen(heard, 5.0) == (FAIL, "the message ends early")
    heard.take({"x": 0}, 6.0)  # and was one of another publisher
    assert seen(heard, 5.5)[0] == WAIT
