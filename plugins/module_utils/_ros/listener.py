# SPDX-License-Identifier: GPL-3.0-or-later
"""Hear the messages of topics without being registered, from look to look; `messages` says what they mean.

And ask the HTTP servers that conditions name.
"""

from __future__ import annotations

import http.client
import threading
import time
from functools import lru_cache, partial
from typing import Mapping, Sequence
from urllib.parse import urlsplit

from .._common.documents import Data
from .._common.errors import RosError, printable
from .._common.poll import PASS, WAIT
from .checks import Check
from .conditions import ValueCondition
from .graph import Graph, names_of
from .messages import Definition, Heard, check_value
from .rpc import Master, in_parallel
from .streams import Source, Streams

TICK = 0.01
SAID = 200  # bytes of an answer that are told
LATE = 1.0  # seconds that a first look may take to connect and count as listening: it may end as soon as it was quiet


class Listener:
    """The streams of what some conditions are about. They stay open until they are closed, or their process ends."""

    def __init__(self, ros: Master, conditions: Sequence[ValueCondition]) -> None:
        self._ros = ros
        self._heard = [Heard(condition, time.monotonic()) for condition in conditions if not condition.url]
        self._urls = [condition.url for condition in conditions if condition.url]
        self._streams = Streams(ros.caller, ros.timeout, self._took, self._left)
        self._definition = lru_cache(maxsize=None)(Definition)
        self._lock = threading.Lock()
        self._looked = False

    def checks(self, graph: Graph) -> list[Check]:
        """One check per condition. A value that is asked for is given a moment to come."""
        topics = {one.condition.topic for one in self._heard}
        pairs = [(topic, publisher) for topic in topics for publisher in names_of(graph.topic(topic).publishers)]
        uris = self._ros.look_up({publisher: None for _topic, publisher in sorted(pairs)})[0]
        unheard = self._streams.keep({(topic, publisher, uris[publisher]) for topic, publisher in pairs})
        for one in self._heard:
            before, topic = one.unheard, one.condition.topic
            one.unheard = {key[1]: why for key, why in unheard.items() if key[0] == topic}
            if before:  # what was said until now nobody knows
                one.since, one.stirred = time.monotonic(), None
            elif not self._looked:
                one.since = max(one.since, time.monotonic() - LATE)
        self._looked = True
        self._await_values()
        with self._lock:
            found = [check_value(graph, one, time.monotonic()) for one in self._heard]
        return [*found, *self._answers()]

    def _answers(self) -> list[Check]:
        seconds = self._ros.timeout
        asked = in_parallel(
            {url: partial(answer, url, seconds) for url in self._urls},
            seconds,
            lambda url, error: Check("value", url, WAIT, f"it cannot be asked: {error or type(error).__name__}"),
        )
        return [asked[url] for url in self._urls]

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
        except (RosError, RecursionError) as error:  # within each other without end
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


def answer(url: str, seconds: float) -> Check:
    """Whether the server at this URL answers GET with 2xx; OSError or HTTPException where nobody does."""
    parts = urlsplit(url)
    kind = http.client.HTTPSConnection if parts.scheme == "https" else http.client.HTTPConnection
    connection = kind(parts.netloc, timeout=seconds)
    try:
        connection.request("GET", f"{parts.path or '/'}{'?' + parts.query if parts.query else ''}")
        reply = connection.getresponse()
        said = printable(reply.read1(SAID).decode("utf-8", "replace")).strip().partition("\n")[0]
    finally:
        connection.close()
    verdict = PASS if 200 <= reply.status < 300 else WAIT
    return Check("value", url, verdict, f"answers {reply.status}{': ' + said if said else ''}")
