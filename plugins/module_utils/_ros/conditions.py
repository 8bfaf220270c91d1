# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""What the ROS graph must show: the options, their checks, and the conditions made of them.

Pure.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from typing import Any, Callable, Mapping

from .._common.errors import SpecError
from .names import resolve

# the options of ros_ready: how long to look, and what for
WAIT_ARGS: dict[str, dict[str, Any]] = {
    "timeout": {"type": "float", "default": 60.0},
    "interval": {"type": "float", "default": 0.5},
    "consecutive": {"type": "int", "default": 1},
    "stable": {"type": "float", "default": 0.0},
}
GATE_ARGS: dict[str, dict[str, Any]] = {
    "nodes": {"type": "list", "elements": "str", "default": []},
    "topics": {
        "type": "list",
        "elements": "dict",
        "default": [],
        "options": {
            "name": {"type": "str", "required": True},
            "type": {"type": "str"},
            "publishers": {"type": "int"},
            "subscribers": {"type": "int"},
            "connected": {"type": "bool", "default": False},
            "min_rate": {"type": "float"},
            "latched": {"type": "bool", "default": False},
            "publisher": {"type": "str"},
        },
    },
    "services": {
        "type": "list",
        "elements": "dict",
        "default": [],
        "options": {"name": {"type": "str", "required": True}},
    },
    "actions": {
        "type": "list",
        "elements": "dict",
        "default": [],
        "options": {
            "name": {"type": "str", "required": True},
            "state": {"type": "str", "choices": ["up", "idle"], "default": "up"},
        },
    },
    "edges": {
        "type": "list",
        "elements": "dict",
        "default": [],
        "options": {
            "publisher": {"type": "str", "required": True},
            "topic": {"type": "str", "required": True},
            "subscriber": {"type": "str", "required": True},
            "peer": {"type": "str", "choices": ["publisher", "subscriber"]},
        },
    },
    "absent": {"type": "list", "elements": "str", "default": []},
    "namespace": {"type": "str", "default": "/"},
}

# what messages must say, for whoever waits for that
VALUE_ARGS: dict[str, dict[str, Any]] = {
    "values": {
        "type": "list",
        "elements": "dict",
        "default": [],
        "options": {
            "topic": {"type": "str", "required": True},
            "field": {"type": "str", "default": ""},
            "above": {"type": "float"},
            "below": {"type": "float"},
            "equals": {"type": "raw"},
            "quiet": {"type": "float"},
            "still": {"type": "float"},
            "tolerance": {"type": "float", "default": 0.0},
        },
    },
}
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

_NAME = re.compile(r"^(/\w+|[A-Za-z_]\w*)(/\w+)*\Z", re.ASCII)
_TYPE = re.compile(r"^[A-Za-z]\w*/[A-Za-z]\w*\Z", re.ASCII)
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
    """What a topic's messages must say: a field `above`, `below` or `equals` something in the last one; or for seconds
    that nothing came but zeros (`quiet`), or that something came, and nothing but zeros (`still`).

    Zeros are numbers up to `tolerance`, of the field or without one of the whole message but its header.
    """

    topic: str
    field: str = ""
    above: float | None = None
    below: float | None = None
    equals: Any = None
    quiet: float | None = None
    still: float | None = None
    tolerance: float = 0.0

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
        return " ".join(filter(None, (self.topic, self.field, *seconds, self.bounds)))


@dataclass(frozen=True)
class Conditions:
    nodes: tuple[str, ...] = ()
    topics: tuple[TopicCondition, ...] = ()
    services: tuple[str, ...] = ()
    actions: tuple[ActionCondition, ...] = ()
    absent: tuple[str, ...] = ()
    edges: tuple[EdgeCondition, ...] = ()
    values: tuple[ValueCondition, ...] = ()


