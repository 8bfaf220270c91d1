# SPDX-License-Identifier: GPL-3.0-or-later
"""What came of some topics over a time in which their nodes may have been replaced, and what of it was lost.

Two things are seen from the outside, of any app. A message whose type begins with a Header has a number, which the
client libraries count up for each publisher: of one publisher none may be missing. And every app that listened has to
be connected in every look, by the publishers' word, be it by the old or by the new one's node.

It is an account of its own, for tests. It costs a robot's CPU what one more subscriber of each topic costs.
"""

from __future__ import annotations

import struct
import threading
import time
from dataclasses import dataclass, field
from pathlib import Path
from typing import Iterable, Mapping

from .._common.documents import Arguments, Data, Document
from .._common.errors import FleetError, RosError
from . import graph as ros
from .backend import Questions
from .client import Ros1Client
from .graph import Graph
from .messages import HEADER, Definition
from .names import is_keeper, stem
from .streams import Source, Streams

LOGS = ("/rosout", "/rosout_agg")
NUMBERS = 1 << 32
PAUSE = 0.2  # seconds between two looks


def has_number(header: Mapping[str, str]) -> bool:
    """By its publisher's header the message begins with a Header, and that with its number.

    One that latches says nothing with it: rospy counts what it gives to each that comes later, too.
    """
    if header.get("latching") == "1":
        return False
    try:
        definition = Definition(header.get("type", ""), header.get("message_definition", ""))
    except (RosError, RecursionError):
        return False  # what cannot be read is counted
    fields = definition.types[definition.name]
    return bool(fields) and fields[0].kind == HEADER and not fields[0].is_list


def _listening(topic: ros.Topic) -> set[str]:
    """Apps that are connected. Who only looks, such as an update's gate or this account itself, is not registered."""
    peers = (peer for _publisher, peer in topic.connections if peer in topic.subscribers)
    return {stem(peer.name) for peer in peers if not is_keeper(peer.name)}


@dataclass
class Topic:
    """A topic since somebody watches it."""

    numbered: bool = False
    publishers: int = 0  # connections that were opened to one
    messages: int = 0
    missing: int = 0
    last: float | None = None
    gap: float = 0.0
    unconnected: dict[str, int] = field(default_factory=dict)  # app that listens -> looks without a connection

    def take(self, at: float, number: int | None = None, before: int | None = None) -> None:
        """A message came, with its number and the one before on its connection, where they have any.

        A publisher that sets its numbers itself may repeat one, or go back: then nothing is known.
        """
        self.messages += 1
        if number is not None:
            self.numbered = True
            step = (number - before) % NUMBERS if before is not None else 0
            self.missing += step - 1 if 0 < step < NUMBERS // 2 else 0
        if self.last is not None:
            self.gap = max(self.gap, at - self.last)
        self.last = at


@dataclass
class Traffic:
    """Of the topics that somebody listens to."""

    topics: dict[str, Topic] = field(default_factory=dict)
    looks: int = 0

    def look(self, graph: Graph) -> None:
        """Who listens now, and whether it is connected."""
        self.looks += 1
        for name, topic in graph.topics.items():
            if _listening(topic) and name not in LOGS:
                self.topics.setdefault(name, Topic())
        for name, known in self.topics.items():
            now = graph.topic(name)
            connected, publishers = _listening(now), map(graph.at, now.publishers)
            untold = any(one.connections is None and not one.gone for one in publishers)  # busy, so nobody knows
            for app in {*known.unconnected, *connected}:
                missed = app not in connected and not untold
                known.unconnected[app] = known.unconnected.get(app, 0) + missed

    def problems(self, may_pause: Iterable[str]) -> list[str]:
        """What was lost, a line each, but for topics that may pause."""
        found = [] if any(topic.messages for topic in self.topics.values()) else ["no message was seen on any topic"]
        for name, topic in sorted(self.topics.items()):
            if name in may_pause:
                continue
            if topic.missing:
                found.append(f"{name}: {topic.missing} of {topic.messages + topic.missing} messages are missing")
            for app, looks in sorted(topic.unconnected.items()):
                if looks:
                    found.append(f"{name}: {app} was not connected in {looks} of {self.looks} looks")
        return found

    def as_dict(self) -> dict[str, Document]:
        return {
            name: {
                "messages": topic.messages,
                "publishers": topic.publishers,
                "numbered": topic.numbered,
                "missing": topic.missing if topic.numbered else None,
                "longest_gap": round(topic.gap, 3),
                "unconnected_looks": topic.unconnected,
            }
            for name, topic in sorted(self.topics.items())
        }


class Watcher:
    """Listens, unregistered, to all topics that somebody listens to, while nodes come and go."""

    def __init__(self, ros: Ros1Client) -> None:
        self.traffic = Traffic()
        self._ros = ros
        self._streams = Streams(ros.caller, ros.timeout, self._took, self._left)
        self._counted: dict[Source, tuple[bool, int | None]] = {}  # whether messages are numbered, and the last number
        self._lock = threading.Lock()

    def look(self) -> None:
        """See who is connected, and listen to whoever is new. Who does not answer is asked again by the next look."""
        state = self._ros.state()
        graph = self._ros.ask(state, Questions(dict.fromkeys(state.nodes(), frozenset({"bus"}))))
        with self._lock:
            self.traffic.look(graph)
            topics = [graph.topic(name) for name in self.traffic.topics]
        ends = [(topic.name, key) for topic in topics for key in topic.publishers]
        self._streams.keep({(topic, key.name, uri) for topic, key in ends if (uri := graph.at(key).uri)})

    def _took(self, source: Source, header: Mapping[str, str], body: bytes) -> None:
        with self._lock:
            topic = self.traffic.topics[source[0]]
            topic.publishers += source not in self._counted
            numbered, before = self._counted.get(source) or (has_number(header), None)
            number = struct.unpack_from("<I", body)[0] if numbered and len(body) >= 4 else None
            topic.take(time.monotonic(), number, before)
            self._counted[source] = numbered, number

    def _left(self, source: Source) -> None:
        """The next connection to it counts by itself."""
        with self._lock:
            self._counted.pop(source, None)

    def result(self, may_pause: Iterable[str]) -> Data:
        """`topics`: what came, by topic; `problems`: what of it was lost, but for topics that may pause; `looks`."""
        with self._lock:
            problems = self.traffic.problems(may_pause)
            return {"looks": self.traffic.looks, "topics": self.traffic.as_dict(), "problems": problems}


def watch(arguments: Arguments) -> Data:
    """Listen until the `end_file` is there, and look once more: `Watcher.result`. FleetError after so many `seconds`.

    A master that is replaced does not answer for a while; only that the last look failed is a problem.
    """
    watcher, seconds = Watcher(Ros1Client(arguments["master_uri"])), arguments["seconds"]
    end = Path(arguments["end_file"])
    deadline = time.monotonic() + seconds
    while True:
        last, failed = end.exists(), []
        try:
            watcher.look()
        except RosError as error:
            failed = [f"the last look failed: {error}"]
        if last:
            found = watcher.result(arguments["may_pause"])
            return {"changed": False, **found, "problems": [*found["problems"], *failed]}
        if time.monotonic() > deadline:
            raise FleetError(f"{end} is not there after {seconds} s")
        time.sleep(PAUSE)
