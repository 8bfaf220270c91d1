# SPDX-License-Identifier: GPL-3.0-or-later
"""Robots that somebody else's update has. Their Lease alone says so: the owner writes it, with rights of his own.

docs/other-updaters.md, "A hold", is the manual. The time of a hold is counted by a clock that nobody sets.
"""

from __future__ import annotations

import contextlib
import threading
import time
from dataclasses import asdict, dataclass, field, replace
from typing import Callable, Mapping

from .._common.errors import FleetError
from .._ros.client import Ros1Client
from .._ros.conditions import Conditions
from .._ros.idle_robot import IdleRobot
from .._ros.keeper_client import KeeperCalls
from .._step.objects import Object, duration_of, holder_of, owner_of, version_of
from .._step.words import KEEPER
from .cluster_api import Claim, Cluster
from .memory import KeptFiles

PART = "owners"  # of the kept files: namespace -> its hold, with the seconds to go besides


@dataclass(frozen=True)
class Owned:
    """The version of an owner's Lease, its end, and action -> the server whose new goals are held."""

    version: str
    until: float
    servers: Mapping[str, str] = field(default_factory=dict)


@dataclass(eq=False)
class Holds:
    """Those of all namespaces. Threads may share it; KubeError where the API does not answer."""

    cluster: Cluster
    ros: Ros1Client
    keeper: KeeperCalls
    kept: KeptFiles
    now: Callable[[], float] = time.monotonic
    wall: Callable[[], float] = time.time

    def __post_init__(self) -> None:
        self.lock = threading.RLock()
        there, now = (self.kept.load(PART) or {}).items(), self.now()
        self.held = {space: Owned(one["version"], now + one["left"], one["servers"]) for space, one in there}

    def watch(self, namespace: str, lease: Object | None) -> None:
        """A look where the Lease, as it was seen, or what is known of it says that somebody has a hold."""
        if owner_of(lease) or namespace in self.held:
            self.look(namespace)

    def look(self, namespace: str) -> Object | None:
        """The Lease as it is now, after what follows from it was done."""
        with self.lock:
            found, known = self.cluster.lease(namespace, newest=True), self.held.get(namespace)
            new = bool(owner_of(found)) and not (known and known.version == version_of(found))
            if new:
                servers = known.servers if known else {}
                known = Owned(version_of(found), self.now() + duration_of(found), servers)
            if known and owner_of(found) and self.now() < known.until:
                there: Mapping[str, object] = {}  # what cannot be seen is held once more
                with contextlib.suppress(FleetError, OSError):
                    there = {} if new else self.keeper.held()
                # those that are not: the hold is longer now, or another server has come
                self._robot(known).hold({name: one for name, one in known.servers.items() if name not in there})
                self._keep(namespace, known)
            elif known:
                # what a run holds by now is not let go; the rest ends by itself
                if owner_of(found) or (known.servers and not holder_of(found)):
                    found = self._end(namespace, found, known)
                    if found is None:  # somebody wrote it just now
                        return self.look(namespace)
                self._keep(namespace, None)
            return found

    def add(self, namespace: str, servers: Mapping[str, str]) -> None:
        """New goals of these are held, too, from now on."""
        with self.lock:
            known = self.held.get(namespace)
            if known and servers:
                self._keep(namespace, replace(known, servers={**known.servers, **servers}))

    def of(self, namespace: str) -> Owned:
        """What is known of the hold; where there is none, its time is over."""
        return self.held.get(namespace) or Owned("", self.now())

    def _end(self, namespace: str, found: Object | None, known: Owned) -> Object | None:
        """The Lease after the goals were let go: under it, so that no run holds them at the same time. None: it was not
        to be had."""
        claim = Claim(self.cluster, namespace, found)
        if not claim.write(KEEPER):
            return None
        try:
            self._robot(known).release(known.servers)
        finally:
            claim.write()
        return claim.found

    def _robot(self, known: Owned) -> IdleRobot:
        return IdleRobot(self.ros, self.keeper, Conditions(), lambda: known.until - self.now())

    def _keep(self, namespace: str, known: Owned | None) -> None:
        others = {space: one for space, one in self.held.items() if space != namespace}
        self.held, now = {**others, **({namespace: known} if known else {})}, self.now()
        # without: a keeper that begins anew counts the hold from its beginning
        self.kept.save(PART, {space: {**asdict(one), "left": one.until - now} for space, one in self.held.items()})
