# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""When an app is ready, and what messages must say: keys of an app, as in app.py."""

# no `from __future__ import annotations`: a lambda in an annotation that is a text would not find this module's names
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, Any, Literal, Required, TypedDict

from ...module_utils._common.documents import Variables
from .formats import FILLED, FORMS, number, whole
from .keys import either

GraphName = Annotated[str, FORMS["graph-name"]]
Filled = Annotated[str, FILLED]
Positive = Annotated[float, number(0, above=True)]
NotNegative = Annotated[float, number(0)]
Count = Annotated[int, whole(0)]
Scalar = str | float | bool
NAMED = "a ROS name or a mapping with the key name"


class Condition(TypedDict, total=False):
    """What messages must say. Its keys are documented with the module ros_ready, and what else of them has to be true
    is judged by its code (_validate/when.py)."""

    topic: Required[GraphName]
    field: Filled
    equals: Scalar
    above: float
    below: float
    quiet: Positive
    still: Positive
    tolerance: NotNegative


When = tuple[Condition, ...]


def _named(item: Any) -> Variables:
    return item if isinstance(item, Mapping) else {"name": item}


def _action(item: Any) -> Variables:
    return {"state": "up", **_named(item)}


class ReadyTopic(TypedDict, total=False):
    """What the graph has to show of a topic: options of the module ros_ready."""

    name: Required[GraphName]
    """The topic; a relative name is resolved in the app's ROS namespace."""
    type: Annotated[str, FORMS["ros-type"]]
    """Its message type."""
    publishers: Count
    """At least so many publishers."""
    subscribers: Count
    """At least so many subscribers."""
    connected: bool
    """Every subscriber is connected, seen from the publishers."""
    min_rate: Positive
    """At least so many messages per second."""


class ReadyService(TypedDict, total=False):
    """A service that has to answer."""

    name: Required[GraphName]


class ReadyAction(TypedDict, total=False):
    """An action server that has to be there."""

    name: Required[GraphName]
    state: Literal["up", "idle"]


@dataclass(frozen=True)
class Readiness:
    """When an app is ready."""

    command: Annotated[
        str | tuple[str, ...] | None,
        either("a command as text, or as a list of texts", Filled, Annotated[tuple[str, ...], FILLED]),
        lambda said: tuple(said) if isinstance(said, list) else said,
    ] = None
    """What the container has to say to being ready, with exit status 0; a path, a shell command or a list."""
    nodes: bool = True
    """Whether the app's own ROS node has to be up."""
    topics: tuple[ReadyTopic, ...] = ()
    """Topics that the graph has to show."""
    services: tuple[Annotated[ReadyService, either(NAMED, GraphName, ReadyService), _named], ...] = ()
    """Services that have to answer a probe, as names or as mappings with the key C(name)."""
    actions: tuple[Annotated[ReadyAction, either(NAMED, GraphName, ReadyAction), _action], ...] = ()
    """Action servers, as names or as mappings with the keys C(name) and C(state) (C(up) or C(idle))."""
    absent: tuple[GraphName, ...] = ()
    """ROS nodes that have to be gone."""
    timeout: Positive = 60.0
    """Seconds until all of it has to be true."""
    interval: Positive = 0.5
    """Seconds between two looks at the graph."""
    consecutive: Annotated[int, whole(1, 1000)] = 1
    """How often in a row it has to be true."""


USUAL = Readiness()