def conditions_from(params: Mapping[str, Any]) -> Conditions:
    """Module options (or a probe's JSON) -> conditions. Every bad value is named in one error."""
    errors: list[str] = []
    namespace = params.get("namespace") or "/"
    if not (namespace == "/" or _NAME.match(namespace.rstrip("/"))):
        errors.append(f"namespace: {namespace!r} is not a ROS name")

    for option, (least, unit) in _LEAST.items():
        value = params.get(option)
        if value is not None and not (math.isfinite(value) and value >= least):
            errors.append(f"{option}: {value} is not at least {least:g}{unit}")

    stable, timeout = params.get("stable"), params.get("timeout")
    if stable and timeout is not None and math.isfinite(stable) and stable > timeout >= 0:
        errors.append(f"stable: {stable} s do not fit into the timeout of {timeout} s")

    def named(path: str, name: Any) -> str:
        if not isinstance(name, str) or not _NAME.match(name):
            hint = "; write a private name out as /node/name" if str(name).startswith("~") else ""
            errors.append(f"{path}: {name!r} is not a ROS name (letters, digits and _ between slashes{hint})")
            return ""
        return resolve(name, namespace)

    def names(option: str) -> tuple[str, ...]:
        return tuple(named(f"{option}[{i}]", name) for i, name in enumerate(params.get(option) or ()))

    topics = []
    for i, item in enumerate(params.get("topics") or ()):
        path = f"topics[{i}]"
        if item.get("type") and not _TYPE.match(item["type"]):
            errors.append(f"{path}.type: {item['type']!r} is not a message type (package/Type)")
        for key in ("publishers", "subscribers", "min_rate"):
            if item.get(key) is not None and not (math.isfinite(item[key]) and item[key] >= 0):
                errors.append(f"{path}.{key}: {item[key]} is not at least 0")
        topics.append(
            TopicCondition(
                named(f"{path}.name", item.get("name")),
                item.get("type") or None,
                item.get("publishers"),
                item.get("subscribers"),
                bool(item.get("connected")),
                item.get("min_rate") or None,
                named(f"{path}.publisher", item["publisher"]) if item.get("publisher") else None,
                bool(item.get("latched")),
            )
        )
    services = [named(f"services[{i}].name", s.get("name")) for i, s in enumerate(params.get("services") or ())]
    actions = []
    for i, item in enumerate(params.get("actions") or ()):
        state = item.get("state") or "up"
        if state not in ("up", "idle"):
            errors.append(f"actions[{i}].state: {state!r} is neither up nor idle")
        server = named(f"actions[{i}].server", item["server"]) if item.get("server") else ""
        actions.append(ActionCondition(named(f"actions[{i}].name", item.get("name")), state, server))
    edges = [_edge(f"edges[{i}]", item, named, errors) for i, item in enumerate(params.get("edges") or ())]
    values = [_value(f"values[{i}]", item, timeout, named, errors) for i, item in enumerate(params.get("values") or ())]
    found = Conditions(
        names("nodes"), tuple(topics), tuple(services), tuple(actions), names("absent"), tuple(edges), tuple(values)
    )  # fmt: skip
    for name in sorted(set(found.nodes) & set(found.absent) - {""}):
        errors.append(f"absent: {name} is in nodes, too")
    if errors:
        raise SpecError("; ".join(errors), errors=errors)
    return found


def _edge(path: str, item: Mapping[str, Any], named: Callable[[str, Any], str], errors: list[str]) -> EdgeCondition:
    peer = item.get("peer") or ""
    if peer not in ("", "publisher", "subscriber"):
        errors.append(f"{path}.peer: {peer!r} is neither publisher nor subscriber")
    names = {key: named(f"{path}.{key}", item.get(key)) for key in ("publisher", "topic", "subscriber")}
    return EdgeCondition(**names, peer=peer)


def _value(
    path: str, item: Mapping[str, Any], timeout: float | None, named: Callable[[str, Any], str], errors: list[str]
) -> ValueCondition:
    given = {key: item[key] for key in VALUE_KEYS if item.get(key) is not None}
    spans, bounds = [key for key in given if key in SPANS], [key for key in given if key not in SPANS]
    if len(spans) + bool(bounds) != 1 or ("equals" in bounds and len(bounds) > 1):
        allowed = f"above, below (or both), equals, {' or '.join(SPANS)}"
        errors.append(f"{path}: has {', '.join(given) or 'nothing to look for'}; what a message must say is {allowed}")
    field = item.get("field") or ""
    if field and not _FIELD.match(field):
        errors.append(
            f"{path}.field: {field!r} is not a field of a message, such as pose.position.x or status[0].level"
        )
    if bounds and not field:
        errors.append(f"{path}.field: is missing; {' and '.join(bounds)} is said of one field")
    for key in ("above", "below", "tolerance", *SPANS):
        if item.get(key) is not None and not math.isfinite(item[key]):
            errors.append(f"{path}.{key}: {item[key]} is not a finite number")
    for key in spans:
        if not given[key] > 0:
            errors.append(f"{path}.{key}: {given[key]} is not above 0 s")
        elif timeout is not None and given[key] > timeout:
            errors.append(f"{path}.{key}: {given[key]} s do not fit into the timeout of {timeout} s")
    tolerance = item.get("tolerance") or 0.0
    if tolerance < 0:
        errors.append(f"{path}.tolerance: {tolerance} is not at least 0")
    return ValueCondition(named(f"{path}.topic", item.get("topic")), field, **given, tolerance=tolerance)
