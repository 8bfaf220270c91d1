# SPDX-License-Identifier: GPL-3.0-or-later
"""The exporter's process: `run.py exporter [--name value]..`."""

from __future__ import annotations

import json
import os
import signal
import sys
import threading
from typing import Mapping

from . import families, updates
from .claims import Claims
from .families import Family
from .observer import Observer, Poller
from .server import PORT, Server

ENDING = (signal.SIGTERM, signal.SIGINT)
OPTIONS: Mapping[str, str] = {
    "--port": str(PORT),
    "--address": "",
    "--interval": "10",
    "--timeout": "2",
    "--updates": updates.FILE,
    "--claims": "",  # the directory of the storage class, where it is mounted
    "--capacities": "{}",  # bytes by claim, as JSON
    "--namespace": "",
    "--series": str(families.MOST),
}


def tell(line: str) -> None:
    sys.stdout.write(f"{line}\n")
    sys.stdout.flush()


def options(words: list[str]) -> dict[str, str]:
    """`--name value` pairs."""
    found = dict(OPTIONS)
    for name, value in zip(words[::2], words[1::2]):
        if name not in found:
            raise SystemExit(f"usage: exporter [{'] ['.join(f'{known} VALUE' for known in found)}]")
        found[name] = value
    return found


class Sources:
    """Everything that a scrape shows."""

    def __init__(self, chosen: Mapping[str, str]) -> None:
        uri = os.environ.get("ROS_MASTER_URI", "http://localhost:11311")
        self.updates = updates.Updates(chosen["--updates"])
        self.poller = Poller(Observer(uri, float(chosen["--timeout"])), float(chosen["--interval"]), self.updates, tell)
        self.claims = Claims(chosen["--claims"], chosen["--namespace"]) if chosen["--claims"] else None
        self.most = int(chosen["--series"])
        self.capacities: dict[str, int] = json.loads(chosen["--capacities"])

    def start(self) -> None:
        for thread in (self.poller, self.claims):
            if thread is not None:
                thread.start()

    def families(self) -> list[Family]:
        found = [*families.families(self.poller.snapshot), *updates.families(self.updates.entries)]
        if self.claims is not None:
            found += families.claim_families(self.claims.used, self.capacities)
        return families.bounded(found, self.most)


def main(words: list[str]) -> int:
    signal.pthread_sigmask(signal.SIG_BLOCK, ENDING)  # waited for below; threads inherit it, so before any starts
    chosen = options(words)
    sources = Sources(chosen)
    address = (chosen["--address"], int(chosen["--port"]))
    server = Server(address, sources.families, sources.poller.scraped, sources.poller.healthy)
    sources.start()
    threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 60.0}, daemon=True).start()
    tell(f"metrics of {sources.poller.observer.uri} every {sources.poller.interval:g} s at port {address[1]}")
    signal.sigwait(ENDING)
    return 0
