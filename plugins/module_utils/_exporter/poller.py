# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""The exporter's looks at the graph, in a thread of their own: a scrape takes the last snapshot and never waits."""

from __future__ import annotations

import threading
import time
from typing import Callable

from . import snapshot
from .observer import Observer
from .snapshot import GraphMetrics, History, Snapshot
from .updates import Updates

# Both in parts of the interval. A scrape that comes as a poll ends gets sometimes the new counts and sometimes the old
# ones, and a rate over some minutes jumps. So polls keep away from scrapes, which come at the same interval.
NEAR, SHIFT = 0.15, 0.3
STUCK = 600.0  # without a poll for so long, something is wrong with the exporter itself


def too_near(last: float, due: float, at: float, interval: float) -> bool:
    """Whether a scrape `at` is so near to a poll, the one that ended `last` or the one `due`, that they may meet."""
    return at - last < NEAR * interval or due - at < NEAR * interval


class Poller(threading.Thread):
    """Polls at its interval; `snapshot` is the last one, whole."""

    def __init__(self, observer: Observer, interval: float, updates: Updates, tell: Callable[[str], None]) -> None:
        super().__init__(daemon=True, name="poller")
        self.observer, self.interval, self.updates, self.tell = observer, interval, updates, tell
        self.memory = History()
        self.snapshot = Snapshot(errors=dict(self.memory.errors))
        self.last = self.due = time.monotonic()
        self.shifted = False
        self.wake = threading.Condition()

    def run(self) -> None:
        while True:
            self.poll()
            with self.wake:
                now = time.monotonic()
                self.last = now
                self.due = max(self.due + self.interval, now)
                while True:
                    left = self.due + (SHIFT * self.interval if self.shifted else 0.0) - time.monotonic()
                    if left <= 0:
                        break
                    self.wake.wait(left)
                if self.shifted:
                    self.due += SHIFT * self.interval
                self.shifted = False

    def scraped(self) -> None:
        """Somebody took the snapshot now."""
        with self.wake:
            if self.polled and too_near(self.last, self.due, time.monotonic(), self.interval):
                self.shifted = True
                self.wake.notify()

    @property
    def polled(self) -> bool:
        return self.snapshot.polls > 0

    def healthy(self) -> bool:
        """Whether polls come to an end."""
        return time.monotonic() - self.last < STUCK + self.interval

    def poll(self) -> None:
        """One look, and a new snapshot."""
        began, at = time.monotonic(), time.time()
        ros, self.memory = self._look()
        for line in self.updates.read(time.time()):
            self.tell(line)
        before = self.snapshot.ros.master
        self.snapshot = Snapshot(ros, self.memory.errors, self.memory.polls, time.monotonic() - began, at)
        if ros.master != before:
            self.tell(f"the ROS master at {self.observer.uri} {'answers' if ros.master else 'does not answer'}")

    def _look(self) -> tuple[GraphMetrics, History]:
        try:
            state = self.observer.graph()
            errands = self.observer.errands(state)
            launched = self.observer.launched(errands)
        except Exception as error:  # whatever the master does, it is away
            return snapshot.master_away(self.memory, snapshot.reason(error))
        answers = self.observer.answers(errands)
        # the next poll's graph is asked anew, so a node that has moved is found
        return snapshot.next_poll(state, answers, self.memory, launched)
