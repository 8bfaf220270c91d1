# SPDX-License-Identifier: GPL-3.0-or-later
"""The ROS exporter as a part of the keeper's process: its options, its looks, a page of the keeper's HTTP server."""

from __future__ import annotations

import gzip
import json
import math
import sys
import threading
import time
from dataclasses import replace
from typing import Callable, Mapping

from .._ros.raw_node import Asked, Said
from . import families, snapshot, updates
from .claims import Claims
from .families import Family
from .observer import Observer
from .snapshot import History, Numbers, Snapshot

PATH = "/metrics"
FRESH = 150.0  # seconds for which a look is shown; Prometheus wants a scrape every two minutes at least
LEVEL = 3  # of gzip: over a robot's radio link a tenth of the bytes is worth a millisecond
OPTIONS: Mapping[str, str] = {
    "--interval": "10",  # seconds between two scrapes, each of which a look at the graph follows
    "--timeout": "2",  # seconds for a node's answers
    "--updates": updates.FILE,
    "--claims": "",  # the directory of the storage class, where it is mounted
    "--capacities": "{}",  # bytes by claim, as JSON
    "--namespace": "",
}


def say(line: str) -> None:
    """A line that others read by machine, with nothing before it."""
    sys.stdout.write(f"{line}\n")
    sys.stdout.flush()


class Exporter:
    """Everything that a scrape shows. What is wrong here is a scrape's error, and nothing of the keeper's.

    A look follows each scrape, which shows what the one before found, and never waits. So each scrape finds exactly one
    new look, and a rate over some minutes does not jump. Where nobody scrapes the graph is left alone.
    """

    def __init__(self, uri: str, chosen: Mapping[str, str], tell: Callable[[str], None]) -> None:
        """`chosen` has all OPTIONS; `tell` gets what goes wrong."""
        self.observer = Observer(uri, float(chosen["--timeout"]))
        self.interval = float(chosen["--interval"])  # where many scrape, looks come up to twice as often
        self.updates = updates.Updates(chosen["--updates"])
        self.claims = Claims(chosen["--claims"], chosen["--namespace"]) if chosen["--claims"] else None
        self.capacities: dict[str, int] = json.loads(chosen["--capacities"])
        self.tell, self.wrong = tell, ""
        self.snapshot = Snapshot()
        self.asked = self.ended = -math.inf  # when a look was asked for last, and when one ended
        self.due = threading.Event()  # until its end

    def start(self) -> None:
        """In threads of their own: what goes wrong here is told once, and delays nobody."""
        threading.Thread(target=self.run, daemon=True, name="poller").start()
        if self.claims is not None:
            self.claims.start()

    # ---- what is shown

    def metrics(self, asked: Asked) -> Said:
        """What the last look found; nobody waits for one."""
        body = families.text(self.families())
        if "gzip" not in asked.headers.get("Accept-Encoding", ""):
            return Said(200, body, families.CONTENT_TYPE)
        return Said(200, gzip.compress(body, LEVEL), families.CONTENT_TYPE, {"Content-Encoding": "gzip"})

    def families(self) -> list[Family]:
        found = [*families.families(self.scraped()), *updates.families(self.updates.entries)]
        if self.claims is not None:
            found += families.claim_families(self.claims.used, self.capacities)
        return families.bounded(found)

    def scraped(self) -> Snapshot:
        """What the last look found. Of one that is long ago nothing is known of the graph any more."""
        now, found = time.monotonic(), self.snapshot
        if not self.due.is_set() and now - self.asked >= self.interval / 2:
            self.asked = now
            self.due.set()
        return found if now - self.ended < FRESH else replace(found, ros={})

    # ---- looks, again and again

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

    def poll(self) -> None:
        """One look, and a new snapshot."""
        began, at = time.monotonic(), time.time()
        ros, history = self._look()
        for line in self.updates.read(time.time()):
            say(line)
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
