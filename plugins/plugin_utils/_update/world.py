# SPDX-License-Identifier: GPL-3.0-or-later
"""The words in which the engine speaks with its world: with the cluster, the robot's host, the clock.

The real ones are in `cluster` and `host`; whoever stands in for one has its methods. Each of them either does what it
says or raises one of our errors; `AwayError` says that the robot cannot be reached.
"""

from __future__ import annotations

import contextlib
import functools
import threading
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field

from ...module_utils._common.errors import FleetError
from ...module_utils._step import objects
from ...module_utils._step.record import Record, record_of
from .._model import names
from .._model.windows import ALWAYS, Windows

Object = objects.Object


class AwayError(FleetError):
    """The robot cannot be reached. It works on by itself; the next run goes on from there."""


class HeldError(FleetError):
    """Another run changes this robot."""


class LostError(FleetError):
    """Another one has this robot now: the Lease went to it, while this run could not renew it."""


class CancelledError(FleetError):
    """The run was told to stop (SIGINT, SIGTERM)."""


@dataclass(frozen=True)
class Live:
    """What the API shows of a robot: its Deployments, and what else is ours there."""

    deployments: Sequence[Object] = ()
    maps: Sequence[Object] = ()
    services: Sequence[Object] = ()
    pods: Sequence[Object] = ()
    policies: Sequence[Object] = ()
    homes: Mapping[str, str] = field(default_factory=dict)  # app -> where it is; elsewhere one of its name may be

    @functools.cached_property
    def records(self) -> Mapping[str, Record]:
        """App -> what its ConfigMap `<app>-update` keeps."""
        found = {}
        for item in self.maps:
            app, metadata = objects.app_of(item), item["metadata"]
            if metadata["name"] == names.update_name(app) and self.homes.get(app) in (None, metadata.get("namespace")):
                found[app] = record_of(item)
        return found

    def service_uri(self, name: str, namespace: str) -> str:
        """`http://address:port` of a Service, or nothing where it is not there."""
        for service in self.services:
            if (service["metadata"]["name"], service["metadata"]["namespace"]) == (name, namespace):
                return f"http://{service['spec']['clusterIP']}:{service['spec']['ports'][0]['port']}"
        return ""


@dataclass(frozen=True)
class Seen:
    """How a wait on the robot ended: `pass`, `fail`, or `wait` where the time was over; and what is still open."""

    verdict: str
    reason: str = ""


@dataclass(frozen=True)
class Calm:
    """When a robot may be changed: its actions are idle, messages say so (options of ros_ready), and it is time."""

    actions: Sequence[Object] = ()
    when: Sequence[Object] = ()
    windows: Windows = ALWAYS

    def __bool__(self) -> bool:
        return bool(self.actions or self.when or self.windows)

    @property
    def seconds(self) -> float:
        """For which it has to be listened to, at least."""
        return max((float(one.get("quiet") or one.get("still") or 0.0) for one in self.when), default=0.0)


class MonotonicClock:
    """Seconds since 1970, and a clock that nobody sets."""

    def wall(self) -> float:
        return time.time()

    def now(self) -> float:
        return time.monotonic()

    def sleep(self, seconds: float) -> None:
        time.sleep(seconds)


@contextlib.contextmanager
def ticking(seconds: float, tick: Callable[[], None]) -> Iterator[None]:
    """Call `tick` every so many seconds, in a thread that ends with the block. It must not raise."""
    over = threading.Event()

    def go_on() -> None:
        while not over.wait(seconds):
            tick()

    thread = threading.Thread(target=go_on, daemon=True)
    thread.start()
    try:
        yield
    finally:
        over.set()
        thread.join()
