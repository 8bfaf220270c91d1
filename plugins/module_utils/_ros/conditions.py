# SPDX-License-Identifier: GPL-3.0-or-later
"""What the ROS graph must show: the options, their checks, and the conditions made of them. Pure."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass, fields, is_dataclass, replace
from typing import Any, Callable, Mapping, TypeVar

from .._common.documents import Data, Document
from .._common.errors import SpecError
from .names import renamed, resolve


def _each(**options: Document) -> Data:
    """A list of these."""
    return {"type": "list", "elements": "dict", "default": [], "options": options}


_NUMBER, _COUNT, _WORD = {"type": "float"}, {"type": "int"}, {"type": "str"}
_FLAG, _WANTED = {"type": "bool", "default": False}, {"type": "str", "required": True}
_NAMES: Data = {"type": "list", "elements": "str", "default": []}
# the options of ros_ready: how long to look, and what for
WAIT_ARGS: dict[str, Data] = {
    "timeout": {"type": "float", "default": 60.0},
    "interval": {"type": "float", "default": 0.5},
    "consecutive": {"type": "int", "default": 1},
    "stable": {"type": "float", "default": 0.0},
}
GATE_ARGS: dict[str, Data] = {
    "nodes": _NAMES,
    "topics": _each(
        name=_WANTED, type=_WORD, publishers=_COUNT, subscribers=_COUNT, connected=_FLAG, min_rate=_NUMBER,
        latched=_FLAG, publisher=_WORD,
    ),
    "services": _each(name=_WANTED),
    "actions": _each(name=_WANTED, state={"type": "str", "choices": ["up", "idle"], "default": "up"}),
    "edges": _each(
        publisher=_WANTED, topic=_WANTED, subscriber=_WANTED,
        peer={"type": "str", "choices": ["publisher", "subscriber"]},
    ),
    "absent": _NAMES,
    "namespace": {"type": "str", "default": "/"},
}  # fmt: skip

# what messages and HTTP servers must say, for whoever waits for that
VALUE_ARGS: dict[str, Data] = {
    "values": _each(
        topic=_WORD, url=_WORD, field={"type": "str", "default": ""}, above=_NUMBER, below=_NUMBER,
        equals={"type": "raw"}, quiet=_NUMBER, still=_NUMBER, tolerance={"type": "float", "default": 0.0},
    ),
}  # fmt: skip
SPANS = ("quiet", "still")
VALUE_KEYS = ("above", "below", "equals", *SPANS)

# a look costs the robot time, so there is a smallest pause between two
_LEAST = {
    "timeout": (0.0, " s"),
    "interval": (0.05, " s"),
    "consecutive": (1, ""),
    "stable": (0.0, " s"),
    "node_timeout": (0.05, " s"),
}

_Read = TypeVar("_Read")
_NAME = re.compile(r"^(/\w+|[A-Za-z_]\w*)(/\w+)*\Z", re.ASCII)
_TYPE = re.compile(r"^[A-Za-z]\w*/[A-Za-z]\w*\Z", re.ASCII)
_URL = re.compile(r"^https?://[\w.:\[\]-]+(/[!-~]*)?\Z", re.ASCII)
_FIELD = re.compile(r"^[A-Za-z]\w*(\[\d+\])?(\.[A-Za-z]\w*(\[\d+\])?)*\Z", re.ASCII)


@dataclass(frozen=True)
class TopicCondition:
    """What a topic must show. With no number and no `connected` given, it needs one publisher.

    With a `publisher`, it is that node whose connections, rate, type and latching are judged, and nobody else's.
    """

    name: str
    type: str | None = None
    publishers: int | None = None
    subscribers: int | None = None
    connected: bool = False
    min_rate: float | None = None
    publisher: str | None = None
    latched: bool = False


@dataclass(frozen=True)
class ActionCondition:
    """`server`: the node whose idleness counts whatever others serve the action; one that tells nothing may be busy."""

    name: str
    state: str = "up"
    server: str = ""


@dataclass(frozen=True)
class EdgeCondition:
    """A connection. `peer` is the end ("publisher" or "subscriber") that may leave by itself; empty: neither."""

    publisher: str
    topic: str
    subscriber: str
    peer: str = ""

    def __str__(self) -> str:
        return f"{self.publisher} -> {self.topic} -> {self.subscriber}"


@dataclass(frozen=True)
class ValueCondition:
    """What a topic's messages must say, or that a `url` answers with 2xx.

    Of a topic: a field `above`, `below` or `equals` something in the last one; or for seconds
    that nothing came but zeros (`quiet`), or that something came, and nothing but zeros (`still`).

    Zeros are numbers up to `tolerance`, of the field or without one of the whole message but its header.
    """

    topic: str = ""
    field: str = ""
    above: float | None = None
    below: float | None = None
    equals: Any = None
    quiet: float | None = None
    still: float | None = None
    tolerance: float = 0.0
    url: str = ""

    @property
    def bounds(self) -> str:
        """What the field has to be, in words."""
        said = (("above", self.above), ("below", self.below), ("equal to", self.equals))
        return " and ".join(f"{word} {limit!r}" for word, limit in said if limit is not None)

    @property
    def seconds(self) -> float:
        """For which it has to be quiet or still; 0 where a value counts."""
        return self.quiet or self.still or 0.0

    def __str__(self) -> str:
        seconds = [f"{word} for {time:g} s" for word, time in (("quiet", self.quiet), ("still", self.still)) if time]
        return self.url or " ".join(filter(None, (self.topic, self.field, *seconds, self.bounds)))


@dataclass(frozen=True)
class Conditions:
    nodes: tuple[str, ...] = ()
    topics: tuple[TopicCondition, ...] = ()
    services: tuple[str, ...] = ()
    actions: tuple[ActionCondition, ...] = ()
    absent: tuple[str, ...] = ()
    edges: tuple[EdgeCondition, ...] = ()
    values: tuple[ValueCondition, ...] = ()

    def renamed(self, renames: Mapping[str, str]) -> Conditions:
        """The same after nodes' renaming. What messages say is left as it is."""
        found: Conditions = _renamed(self, renames)
        return replace(found, values=self.values)


