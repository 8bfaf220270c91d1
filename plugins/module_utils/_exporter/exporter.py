# SPDX-License-Identifier: GPL-3.0-or-later
"""The ROS exporter as a part of the keeper's process: its options, and the pages of the keeper's HTTP server."""

from __future__ import annotations

import gzip
import json
import sys
from typing import Callable, Mapping

from .._ros.raw_node import Asked, Said
from . import families, updates
from .claims import Claims
from .families import Family
from .observer import Observer, Poller

PATH = "/metrics"
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
    """Everything that a scrape shows. What is wrong here is a scrape's error, and nothing of the keeper's."""

    def __init__(self, uri: str, chosen: Mapping[str, str], tell: Callable[[str], None]) -> None:
        """`chosen` has all OPTIONS."""
        observer = Observer(uri, float(chosen["--timeout"]))
        self.updates = updates.Updates(chosen["--updates"])
        self.poller = Poller(observer, float(chosen["--interval"]), self.updates, tell, say)
        self.claims = Claims(chosen["--claims"], chosen["--namespace"]) if chosen["--claims"] else None
        self.capacities: dict[str, int] = json.loads(chosen["--capacities"])

    def start(self) -> None:
        for thread in (self.poller, self.claims):
            if thread is not None:
                thread.start()

    def families(self) -> list[Family]:
        found = [*families.families(self.poller.scraped()), *updates.families(self.updates.entries)]
        if self.claims is not None:
            found += families.claim_families(self.claims.used, self.capacities)
        return families.bounded(found)

    def metrics(self, asked: Asked) -> Said:
        """What the last look found; nobody waits for one."""
        body = families.text(self.families())
        if "gzip" not in asked.headers.get("Accept-Encoding", ""):
            return Said(200, body, families.CONTENT_TYPE)
        return Said(200, gzip.compress(body, LEVEL), families.CONTENT_TYPE, {"Content-Encoding": "gzip"})
