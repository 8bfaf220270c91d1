# SPDX-License-Identifier: GPL-3.0-or-later
"""Hear the messages of topics without being registered, from look to look; `messages` says what they mean."""

from __future__ import annotations

import threading
import time
from functools import lru_cache
from typing import Mapping, Sequence

from .._common.documents import Data
from .._common.errors import RosError
from .checks import Check
from .conditions import ValueCondition
from .graph import Graph, names_of
from .messages import Definition, Heard, check_value
from .rpc import Master
from .streams import Source, Streams

TICK = 0.01


class Listener:
    """The streams of what some conditions are about. They stay open until they are closed, or their process ends."""

    def __init__(self, ros: Master, conditions: Sequence[ValueCondition]) -> None:
        self._ros = ros
        self._heard = [Heard(condition, time.monotonic()) for condition in conditions]
        self._streams = Streams(ros.caller, ros.timeout, self._took, self._left)
        self._definition = lru_cache(maxsize=None)(Definition)
        self._lock = threading.Lock()

    def checks(self, graph: Graph) -> list[Check]:
        """One check per condition. A value that is asked for is given a moment to come."""
        topics = {one.condition.topic for one in self._heard}
        pairs = [(topic, publisher) for topic in topics for publisher in names_of(graph.topic(topic).publishers)]
        uris = self._ros.look_up({publisher: None for _topic, publisher in sorted(pairs)})[0]
        unheard = self._streams.keep({(topic, publisher, uris[publisher]) for topic, publisher in pairs})
        for one in self._heard:
            one.unheard = {key[1]: why for key, why in unheard.items() if key[0] == one.condition.topic}
        self._await_values()
        with self._lock:
            return [check_value(graph, one, time.monotonic()) for one in self._heard]

    def close(self) -> None:
        self._streams.keep(())

    def _left(self, source: Source) -> None:
        with self._lock:
            for one in self._heard:
                if one.condition.topic == source[0]:
                    one.forget()

    def _took(self, source: Source, header: Mapping[str, str], body: bytes) -> None:
        now, wrong = time.monotonic(), ""
        message: Data = {}
        try:
            definition = self._definition(header.get("type", ""), header.get("message_definition", ""))
            message = definition.decode(body)
        except RosError as error:
            wrong = str(error)
        with self._lock:
            for one in self._heard:
                if one.condition.topic == source[0]:
                    one.take(message, now, wrong)

    def _await_values(self) -> None:
        """A look that has just begun to listen has heard nothing."""
        spoken = {topic for topic, _publisher, _uri in list(self._streams.open)}
        asked = [one for one in self._heard if one.condition.bounds and one.condition.topic in spoken]
        end = time.monotonic() + self._ros.timeout
        while any(one.came is None for one in asked) and time.monotonic() < end:
            time.sleep(TICK)