def _renamed(part: Any, renames: Mapping[str, str]) -> Any:
    """A part of conditions. Nothing in it but a graph name begins with a slash."""
    if isinstance(part, str):
        return renamed(part, renames)
    if isinstance(part, tuple):
        return tuple(_renamed(one, renames) for one in part)
    if is_dataclass(part) and not isinstance(part, type):
        return replace(part, **{one.name: _renamed(getattr(part, one.name), renames) for one in fields(part)})
    return part


def conditions_from(params: Document) -> Conditions:
    """Module options (or a probe's JSON) -> conditions. Every bad value is named in one error."""
    reader = _Reader(params)
    found = Conditions(
        reader.each("nodes", reader.name),
        reader.each("topics", reader.topic),
        reader.each("services", lambda path, item: reader.name(f"{path}.name", item.get("name"))),
        reader.each("actions", reader.action),
        reader.each("absent", reader.name),
        reader.each("edges", reader.edge),
        reader.each("values", reader.value),
    )
    reader.errors += [f"absent: {name} is in nodes, too" for name in sorted({*found.nodes} & {*found.absent} - {""})]
    if reader.errors:
        raise SpecError("; ".join(reader.errors), errors=reader.errors)
    return found


class _Reader:
    """Reads options, and notes what is wrong with them. Choices are the argument spec's."""

    def __init__(self, params: Document) -> None:
        self.params = params
        self.errors: list[str] = []
        self.space, self.timeout = params.get("namespace") or "/", params.get("timeout")
        if not (self.space == "/" or _NAME.match(self.space.rstrip("/"))):
            self.errors.append(f"namespace: {self.space!r} is not a ROS name")
        for option, (least, unit) in _LEAST.items():
            self.number(option, params.get(option), least, unit)
        stable = params.get("stable")
        if stable and self.timeout is not None and math.isfinite(stable) and stable > self.timeout >= 0:
            self.errors.append(f"stable: {stable} s do not fit into the timeout of {self.timeout} s")

    def number(self, path: str, value: Any, least: float = 0.0, unit: str = "") -> None:
        if value is not None and not (math.isfinite(value) and value >= least):
            self.errors.append(f"{path}: {value} is not at least {least:g}{unit}")

    def name(self, path: str, name: Any) -> str:
        if isinstance(name, str) and _NAME.match(name):
            return resolve(name, self.space)
        hint = "; write a private name out as /node/name" if str(name).startswith("~") else ""
        self.errors.append(f"{path}: {name!r} is not a ROS name (letters, digits and _ between slashes{hint})")
        return ""

    def each(self, option: str, read: Callable[[str, Any], _Read]) -> tuple[_Read, ...]:
        return tuple(read(f"{option}[{i}]", item) for i, item in enumerate(self.params.get(option) or ()))

    def topic(self, path: str, item: Document) -> TopicCondition:
        if item.get("type") and not _TYPE.match(item["type"]):
            self.errors.append(f"{path}.type: {item['type']!r} is not a message type (package/Type)")
        for key in ("publishers", "subscribers", "min_rate"):
            self.number(f"{path}.{key}", item.get(key))
        # an option that was left out is None
        found = {one.name: item[one.name] for one in fields(TopicCondition) if item.get(one.name) not in (None, "")}
        found["name"] = self.name(f"{path}.name", item.get("name"))
        if "publisher" in found:
            found["publisher"] = self.name(f"{path}.publisher", item["publisher"])
        return TopicCondition(**found)

    def action(self, path: str, item: Document) -> ActionCondition:
        server = self.name(f"{path}.server", item["server"]) if item.get("server") else ""
        return ActionCondition(self.name(f"{path}.name", item.get("name")), item.get("state") or "up", server)

    def edge(self, path: str, item: Document) -> EdgeCondition:
        names = {key: self.name(f"{path}.{key}", item.get(key)) for key in ("publisher", "topic", "subscriber")}
        return EdgeCondition(**names, peer=item.get("peer") or "")

    def value(self, path: str, item: Document) -> ValueCondition:
        if item.get("url"):
            if not _URL.match(item["url"]):
                self.errors.append(f"{path}.url: {item['url']!r} is not http://<host>[:<port>][/<path>], or https")
            beside = [key for key in ("topic", "field", *VALUE_KEYS) if item.get(key) not in (None, "")]
            if beside:
                self.errors.append(f"{path}.url: is beside {', '.join(beside)}, and has to answer with 2xx alone")
            return ValueCondition(url=item["url"])
        if not item.get("topic"):
            self.errors.append(f"{path}: has neither topic nor url")
            return ValueCondition()
        given = {key: item[key] for key in VALUE_KEYS if item.get(key) is not None}
        spans, bounds = [key for key in given if key in SPANS], [key for key in given if key not in SPANS]
        if len(spans) + bool(bounds) != 1 or ("equals" in bounds and len(bounds) > 1):
            allowed = f"above, below (or both), equals, {' or '.join(SPANS)}"
            there = ", ".join(given) or "nothing to look for"
            self.errors.append(f"{path}: has {there}; what a message must say is {allowed}")
        field = item.get("field") or ""
        if field and not _FIELD.match(field):
            told = "is not a field of a message, such as pose.position.x or status[0].level"
            self.errors.append(f"{path}.field: {field!r} {told}")
        if bounds and not field:
            self.errors.append(f"{path}.field: is missing; {' and '.join(bounds)} is said of one field")
        self.number(f"{path}.tolerance", item.get("tolerance"))
        for key in ("above", "below", *SPANS):
            if item.get(key) is not None and not math.isfinite(item[key]):
                self.errors.append(f"{path}.{key}: {item[key]} is not a finite number")
        for key in spans:
            if not given[key] > 0:
                self.errors.append(f"{path}.{key}: {given[key]} is not above 0 s")
            elif self.timeout is not None and given[key] > self.timeout:
                self.errors.append(f"{path}.{key}: {given[key]} s do not fit into the timeout of {self.timeout} s")
        given["tolerance"] = item.get("tolerance") or 0.0
        return ValueCondition(self.name(f"{path}.topic", item.get("topic")), field, **given)
