# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Hear the messages of topics without being registered, from look to look; `heard` says what they mean."""

from __future__ import annotations

import threading
import time
from functools import partial
from typing import Any, Callable, Mapping, Sequence, Tuple

from .._common.documents import Data
from .._common.errors import RosError
from .checks import Check
from .conditions import ValueCondition
from .graph import Graph, names_of
from .heard import Heard, check_value
from .master import Master
from .messages import Definition
from .rpc import in_parallel, reason
from .streams import TopicStream

TICK = 0.01
Source = Tuple[str, str, Any]  # topic, publisher, and its address or why it has none


class Listener:
    """The streams of what some conditions are about. They stay open until their process ends."""

    def __init__(
        self, ros: Master, conditions: Sequence[ValueCondition], now: Callable[[], float] = time.monotonic
    ) -> None:
        self._ros, self._now = ros, now
        self._heard = [Heard(condition, now()) for condition in conditions]
        self._streams: dict[Source, TopicStream] = {}
        self._definitions: dict[tuple[str, str], Definition] = {}
        self._lock = threading.Lock()

    def checks(self, graph: Graph) -> list[Check]:
        """One check per condition. A value that is asked for is given a moment to come."""
        sources = self._sources(graph)
        for key, stream in list(self._streams.items()):  # to which one that answers late may still be added
            if key not in sources or not stream.open:
                self._leave(key)
        unheard = self._connect({key for key in sources if key not in self._streams})
        for one in self._heard:
            one.unheard = {key[1]: why for key, why in unheard.items() if key[0] == one.condition.topic}
        self._await_values()
        with self._lock:
            return [check_value(graph, one, self._now()) for one in self._heard]

    # ---- streams

    def _sources(self, graph: Graph) -> set[Source]:
        topics = {one.condition.topic for one in self._heard}
        pairs = [(topic, publisher) for topic in topics for publisher in names_of(graph.topic(topic).publishers)]
        uris = self._ros.look_up({publisher: None for _topic, publisher in sorted(pairs)})[0]
        return {(topic, publisher, uris[publisher]) for topic, publisher in pairs}

    def _connect(self, sources: set[Source]) -> dict[Source, str]:
        """Open what is not open; who cannot be heard, and why. Where nothing listens any more nobody speaks."""

        def failed(key: Source, error: BaseException) -> str:
            return "" if isinstance(error, ConnectionRefusedError) else reason(error, str(key[2]), self._ros.timeout)

        tasks = {key: partial(self._open, key) for key in sources}
        return {key: why for key, why in in_parallel(tasks, self._ros.timeout, failed).items() if why}

    def _open(self, key: Source) -> str:
        topic, _publisher, uri = key
        if isinstance(uri, RosError):
            raise uri

        def receive(body: bytes) -> None:
            self._took(topic, stream.header, body)

        stream = TopicStream(self._ros.caller, topic, uri, receive)
        stream.connect(self._ros.timeout)
        self._streams[key] = stream
        return ""

    def _leave(self, key: Source) -> None:
        self._streams.pop(key).close()
        with self._lock:
            for one in self._heard:
                if one.condition.topic == key[0]:
                    one.forget()

    # ---- messages

    def _took(self, topic: str, header: Mapping[str, str], body: bytes) -> None:
        now, wrong = self._now(), ""
        message: Data = {}
        try:
            message = self._definition(header).decode(body)
        except RosError as error:
            wrong = str(error)
        with self._lock:
            for one in self._heard:
                if one.condition.topic == topic:
                    one.take(message, now, wrong)

    def _definition(self, header: Mapping[str, str]) -> Definition:
        key = (header.get("type", ""), header.get("message_definition", ""))
        if key not in self._definitions:
            self._definitions[key] = Definition(*key)
        return self._definitions[key]

    def _await_values(self) -> None:
        """A look that has just begun to listen has heard nothing."""
        spoken = {topic for topic, _publisher, _uri in list(self._streams)}
        asked = [one for one in self._heard if one.condition.bounds and one.condition.topic in spoken]
        end = time.monotonic() + self._ros.timeout
        while any(one.came is None for one in asked) and time.monotonic() < end:
            time.sleep(TICK)
