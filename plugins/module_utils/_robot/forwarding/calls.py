# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Goal forwarding from outside: the keeper's XML-RPC calls hold, release and state. The only way into this package.

docs/goal-forwarding.md is its manual.
"""

from __future__ import annotations

import threading
import time
from typing import Any, Callable, Sequence

from ..._common.errors import RosError
from ..._ros.raw_node import Slave
from ..._ros.registrar import Registrar
from . import rules
from .forwarder import TICK, Forwarder
from .rules import Hold

RETRY = 1.0  # seconds between attempts to write what could not be written
FIRST = 3.0  # seconds for all clients to be connected before a hold is confirmed
OFF = "goal forwarding is switched off (ros_master_goal_forwarding)"


class SwitchedOff:
    """It holds nothing and says so: whoever asked goes on without."""

    def resume(self, kept: Sequence[Any]) -> None:
        """What an earlier one held, with another option, is over."""

    def hold(self, action: str, server: str, seconds: float) -> list[Any]:  # noqa: ARG002 - the call's own shape
        return [0, OFF, 0]

    def release(self, action: str) -> list[Any]:  # noqa: ARG002 - as above
        return [1, OFF, 0]

    def state(self) -> list[Any]:
        return [1, OFF, {}]


class GoalForwarding:
    """All holds. `stays` says of an action's server whether it will stay: only then it gets what is held.

    Each reply is [code, message, value], as the slave API has it.
    """

    def __init__(
        self,
        ros: Registrar,
        slave: Slave,
        save: Callable[[Any], None],
        log: Callable[[str], None],
        stays: Callable[[str, str], bool],
    ) -> None:
        self.ros, self.slave, self.log, self.stays = ros, slave, log, stays
        self.name, self.write = slave.name, save
        self.forwarders: dict[str, Forwarder] = {}
        self.unsaved = False
        self.retry: threading.Timer | None = None  # to write again
        self.lock = threading.RLock()

    def resume(self, kept: Sequence[Any]) -> None:
        """Go on after a restart."""
        for item in kept:
            one = Forwarder(rules.from_dict(item, time.monotonic()), item["header"], self)
            self.forwarders[one.hold.action] = one
            one.log(f"{len(one.hold.goals)} goals are still held")
            one.start()

    def save(self) -> None:
        """Keep it; where that fails (the disk is full), say so and try again until it is written.

        Also that there is nothing to hold any more: what an old file says is held would be forwarded a second time.
        """
        with self.lock:
            now, was_unsaved = time.monotonic(), self.unsaved
            try:
                self.write([{**one.hold.as_dict(now), "header": one.header} for one in self.forwarders.values()])
                self.unsaved = False
            except OSError as error:
                self.unsaved = True
                if not was_unsaved:
                    self.log(f"what is held is not on record, and lost if the keeper is started again: {error}")
                if not was_unsaved or threading.current_thread() is self.retry:
                    self.retry = threading.Timer(RETRY, self.save)
                    self.retry.daemon = True
                    self.retry.start()
            if was_unsaved and not self.unsaved:
                self.log("what is held is on record again")

    def ended(self, forwarder: Forwarder) -> None:
        with self.lock:
            if self.forwarders.get(forwarder.hold.action) is forwarder:
                del self.forwarders[forwarder.hold.action]
        self.save()

    # ---- the calls

    def hold(self, action: str, server: str, seconds: float) -> list[Any]:
        """Keep the goals of `action` until a server that is not the present `server` is up; how many clients."""
        try:
            old_uri = self.ros.addresses([server])[0].get(server, "")
        except RosError as error:
            return [0, str(error), 0]
        until = time.monotonic() + float(seconds)
        with self.lock:
            one = self.forwarders.get(action)
            if one is None or one.over:
                one = self.forwarders[action] = Forwarder(Hold(action, server, old_uri, until), {}, self)
            else:
                one.hold.again(server, old_uri, until)
        waiting = self._first(one)
        if not one.is_alive():
            one.start()
        self.save()
        clients = len(one.scene.clients) if one.scene else 0
        one.log(f"held for {float(seconds):g} s, from {clients} clients")
        missing = f"{waiting} of {clients} clients are not connected" if waiting else ""
        return [1, missing, clients - waiting]

    def _first(self, one: Forwarder) -> int:
        """Connect to all clients; the hold is true only then."""
        end = time.monotonic() + FIRST
        waiting = 0
        while time.monotonic() < end:
            try:
                one.look()
            except RosError as error:
                one.log(str(error))
            with one.lock:
                waiting = one.connect()
            if not waiting and all(one.is_open(key) for key in one.wanted()):
                break
            time.sleep(TICK / 5)
        return waiting

    def release(self, action: str) -> list[Any]:
        """Hand the goals to whatever server is there; how many were forwarded."""
        with self.lock:
            one = self.forwarders.get(action)
        if one is None:
            return [1, f"no goals of {action} are held", 0]
        with one.lock:
            one.hold.release(time.monotonic())
        one.wake.set()
        one.join(FIRST)
        kept = f"{len(one.hold.goals)} goals are kept" if one.is_alive() else ""
        return [1, kept, one.hold.forwarded]

    def state(self) -> list[Any]:
        """Action -> what is held of it, for how long yet, and the server that goals go to."""
        now = time.monotonic()
        with self.lock:
            holds = [one.hold for one in self.forwarders.values()]
        found = {
            hold.action: {
                "node": hold.node,
                "held": list(hold.goals),
                "forwarded": hold.forwarded,
                "seconds": round(hold.until - now, 1),
                "server": hold.server,
            }
            for hold in holds
        }
        return [1, "", found]


def offer(calls: GoalForwarding | SwitchedOff, slave: Slave) -> None:
    """Let the keeper's server answer them."""
    slave.register({"hold": calls.hold, "release": calls.release, "state": calls.state})
