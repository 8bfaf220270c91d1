# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""What the engine asks and does: the cluster, the robot, the clock. The real and the simulated ones have these methods.

Every method either does what it says or raises one of our errors; `AwayError` says that the robot cannot be reached.
"""

from __future__ import annotations

import contextlib
import threading
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass
from typing import Protocol

from ...module_utils._common.errors import FleetError
from ...module_utils._ros import graph as ros_graph
from ...module_utils._step import objects
from .._kube.applied import Applied
from .._model.windows import ALWAYS, Windows

Object = objects.Object
Graph = ros_graph.Graph


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
    """What the API shows of a robot: its Deployments, and the ConfigMaps, Services and pods that are ours."""

    deployments: Sequence[Object] = ()
    maps: Sequence[Object] = ()
    services: Sequence[Object] = ()
    pods: Sequence[Object] = ()

    def service_uri(self, name: str, namespace: str) -> str:
        """`http://address:port` of a Service, or nothing where it is not there."""
        for service in self.services:
            if (service["metadata"]["name"], service["metadata"]["namespace"]) == (name, namespace):
                return f"http://{service['spec']['clusterIP']}:{service['spec']['ports'][0]['port']}"
        return ""


class Cluster(Protocol):
    """The Kubernetes API of the robot's cluster. KubeError where it is away for longer than a restart takes."""

    def read(self, namespaces: Iterable[str]) -> Live: ...

    def claim(self, namespace: str) -> AbstractContextManager[None]:
        """Be the only run that changes what is in this namespace; HeldError names who is. It ends with its run."""

    def confirm(self) -> None:
        """Whether all that was claimed is still this run's; LostError says whose it is."""

    def apply(self, objects: Sequence[Object], dry_run: bool = False) -> Sequence[Applied]:
        """In this order. After an error some of them may be applied; none after a LostError."""

    def delete(self, objects: Sequence[Object], dry_run: bool = False) -> Sequence[Applied]:
        """What is not there is no error. An object with a uid is deleted if it is that very one."""

    def begin(self, objects: Sequence[Object], timeout: float) -> None:
        """Until their new pods run beside the old ones, or have no place before these have gone; NotReadyError.

        With minReadySeconds: until these are Ready.
        """

    def wait(self, objects: Sequence[Object], timeout: float) -> None:
        """Until all are rolled out and the old pods are gone; NotReadyError, at once where waiting does not help."""

    def stay(self, objects: Sequence[Object], timeout: float, seconds: float = 0.0) -> None:
        """The same, and then so many seconds more; NotReadyError at once if a container ends meanwhile.

        What a pod had ended by itself before this run is none of it, whatever else this run has waited for.
        """

    def beat(self, node: str) -> str:
        """When the node's kubelet was last heard of, in its own words; empty where it never was."""


@dataclass(frozen=True)
class Seen:
    """How a wait on the robot ended: `pass`, `fail`, or `wait` where the time was over; and what is still open."""

    verdict: str
    reason: str = ""
    held: Sequence[str] = ()  # actions whose new goals are held back now


@dataclass(frozen=True)
class Calm:
    """When a robot may be changed: its actions are idle, messages say so (options of ros_ready), and it is time."""

    actions: Sequence[Object] = ()
    when: Sequence[Object] = ()
    windows: Windows = ALWAYS

    def __bool__(self) -> bool:
        """Whether there is anything to wait for."""
        return bool(self.actions or self.when or self.windows)

    @property
    def seconds(self) -> float:
        """For which it has to be listened to, at least."""
        return max((float(one.get("quiet") or one.get("still") or 0.0) for one in self.when), default=0.0)


class Host(Protocol):
    """The robot's own host, where its ROS graph is asked. AwayError where it cannot be reached."""

    def there(self) -> None:
        """Whether it can be reached."""

    def bring(self, images: Sequence[str]) -> bool:
        """Have these images on the node; whether anything had to be brought."""

    def graph(self, master: str, rate_seconds: float = 0.0, nodes: Sequence[str] = ()) -> Graph:
        """The whole graph, with the rates at which these nodes publish; RosError where the master does not answer."""

    def hold(self, master: str, keeper: str, calm: Calm, seconds: float, timeout: float) -> Seen:
        """Wait until the robot is calm; then hold new goals of the actions with a `server`, for `seconds` at most.

        With none nothing is held, and one look that finds it so is enough.
        """

    def release(self, master: str, keeper: str, actions: Sequence[Object]) -> None:
        """Let the held goals go."""

    def ready(self, master: str, conditions: Object, timeout: float, stable: float = 0.0) -> Seen:
        """Wait until the conditions (options of ros_ready) hold, for `stable` seconds without a break."""

    def register(self, master: str, graph: Graph, nodes: Sequence[str] = ()) -> None:
        """Register these nodes (all without names) with the master as the graph shows them."""

    def reap(self, master: str, nodes: Sequence[str]) -> None:
        """Take away what dead nodes of these names left."""


class Clock(Protocol):
    """Seconds since 1970, and a clock that nobody sets."""

    def wall(self) -> float: ...

    def now(self) -> float: ...

    def sleep(self, seconds: float) -> None: ...


def unheard(_text: str) -> None:
    """For a world in which nobody listens."""


@dataclass(frozen=True)
class World:
    """What a run has around it beside the cluster.

    `say` is for whoever runs the playbook, `trace` for whoever wants to know where exactly a run stands.
    """

    host: Host
    clock: Clock
    say: Callable[[str], None] = unheard
    trace: Callable[[str], None] = unheard


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
