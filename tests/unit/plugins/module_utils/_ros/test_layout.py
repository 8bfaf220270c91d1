# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""How long a message of zeros is, and where its number is, by what Definition itself reads there."""

from __future__ import annotations

import struct

import pytest
from ansible_collections.rosops.fleet.plugins.module_utils._common.errors import RosError
from ansible_collections.rosops.fleet.plugins.module_utils._ros.layout import Place, counter, smallest
from ansible_collections.rosops.fleet.plugins.module_utils._ros.messages import Definition

LINE = "=" * 80
HEADER = f"{LINE}\nMSG: std_msgs/Header\nuint32 seq\ntime stamp\nstring frame_id\n"
POINT = f"{LINE}\nMSG: demo/Point\nfloat64 x\nfloat64 y\n"
NAMED = f"{LINE}\nMSG: demo/Named\nstring name\n"

SIZES = {
    "": 0,
    "float64 data": 8,
    "bool a\nint16 b\ntime c\nduration d": 19,
    "string a\nuint8[] b\nPoint[] c": 12,
    "float64[36] a\nPoint[2] b\nNamed[3] c": 36 * 8 + 2 * 16 + 3 * 4,
    "Header header\nuint64 sequence": 16 + 8,
}


@pytest.mark.parametrize("text", SIZES)
def test_a_message_of_zeros(text: str) -> None:
    definition = Definition("demo/Thing", f"{text}\n{HEADER}{POINT}{NAMED}")
    size = smallest(definition)
    assert size == SIZES[text]
    definition.decode(bytes(size))
    if size:
        with pytest.raises(RosError, match="ends early"):
            definition.decode(bytes(size - 1))


def test_nobody_asks_for_a_gigabyte() -> None:
    with pytest.raises(RosError, match="has 4000000000 bytes"):
        smallest(Definition("demo/Thing", "uint8[4000000000] data"))


PLACES = {
    "Header header\nuint64 sequence\nfloat64 celsius": Place((4, 8, -1), "Q", own=False),
    "Header header\nfloat64 celsius": Place((), "I", own=True),
    "float64 celsius\nHeader header": None,
    "Header[] headers": None,
    "float64 data": None,
    "uint8 data\nPoint at\nfloat32[] list\nuint8[3] flags\nint32 sequence": Place((1, 8, 8, -4, 3), "i", own=False),
    "Named[] names\nuint32 sequence": None,
    "Named[2] names\nuint32 sequence": None,
    "uint8 sequence": None,
    "uint32[] sequence": None,
}


@pytest.mark.parametrize("text", PLACES)
def test_the_number_of_a_message(text: str) -> None:
    assert counter(Definition("demo/Thing", f"{text}\n{HEADER}{POINT}{NAMED}")) == PLACES[text]


def test_a_header_alone_is_numbered_by_nobody() -> None:
    assert counter(Definition("std_msgs/Header", "uint32 seq\ntime stamp\nstring frame_id")) is None


def test_the_place_is_where_the_definition_has_it() -> None:
    definition = Definition("demo/Thing", f"Header header\nstring word\nuint64 sequence\n{HEADER}")
    body = struct.pack("<III", 1, 2, 3) + struct.pack("<I4s", 4, b"base") + struct.pack("<I2sQ", 2, b"ab", 77)
    assert definition.decode(body)["sequence"] == 77
    place = counter(definition)
    assert place == Place((4, 8, -1, -1), "Q", own=False)
