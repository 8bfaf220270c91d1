# SPDX-License-Identifier: GPL-3.0-or-later
"""Statistics of the topic `temperature`, one JSON line a second in LOG_DIR/temperature-stats.jsonl."""

from __future__ import annotations

import threading
import time
from pathlib import Path
from typing import Any

import rospy  # type: ignore[import-not-found]

from . import node, settings
from .jsonl import JsonLinesLog, last_record
from .metrics import Metrics
from .sequence import SequenceTracker, StreamGaps
from .stats import ENGINE, RunningStats

WINDOW = 500  # values in the moving average: one second of the sensor
LOG_NAME = "temperature-stats.jsonl"


class Account:
    """What came in. rospy calls from one thread per publisher, the log's loop reads from its own: hence the lock."""

    def __init__(self, previous: dict[str, Any] | None, metrics: Metrics) -> None:
        self._metrics = metrics
        self._lock = threading.Lock()
        self._resumed_from = previous["last_sequence"] if previous else None
        self._sequence = SequenceTracker(after=self._resumed_from)
        self._streams = StreamGaps()
        self._stats = RunningStats(WINDOW)
        self._received = 0
        self._arrived = 0.0
        self._gap = 0.0
        self._latency = 0.0
        self._missing = 0
        self._newest = -1
        self._ran_back = 0
        self._furthest_back = 0

    def take(self, message: Any) -> None:
        """One message: counted once, however often its sample comes."""
        stamp = message.header.stamp
        age = time.time() - stamp.secs - stamp.nsecs * 1e-9
        now = time.monotonic()
        connection = message._connection_header
        with self._lock:
            self._streams.add(connection["callerid"], connection, message.header.seq)
            if message.sequence < self._newest:
                self._ran_back += 1
                self._furthest_back = max(self._furthest_back, self._newest - message.sequence)
            self._newest = message.sequence
            if not self._sequence.add(message.sequence):
                return
            self._stats.add(message.celsius)
            self._received += 1
            if self._arrived and now - self._arrived > self._gap:
                self._gap = now - self._arrived
            self._arrived = now
            self._latency = max(self._latency, age)
        self._metrics.answered(max(0.0, age))

    def report(self) -> dict[str, Any] | None:
        """The figures so far. None before any.

        Gap, age, order, ranges and received are those since the last report. `ran_back` counts messages whose number is
        below that of the one before, as any subscriber sees them: what comes a second time is among them.
        """
        with self._lock:
            if self._sequence.last is None:
                return None
            missing = self._sequence.missing
            report = {
                "received": self._received,
                **self._stats.report(),
                "resumed_from": self._resumed_from,
                "first_sequence": self._sequence.first,
                "last_sequence": self._sequence.last,
                "missing": missing,
                "duplicates": self._sequence.duplicates,
                "stream_gaps": self._streams.dropped,
                "ranges": self._sequence.take_ranges(),
                "longest_gap_ms": round(self._gap * 1e3, 3),
                "oldest_age_ms": round(self._latency * 1e3, 3),
                "ran_back": self._ran_back,
                "furthest_back": self._furthest_back,
            }
            self._received = self._ran_back = self._furthest_back = 0
            self._gap = self._latency = 0.0
            # missing at the last report, too: a hole that the other of two publishers fills a moment later is none
            self._metrics.failed_so_far(min(self._missing, missing))
            self._missing = missing
        return report


def read_settings() -> tuple[Path, int]:
    """Where the log goes, and the length of the queue."""
    return settings.required_log_dir(), settings.queue_size()


def subscribe(directory: Path, queue_size: int) -> None:
    """Count until asked to stop."""
    from .msg import Temperature  # type: ignore[import-not-found] # noqa: PLC0415 - made when the image is built

    previous = last_record(directory / LOG_NAME, key="last_sequence")
    log = JsonLinesLog(directory / LOG_NAME)
    account = Account(previous, node.measured("pubsub", "temperature"))
    subscriber = rospy.Subscriber("temperature", Temperature, account.take, queue_size=queue_size, tcp_nodelay=True)
    node.ready()
    due = time.monotonic() + 1.0
    while not node.stopping():
        time.sleep(max(0.0, min(0.5, due - time.monotonic())))
        if time.monotonic() >= due:
            due += 1.0
            record(account, log)
    subscriber.unregister()
    record(account, log, idle=False)
    log.close()


def record(account: Account, log: JsonLinesLog, *, idle: bool = True) -> None:
    """One line of the log; with `idle` also when nothing came since the last one."""
    report = account.report()
    if report is not None and (idle or report["received"]):
        who = {"time": round(time.time(), 3), "node": rospy.get_name(), "version": settings.version()}
        log.write({**who, "statistics": ENGINE, **report})


def main() -> None:
    node.run("temperature_subscriber", read_settings, subscribe)
