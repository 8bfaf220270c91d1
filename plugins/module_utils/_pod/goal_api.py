# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""The calls that begin and end holds (XML-RPC: hold, release, state). Runs on Python 3.8, in pods."""

from __future__ import annotations

import threading
import time
from typing import Any, Callable, Mapping, Sequence

from .._common.errors import RosError
from .._ros.raw_node import Slave
from .._ros.registrar import Registrar
from . import goals as hold_rules
from .goal_forwarder import TICK, Holding
from .goals import Hold

FIRST = 3.0  # seconds for all clients to be connected before a hold is confirmed


class GoalKeeper:
    """All holds."""

    def __init__(
        self,
        ros: Registrar,
        slave_of: Callable[[Mapping[str, Callable[..., Any]]], Slave],
        save: Callable[[Any], None],
        log: Callable[[str], None],
    ) -> None:
        self.ros, self.log = ros, log
        self.write = save
        self.holdings: dict[str, Holding] = {}
        self.lock = threading.RLock()
        self.slave = slave_of({"hold": self.hold, "release": self.release, "state": self.state})
        self.name = self.slave.name

    def resume(self, recorded: Sequence[Mapping[str, Any]]) -> None:
        """Go on after a restart."""
        for item in recorded:
            holding = Holding(hold_rules.from_dict(item), item["header"], self)
            self.holdings[holding.hold.action] = holding
            holding.log(f"{len(holding.hold.goals)} goals are still held")
            holding.start()

    def save(self) -> None:
        with self.lock:
            self.write([{**one.hold.as_dict(), "header": one.header} for one in self.holdings.values()])

    def ended(self, holding: Holding) -> None:
        with self.lock:
            if self.holdings.get(holding.hold.action) is holding:
                del self.holdings[holding.hold.action]
        self.save()

    # ---- the calls

    def hold(self, action: str, server: str, seconds: float) -> list[Any]:
        """Keep the goals of `action` from now on, until a server that is not the present `server` is up."""
        try:
            old_uri = self.ros.addresses([server])[0].get(server, "")
        except RosError as error:
            return [0, str(error), 0]
        until = time.time() + float(seconds)
        with self.lock:
            holding = self.holdings.get(action)
            if holding is None or holding.over:
                holding = self.holdings[action] = Holding(Hold(action, server, old_uri, until), {}, self)
            else:
                holding.hold.again(server, old_uri, until)
        waiting = self._first(holding)
        if not holding.is_alive():
            holding.start()
        self.save()
        clients = holding.scene.clients if holding.scene else {}
        holding.log(f"held for {float(seconds):g} s, from {len(clients)} clients")
        missing = f"{waiting} of {len(clients)} clients are not connected" if waiting else ""
        return [1, missing, len(clients) - waiting]

    def _first(self, holding: Holding) -> int:
        """Connect to all clients; the hold is true only then."""
        end = time.monotonic() + FIRST
        waiting = 0
        while time.monotonic() < end:
            try:
                holding.look()
            except RosError as error:
                holding.log(str(error))
            with holding.lock:
                waiting = holding.connect()
            if not waiting and all(holding.is_open(key) for key in holding.wanted()):
                break
            time.sleep(TICK / 5)
        return waiting

    def release(self, action: str) -> list[Any]:
        """Hand the goals to whatever server is there; how many were forwarded."""
        with self.lock:
            holding = self.holdings.get(action)
        if holding is None:
            return [1, f"no goals of {action} are held", 0]
        with holding.lock:
            holding.hold.release(time.time())
        holding.wake.set()
        holding.join(FIRST)
        kept = f"{len(holding.hold.goals)} goals are kept" if holding.is_alive() else ""
        return [1, kept, holding.hold.forwarded]

    def state(self) -> list[Any]:
        """Every hold: what is held, for how long yet, and the server that goals go to."""
        now = time.time()
        with self.lock:
            holdings = list(self.holdings.values())
        return [
            1,
            "",
            {
                holding.hold.action: {
                    "node": holding.hold.node,
                    "held": list(holding.hold.goals),
                    "forwarded": holding.hold.forwarded,
                    "seconds": round(holding.hold.until - now, 1),
                    "server": holding.hold.server,
                }
                for holding in holdings
            },
        ]
