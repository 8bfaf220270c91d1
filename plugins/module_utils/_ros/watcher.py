# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Listen to what others listen to, unregistered, while nodes come and go; `traffic` says what that means."""

from __future__ import annotations

import struct
import threading
import time
from functools import partial
from typing import Callable, Tuple

from .._common.documents import Data
from .._common.errors import RosError
from .client import Ros1Client
from .graph import Questions
from .messages import Definition
from .rpc import in_parallel
from .streams import TopicStream
from .traffic import Stream, Traffic, has_number

Source = Tuple[str, str, str]  # topic, publisher, and its address


class Watcher:
    """The streams of all topics that somebody listens to. They stay open until their publisher goes."""

    def __init__(self, ros: Ros1Client, now: Callable[[], float] = time.monotonic) -> None:
        self.traffic = Traffic()
        self._ros, self._now = ros, now
        self._streams: dict[Source, TopicStream] = {}
        self._lock = threading.Lock()

    def look(self) -> None:
        """See who is connected, and listen to whoever is new. Who does not answer is asked again by the next look."""
        state = self._ros.state()
        graph = self._ros.ask(state, Questions({name: frozenset({"bus"}) for name in state.nodes()}, (), ()))
        with self._lock:
            self.traffic.look(graph)
            topics = [graph.topic(name) for name in self.traffic.topics]
        sources = {
            (topic.name, key.name, uri) for topic in topics for key in topic.publishers if (uri := graph.at(key).uri)
        }
        for key, stream in list(self._streams.items()):
            if key not in sources or not stream.open:
                self._streams.pop(key).close()
        tasks = {key: partial(self._open, key) for key in sources if key not in self._streams}
        in_parallel(tasks, self._ros.timeout, lambda _key, _error: None)

    def _open(self, key: Source) -> None:
        topic, _publisher, uri = key
        counted = Stream()
        number: Callable[[bytes], int | None] | None = None

        def receive(body: bytes) -> None:
            nonlocal number
            if number is None:
                number = _number if _is_numbered(stream.header) else _no_number
            with self._lock:
                self.traffic.topics[topic].take(counted, self._now(), number(body))

        stream = TopicStream(self._ros.caller, topic, uri, receive)
        with self._lock:
            self.traffic.topics[topic].streams.append(counted)
        stream.connect(self._ros.timeout)
        self._streams[key] = stream

    def result(self, may_pause: list[str]) -> Data:
        """What there was, and what of it was lost."""
        with self._lock:
            traffic = self.traffic
            return {
                "looks": traffic.looks,
                "topics": traffic.as_dict(),
                "problems": traffic.problems(may_pause),
            }


def _is_numbered(header: dict[str, str]) -> bool:
    try:
        return has_number(Definition(header.get("type", ""), header.get("message_definition", "")))
    except RosError:
        return False  # what cannot be read is counted


def _number(body: bytes) -> int | None:
    return int(struct.unpack_from("<I", body)[0]) if len(body) >= 4 else None


def _no_number(_body: bytes) -> None:
    return None
