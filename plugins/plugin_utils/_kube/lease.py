# SPDX-License-Identifier: GPL-3.0-or-later
"""A Lease: of all that would do something to one robot, one may. The way Kubernetes' own components elect a leader.

Every write carries the resourceVersion that was read, so of two at once one is refused. No clock is compared with
another one's: a Lease is over when its holder let it go, or when it has stood unchanged for its whole time by the clock
of whoever wants it. So one whose holder was killed is free that long after it was first looked at.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from datetime import UTC, datetime

from ...module_utils._step.objects import Object, duration_of, holder_of, lease_with, version_of
from ...module_utils._step.words import LEASE, LEASE_SECONDS
from .cache import Ref
from .client import Kube
from .connection import ApiError


@dataclass(frozen=True)
class Hold:
    """Who has the Lease: `mine` if we do, else `holder`; since `since`, last heard of at `renewed` (RFC 3339), for so
    many `seconds`."""

    mine: bool
    holder: str
    since: str = ""
    renewed: str = ""
    seconds: float = 0.0

    @property
    def until(self) -> float:
        """When it ends by its holder's clock, in seconds since 1970."""
        return datetime.fromisoformat(self.renewed).timestamp() + self.seconds if self.renewed else 0.0


class Lease:
    """That of a robot's namespace, which `holder` wants. Raises what the API raises, but for conflicts."""

    def __init__(
        self,
        api: Kube,
        namespace: str,
        holder: str,
        now: Callable[[], float] = time.monotonic,
        wall: Callable[[], float] = time.time,
    ) -> None:
        self.ref = Ref("Lease", LEASE, namespace, "coordination.k8s.io/v1")
        self._api, self._holder, self._now, self._wall = api, holder, now, wall
        self._seen: tuple[str, float] = ("", 0.0)  # the version of somebody else's Lease, and since when we know it

    def acquire(self) -> Hold:
        """Take the Lease if it is free, ours already, or over. Call it again until it is `mine`."""
        return self._take(self._free)

    def renew(self) -> Hold:
        """Keep it for another time; not `mine` if it was lost meanwhile."""
        return self._take(lambda found: holder_of(found) == self._holder)

    def release(self) -> Hold:
        """Let it go, so that nobody has to wait for its end; nothing to do if it is not ours."""
        found = self._api.get(self.ref)
        ours = found is not None and holder_of(found) == self._holder
        return self._write(self._api.replace, found, "") if found and ours else _hold(found or {}, self._holder)

    def _take(self, may: Callable[[Object], bool]) -> Hold:
        found = self._api.get(self.ref)
        if found is None:
            new = {"metadata": {"name": self.ref.name, "namespace": self.ref.namespace}}
            return self._write(self._api.create, new, self._holder)
        return self._write(self._api.replace, found, self._holder) if may(found) else _hold(found, self._holder)

    def _free(self, found: Object) -> bool:
        if holder_of(found) in ("", self._holder):
            return True
        if (version := version_of(found)) != self._seen[0]:
            self._seen = (version, self._now())
        return self._now() - self._seen[1] >= duration_of(found)

    def _write(self, way: Callable[[Object], Object], found: Object, holder: str) -> Hold:
        """Write it with this holder, us or nobody. Whoever was faster has it: then that is the answer."""
        time_now = datetime.fromtimestamp(self._wall(), UTC).strftime("%Y-%m-%dT%H:%M:%S.%fZ")
        body = lease_with(holder, found, self._holder, LEASE_SECONDS, time_now)
        try:
            return _hold(way(body), self._holder)
        except ApiError as exc:
            if exc.status != 409:
                raise
            return _hold(self._api.get(self.ref) or {}, self._holder)


def _hold(lease: Object, me: str) -> Hold:
    spec, holder = lease.get("spec") or {}, holder_of(lease)
    since, renewed = (str(spec.get(key) or "") for key in ("acquireTime", "renewTime"))
    return Hold(holder == me, holder, since, renewed, duration_of(lease))
