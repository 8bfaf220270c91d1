# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""The fields of a message, by the definition that its publisher hands over in its handshake. Pure.

A definition (ROS' `gendeps --cat`) is the text of the type itself and, after a line of 80 `=` and `MSG: package/Type`
each, of the types within it. A message (wiki: msg) is its fields one after the other, little-endian and without
padding: a string and a list of free length begin with a uint32, a time and a duration are two integers of 32 bits. The
publisher is not trusted: what does not fit is a RosError.
"""

from __future__ import annotations

import re
import struct
from dataclasses import dataclass
from typing import Any, Iterator

from .._common.documents import Data
from .._common.errors import RosError
from .tcpros import Reader

NUMBERS = {
    "bool": "?", "int8": "b", "byte": "b", "uint8": "B", "char": "B", "int16": "h", "uint16": "H", "int32": "i",
    "uint32": "I", "int64": "q", "uint64": "Q", "float32": "f", "float64": "d",
}  # fmt: skip
TIMES = {"time": "<II", "duration": "<ii"}
HEADER = "std_msgs/Header"
MOST = 10_000  # values of a message, lists aside: no robot's has as many, and some other might never be read to its end
_SEPARATOR = re.compile(r"^={80}\nMSG: *", re.MULTILINE)
_FIELD = re.compile(r"([\w/]+)(\[(\d*)\])?[ \t]+(\w+)[ \t]*\Z", re.ASCII)
_STEP = re.compile(r"(\w+)|\[(\d+)\]", re.ASCII)


@dataclass(frozen=True)
class Field:
    """One field; `length` of a list of fixed length."""

    name: str
    kind: str
    is_list: bool = False
    length: int | None = None


class Definition:
    """A message type."""

    def __init__(self, name: str, text: str) -> None:
        """`name` is its package/Type."""
        self.name = name
        own, *others = _SEPARATOR.split(text)
        self.types = {name: _fields(name, own)}
        for one in others:
            kind, _newline, body = one.partition("\n")
            self.types[kind.strip()] = _fields(kind.strip(), body)
        self._count(name, {}, ())

    def _count(self, kind: str, counted: dict[str, int], within: tuple[str, ...]) -> int:
        """How many values one has, lists aside; RosError for one that is not there, or is a part of itself."""
        if _is_plain(kind):
            return 1
        if kind not in counted:
            if kind not in self.types or kind in within:
                raise RosError(f"the definition of {self.name} does not say what {kind} is")
            counted[kind] = 1 + sum(self._count(one.kind, counted, (*within, kind)) for one in self.types[kind])
        if counted[kind] > MOST:
            raise RosError(f"{self.name} has more than {MOST} values")
        return counted[kind]

    def decode(self, body: bytes) -> Data:
        """A message's fields by their names: numbers, texts, lists, messages; a time in seconds."""
        found: Data = self._one(self.name, Reader(body))
        return found

    def _one(self, kind: str, reader: Reader) -> Any:
        if kind in NUMBERS:
            return _numbers(reader, NUMBERS[kind], 1)[0]
        if kind in TIMES:
            seconds, nanoseconds = struct.unpack(TIMES[kind], reader.take(8))
            return seconds + nanoseconds / 1e9
        if kind == "string":
            return reader.text()
        return {field.name: self._field(field, reader) for field in self.types[kind]}

    def _field(self, field: Field, reader: Reader) -> Any:
        if not field.is_list:
            return self._one(field.kind, reader)
        count = reader.uint32() if field.length is None else field.length
        if count > reader.left:  # each of them has a byte at least
            raise RosError(f"the message ends early: {count} of {field.name} expected, {reader.left} bytes there")
        if field.kind in NUMBERS:
            return _numbers(reader, NUMBERS[field.kind], count)
        return tuple(self._one(field.kind, reader) for _number in range(count))


def value_at(message: Any, path: str) -> Any:
    """What is at `pose.position.x` or `status[0].level`; RosError where there is no such field."""
    value = message
    for name, index in _STEP.findall(path):
        if name and isinstance(value, dict) and name in value:
            value = value[name]
        elif index and isinstance(value, tuple) and int(index) < len(value):
            value = value[int(index)]
        else:
            there = ", ".join(value) if isinstance(value, dict) else "no fields"
            raise RosError(f"it has no field {path}: there is {there} where {name or f'[{index}]'} is looked for")
    return value


def numbers(value: Any) -> Iterator[float]:
    """Every number in a value but those of headers, which count and stamp the messages."""
    if isinstance(value, dict):
        for name, item in value.items():
            if not (name == "header" and isinstance(item, dict) and "frame_id" in item):
                yield from numbers(item)
    elif isinstance(value, tuple):
        for item in value:
            yield from numbers(item)
    elif isinstance(value, (int, float)):
        yield value


def _fields(kind: str, text: str) -> tuple[Field, ...]:
    package = kind.partition("/")[0]
    found = []
    for line in text.splitlines():
        said = line.partition("#")[0].strip()
        if not said or "=" in said:  # nothing, or a constant
            continue
        match = _FIELD.match(said)
        if match is None:
            raise RosError(f"the definition of {kind} has a line that makes no sense: {said[:100]!r}")
        word, brackets, length, name = match.groups()
        found.append(Field(name, _full(word, package), bool(brackets), int(length) if length else None))
    return tuple(found)


def _is_plain(kind: str) -> bool:
    return kind in NUMBERS or kind in TIMES or kind == "string"


def _full(kind: str, package: str) -> str:
    if _is_plain(kind) or "/" in kind:
        return kind
    return HEADER if kind == "Header" else f"{package}/{kind}"


def _numbers(reader: Reader, code: str, count: int) -> tuple[Any, ...]:
    return struct.unpack(f"<{count}{code}", reader.take(count * struct.calcsize(f"<{code}")))
