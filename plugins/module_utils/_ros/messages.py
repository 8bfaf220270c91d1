# SPDX-License-Identifier: GPL-3.0-or-later
"""What messages say: their fields, by the definition that a publisher hands over in its handshake, and what a condition
makes of what was heard of a topic. Pure: time is told to it.

A definition (ROS' `gendeps --cat`) is the text of the type itself and, after a line of 80 `=` and `MSG: package/Type`
each, of the types within it. A message (wiki: msg) is its fields one after the other, little-endian and without
padding: a string and a list of free length begin with a uint32, a time and a duration are two integers of 32 bits. The
publisher is not trusted: what does not fit is a RosError.
"""

from __future__ import annotations

import math
import re
import struct
from dataclasses import dataclass, field
from typing import Any, Iterator, Mapping

from .._common.documents import Data, Document
from .._common.errors import RosError
from .._common.poll import FAIL, PASS, WAIT
from .checks import Check, listed
from .conditions import ValueCondition
from .graph import Graph, names_of
from .tcpros import Reader

NUMBERS = {
    "bool": "?", "int8": "b", "byte": "b", "uint8": "B", "char": "B", "int16": "h", "uint16": "H", "int32": "i",
    "uint32": "I", "int64": "q", "uint64": "Q", "float32": "f", "float64": "d",
}  # fmt: skip
TIMES = {"time": "<II", "duration": "<ii"}
HEADER = "std_msgs/Header"
MOST = 10_000  # values of a message, lists aside: no robot's has as many, and some other might never be read to its end
CLOSE = 1e-6  # of a number that a message has with 32 bits, to the one that is written in a condition
_SEPARATOR = re.compile(r"^={80}\nMSG: *", re.MULTILINE)
_FIELD = re.compile(r"([\w/]+)(\[(\d{0,9})\])?[ \t]+(\w+)[ \t]*\Z", re.ASCII)
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
        return {one.name: self._field(one, reader) for one in self.types[kind]}

    def _field(self, one: Field, reader: Reader) -> Any:
        if not one.is_list:
            return self._one(one.kind, reader)
        count = reader.uint32() if one.length is None else one.length
        if count > reader.left:  # each of them has a byte at least
            raise RosError(f"the message ends early: {count} of {one.name} expected, {reader.left} bytes there")
        if one.kind in NUMBERS:
            return _numbers(reader, NUMBERS[one.kind], count)
        return tuple(self._one(one.kind, reader) for _number in range(count))


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


# ---- what was heard


@dataclass
class Heard:
    """Of one condition's topic, since somebody listens. Times are by a clock that nobody sets."""

    condition: ValueCondition
    since: float
    value: Any = None  # of the condition's field, or the whole message
    came: float | None = None  # when the last message did
    stirred: float | None = None  # when the last one did that is not all zeros,
    stir: Any = None  # and what it was
    wrong: str = ""  # what its publisher itself says against the condition
    unheard: Mapping[str, str] = field(default_factory=dict)  # publisher -> why it cannot be heard

    def take(self, message: Document, now: float, wrong: str = "") -> None:
        """A message came; or one that cannot be read, and why."""
        self.came, self.wrong, self.value = now, wrong, message
        if self.condition.field and not wrong:
            try:
                self.value = value_at(message, self.condition.field)
            except RosError as error:
                self.wrong = str(error)
        if self.condition.seconds and (self.wrong or not self._zero()):
            self.stirred, self.stir = now, self.value

    def _zero(self) -> bool:
        """NaN is none."""
        return all(abs(number) <= self.condition.tolerance for number in numbers(self.value))

    def forget(self) -> None:
        """Whoever said it is gone: what it said last may not be so any more."""
        self.value, self.came, self.wrong = None, None, ""


def check_value(graph: Graph, heard: Heard, now: float) -> Check:
    """Who cannot be heard may say anything: that is waited for."""
    wanted = heard.condition
    publishers = names_of(graph.topic(wanted.topic).publishers)
    observed: Data = {"publishers": publishers}
    if heard.unheard:
        told = listed(f"{node} ({why})" for node, why in heard.unheard.items())
        verdict, reason = WAIT, f"not known, as publishers cannot be heard: {told}"
    elif heard.wrong:
        verdict, reason = FAIL, heard.wrong
    elif wanted.seconds:
        verdict, reason = _span(heard, now)
    elif heard.came is None:
        verdict, reason = WAIT, f"no message in {now - heard.since:.1f} s" if publishers else "nobody publishes it"
    else:
        observed["value"] = heard.value if isinstance(heard.value, (int, float)) else _short(heard.value)
        good = _is_within(wanted, heard.value)
        verdict, reason = PASS if good else WAIT, f"is {_short(heard.value)}{'' if good else f', not {wanted.bounds}'}"
    return Check("value", str(wanted), verdict, reason, observed)


def _span(heard: Heard, now: float) -> tuple[str, str]:
    wanted = heard.condition
    seconds = wanted.seconds
    calm = now - (heard.since if heard.stirred is None else heard.stirred)
    silent = heard.came is None or now - heard.came > seconds
    if calm < seconds:
        since = "since it is listened to" if heard.stirred is None else f"since {_short(heard.stir)} came"
        return WAIT, f"{calm:.1f} s of {seconds:g} s {since}"
    if wanted.still and silent:
        return WAIT, f"not known: no message in {seconds:g} s"
    return PASS, f"{'nothing' if silent else 'nothing but zeros'} in {calm:.1f} s"


def _is_within(wanted: ValueCondition, value: Any) -> bool:
    if wanted.equals is not None:
        both = isinstance(value, (int, float)) and isinstance(wanted.equals, (int, float))
        return math.isclose(value, wanted.equals, rel_tol=CLOSE) if both else bool(value == wanted.equals)
    if not isinstance(value, (int, float)):
        return False
    return (wanted.above is None or value > wanted.above) and (wanted.below is None or value < wanted.below)


def _short(value: Any) -> str:
    text = f"{value:g}" if isinstance(value, float) else repr(value)
    return text if len(text) <= 60 else f"{text[:57]}..."
