# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""A robot in the hands of a run: where its master is, objects applied, waits that say what is still open."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator, Sequence

from ...module_utils._common.errors import NotReadyError, RosError
from ...module_utils._common.poll import FAIL, PASS, WAIT
from .._kube.applied import Applied
from .._model import names
from .._model.context import Robot, master_namespace, master_uri
from .._objects.namespace import needs_fleet_namespace
from .events import EVENTS_NAME
from .world import Cluster, Graph, Live, Object, Seen, World

MASTER_SECONDS = 30.0
SLICE = 8.0  # seconds of one wait on the robot; what is open is said after each


class Hands:
    """One robot and its world; `live` is what the API showed of it last."""

    def __init__(self, robot: Robot, cluster: Cluster, world: World, check: bool = False) -> None:
        self.robot, self.cluster, self.world, self.check = robot, cluster, world, check
        self.host, self.clock = world.host, world.clock
        self.say, self.trace = world.say, world.trace
        self.live = Live()
        self.changes: list[Applied] = []
        self.graph_told: dict[str, object] = {}  # of what the whole robot promises: verdict, and elapsed seconds

    @property
    def master(self) -> str:
        """The address of the robot's ROS master, as its hosts reach it."""
        if self.robot.master.mode == "external":
            return master_uri(self.robot)
        return self.live.service_uri(names.MASTER_NAME, master_namespace(self.robot))

    @property
    def keeper(self) -> str:
        return self.live.service_uri(names.KEEPER_NAME, master_namespace(self.robot))

    def read(self) -> Live:
        """What the API shows of the robot now, with what of the fleet is its own, too."""
        shared = [names.FLEET_NAMESPACE] if needs_fleet_namespace(self.robot) else []
        return self.cluster.read([self.robot.namespace, *shared])

    def apply_all(self, objects: Sequence[Object]) -> None:
        """All of them in one call; in check mode it is only found out what that would change."""
        if objects:
            self.changes += [change for change in self.cluster.apply(objects, self.check) if _worth_telling(change)]

    def delete(self, objects: Sequence[Object]) -> None:
        """The same for objects that are to go."""
        if objects:
            self.changes += [done for done in self.cluster.delete(objects, self.check) if done.changed]

    def until(
        self,
        wait: Callable[[float], Seen],
        timeout: float,
        what: str,
        least: float = SLICE,
        since: float | None = None,
    ) -> Seen:
        """Wait in slices, and say between two of them what is still open, and since when."""
        began = self.clock.now()
        self.trace(what)
        while True:
            spent = self.clock.now() - began
            self.cluster.confirm()
            seen = wait(max(min(timeout - spent, max(least, SLICE)), 0.0))
            spent = self.clock.now() - began
            if seen.verdict != WAIT or spent >= timeout:
                return seen
            open_for = self.clock.now() - (began if since is None else since)
            self.say(f"{what}, for {open_for:.0f} s now: {seen.reason}")

    def ready(self, conditions: Object, timeout: float, what: str, stable: float = 0.0) -> None:
        """Wait until the robot's graph is like that; NotReadyError says what of it is not."""
        seen = self.until(
            lambda seconds: self.host.ready(self.master, conditions, max(seconds, stable), stable),
            timeout,
            f"waits until {what}",
            least=stable + SLICE,  # a peer that hangs is known to after some seconds, and the stable ones begin then
        )
        if seen.verdict != PASS:
            raise NotReadyError(seen.reason)

    @contextlib.contextmanager
    def telling(self) -> Iterator[None]:
        """Keep for the report how a look at what the whole robot promises ends."""
        began, self.graph_told = self.clock.now(), {"verdict": FAIL}
        try:
            yield
            self.graph_told["verdict"] = PASS
        finally:
            self.graph_told["elapsed"] = round(self.clock.now() - began, 3)

    def master_answers(self, what: str) -> None:
        """Wait until it does; NotReadyError. A new one's pod is ready a moment before its Service leads there."""
        self.ready({}, MASTER_SECONDS, what)

    def graph(self, what: str) -> Graph:
        """As it is now. A master that is silent is waited for a moment; RosError or NotReadyError if it stays so."""
        try:
            return self.host.graph(self.master)
        except RosError as error:
            self.say(f"{what}: {error}")
            self.master_answers("the master answers")
            return self.host.graph(self.master)


def _worth_telling(change: Applied) -> bool:
    """The record of updates changes with every step: its news is the outcome itself."""
    return change.changed and change.ref.name != EVENTS_NAME
