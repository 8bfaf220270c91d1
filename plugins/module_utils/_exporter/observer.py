# SPDX-License-Identifier: GPL-3.0-or-later
"""The exporter's looks at a whole ROS graph: the master, then all nodes, a few at a time.

It registers nothing and subscribes to nothing. Its only data connections: the handshake that a service's client makes,
and one message of an action's status topic.
"""

from __future__ import annotations

import math
import threading
import time
from dataclasses import replace
from typing import Callable

from .._ros.backend import Questions
from .._ros.client import Ros1Client
from .._ros.graph import Graph, host_of
from .._ros.roslaunch import Child, children
from . import snapshot
from .snapshot import CALLER, History, Numbers, Snapshot
from .updates import Updates

FRESH = 150.0  # seconds for which a look is shown; Prometheus wants a scrape every two minutes at least


class Observer(Ros1Client):
    """A ROS graph, looked at again and again: a few peers at a time, and one status of each action server."""

    at_once, statuses = 8, 1

    def __init__(self, uri: str, timeout: float) -> None:
        super().__init__(uri, timeout, CALLER)
        self.wrong: dict[tuple[str, ...], str] = {}  # question of the last look -> why there is no usable answer

    def noted(self, key: tuple[str, ...], error: BaseException) -> None:
        self.wrong[key] = snapshot.reason(error)

    def look(self) -> tuple[Graph, list[Child]]:
        """The graph, and what launch files started where its nodes are; RosError where the master does not answer."""
        self.wrong = {}
        state = self.state()
        nodes = dict.fromkeys(state.nodes(), frozenset({"bus", "stats"}))
        services = tuple(filter(snapshot.is_watched, state.services))
        graph = self.ask(state, Questions(nodes, services, tuple(state.graph.actions)))
        return graph, children(self, {host_of(node.uri) for node in graph.nodes.values()}, self.at_once)


# ---- again and again


class Poller(threading.Thread):
    """A look after each scrape, which shows what the one before found, and never waits.

    So each scrape finds exactly one new look, and a rate over some minutes does not jump. Where nobody scrapes the
    graph is left alone. The thread is its own: what goes wrong here is told once, and delays nobody.
    """

    def __init__(
        self,
        observer: Observer,
        interval: float,
        updates: Updates,
        tell: Callable[[str], None],
        say: Callable[[str], None],
    ) -> None:
        """`interval` is that of one who scrapes: of many that do, looks come up to twice as often.

        `tell` gets what goes wrong, `say` the lines of updates, which others read.
        """
        super().__init__(daemon=True, name="poller")
        self.observer, self.interval, self.updates, self.tell, self.say = observer, interval, updates, tell, say
        self.snapshot = Snapshot()
        self.asked = self.ended = -math.inf  # when a look was asked for last, and when one ended
        self.due = threading.Event()  # until its end
        self.wrong = ""

    def run(self) -> None:
        while self.due.wait():
            try:
                self.poll()
                self.wrong = ""
            except Exception as error:  # a mistake of ours: the next poll may do
                told, self.wrong = self.wrong, f"{type(error).__name__}: {error}"
                if self.wrong != told:
                    self.tell(f"no metrics of the graph: {self.wrong}")
            self.due.clear()

    def scraped(self) -> Snapshot:
        """What the last look found. Of one that is long ago nothing is known of the graph any more."""
        now, found = time.monotonic(), self.snapshot
        if not self.due.is_set() and now - self.asked >= self.interval / 2:
            self.asked = now
            self.due.set()
        return found if now - self.ended < FRESH else replace(found, ros={})

    def poll(self) -> None:
        """One look, and a new snapshot."""
        began, at = time.monotonic(), time.time()
        ros, history = self._look()
        for line in self.updates.read(time.time()):
            self.say(line)
        self.ended = time.monotonic()
        self.snapshot = Snapshot(ros, history, self.ended - began, at)

    def _look(self) -> tuple[Numbers, History]:
        before = self.snapshot.history
        try:
            graph, launched = self.observer.look()
        except Exception as error:  # whatever the master does, it is away
            return snapshot.master_away(before, snapshot.reason(error))
        # the next poll's graph is asked anew, so a node that has moved is found
        return snapshot.next_poll(graph, list(self.observer.wrong.values()), before, launched)
