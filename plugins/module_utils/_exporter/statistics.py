# SPDX-License-Identifier: GPL-3.0-or-later
"""Latency and drops out of the topic /statistics: only where it was asked for, as it has to be read all the time.

Subscribers publish it when /enable_statistics was true as they started. Its messages come over connections that are
not registered with the master.
"""

from __future__ import annotations

import contextlib
import threading
import time
from typing import Mapping, Tuple

from .._common.errors import RosError
from .._ros.streams import Source, Streams
from .._ros.tcpros import Reader
from .observer import CALLER, Observer

TOPIC, TYPE = "/statistics", "rosgraph_msgs/TopicStatistics"
Key = Tuple[str, str, str]  # topic, publisher, subscriber
PERIOD = 10.0  # between looks for new publishers
MAX_AGE = 60.0  # nodes publish ten times a second to once in ten seconds; after this, it is over


def decode(body: bytes) -> tuple[Key, float, int]:
    """(topic, publisher, subscriber), mean age in seconds and drops of one rosgraph_msgs/TopicStatistics.

    Layout: string topic, node_pub, node_sub; time window_start, window_stop; int32 delivered, dropped, traffic;
    duration period mean, stddev, max; duration stamp_age mean, stddev, max.
    """
    reader = Reader(body)
    key = (reader.text(), reader.text(), reader.text())
    reader.take(16 + 4)
    dropped = _signed(reader)
    reader.take(4 + 24)
    return key, _signed(reader) + _signed(reader) / 1e9, dropped


def _signed(reader: Reader) -> int:
    return int.from_bytes(reader.take(4), "little", signed=True)


class Statistics(threading.Thread):
    """Keeps a stream of every publisher of /statistics: drops summed up, and the latest age."""

    def __init__(self, uri: str, timeout: float) -> None:
        super().__init__(daemon=True, name="statistics")
        self.observer = Observer(uri, timeout)
        self.streams = Streams(CALLER, timeout, self.took)
        self.lock = threading.Lock()
        self.found: dict[Key, tuple[float, int, float]] = {}  # age, drops, and when that was

    def rows(self) -> list[tuple[Key, float, int]]:
        with self.lock:
            found, now = sorted(self.found.items()), time.monotonic()
        return [(key, age, lost) for key, (age, lost, at) in found if now - at < MAX_AGE]

    def run(self) -> None:
        while True:
            with contextlib.suppress(Exception):  # the poller counts what is wrong with the graph
                self.connect()
            time.sleep(PERIOD)

    def connect(self) -> None:
        """A stream of each publisher. One that hangs, or is gone, is tried again at the next look."""
        publishers = self.observer.graph().publishers.get(TOPIC, ())
        uris = self.observer.addresses(publishers)[0]
        self.streams.keep({(TOPIC, name, uri) for name, uri in uris.items()})

    def took(self, _source: Source, header: Mapping[str, str], body: bytes) -> None:
        if header.get("type", TYPE) != TYPE:
            return
        try:
            key, age, dropped = decode(body)
        except RosError:
            return
        with self.lock:
            before = self.found.get(key, (0.0, 0, 0.0))[1]
            self.found[key] = (age, before + max(0, dropped), time.monotonic())
