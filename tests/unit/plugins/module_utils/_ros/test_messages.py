# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Fields of messages, by definitions as publishers hand them over, and by some that they never should."""

from __future__ import annotations

import struct
from typing import Any

import pytest
from ansible_collections.rosops.fleet.plugins.module_utils._common.errors import RosError
from ansible_collections.rosops.fleet.plugins.module_utils._ros.messages import Definition, numbers, value_at
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
