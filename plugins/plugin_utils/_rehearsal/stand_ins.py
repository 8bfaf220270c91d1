# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""A recording -> what the stand-in of each of its apps plays (`_pod/stand_in.py`). Pure."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass, replace
from typing import Any

from ansible_collections.rosops.fleet.plugins.module_utils._common.errors import RosError
from ansible_collections.rosops.fleet.plugins.module_utils._ros.layout import Place, counter, smallest
from ansible_collections.rosops.fleet.plugins.module_utils._ros.messages import Definition
from ansible_collections.rosops.fleet.plugins.module_utils._ros.recording import Recording, Service, Topic

# What begins work in a server: a goal of zeros would be one, and nobody asked for it.
COMMANDS = ("goal", "cancel")
STATUS_HZ = 5.0  # of an action's server, whoever listens


@dataclass(frozen=True)
class Published:
    """`size`: bytes of a message. `rate`: messages per second; 0 sends none, or, where it is latched, one."""

    name: str
    type: str
    md5sum: str
    definition: str
    latched: bool
    rate: float
    size: int
    place: Place | None


@dataclass(frozen=True)
class Subscribed:
    name: str
    type: str
    md5sum: str
    place: Place | None


@dataclass(frozen=True)
class Served:
    name: str
    type: str
    md5sum: str


@dataclass(frozen=True)
class Node:
    """`asks`: services of others that it greets all the time."""

    name: str
    publishes: tuple[Published, ...] = ()
    subscribes: tuple[Subscribed, ...] = ()
    services: tuple[Served, ...] = ()
    asks: tuple[str, ...] = ()


@dataclass(frozen=True)
class Plan:
    """What one stand-in plays."""

    nodes: tuple[Node, ...]

    def as_dict(self) -> dict[str, Any]:
        return asdict(self)


def plan(recording: Recording, nodes: Iterable[str], asks: Iterable[str] = ()) -> Plan:
    """The part of these nodes; the first one greets the services `asks`."""
    commands = {f"{action}/{word}": 0.0 for action in recording.actions for word in COMMANDS}
    rates = {**commands, **{f"{action}/status": STATUS_HZ for action in recording.actions}}
    first, *others = [_node(recording, name, rates) for name in nodes]
    return Plan((replace(first, asks=tuple(asks)), *others))


def _node(recording: Recording, node: str, rates: Mapping[str, float]) -> Node:
    topics = recording.topics.items()
    return Node(
        node,
        tuple(_published(name, topic, node, rates.get(name)) for name, topic in topics if node in topic.publishers),
        tuple(_subscribed(name, topic) for name, topic in topics if node in topic.subscribers),
        tuple(_served(name, one) for name, one in recording.services.items() if one.provider == node),
    )


def _published(name: str, topic: Topic, node: str, fixed: float | None) -> Published:
    sent, (size, place) = topic.publishers[node], _layout(topic)
    rate = (sent.rate or 0.0) if fixed is None else fixed
    return Published(name, topic.type, topic.md5sum, topic.definition, sent.latched, rate, size, place)


def _subscribed(name: str, topic: Topic) -> Subscribed:
    return Subscribed(name, topic.type, topic.md5sum, _layout(topic)[1])


def _served(name: str, service: Service) -> Served:
    return Served(name, service.type, service.md5sum)


def _layout(topic: Topic) -> tuple[int, Place | None]:
    """Of a message of zeros, and where its number is; of a type that nobody has defined, no bytes."""
    try:
        definition = Definition(topic.type, topic.definition)
        return smallest(definition), counter(definition)
    except RosError:
        return 0, None
