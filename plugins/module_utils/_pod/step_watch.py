# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""The keeper beside steps of updates: it takes back what `way_back` says, as the run would have that is gone.

A look costs one small request, the robot's Lease. Only where that has changed, and nobody has it, the Deployments are
looked at.
"""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import Any, Callable, Iterable

from .._common.errors import FleetError, KubeError, RosError
from .._ros.backend import Backend
from .cluster_api import FLEET, Cluster
from .open_goals import Goals, open_goals
from .way_back import (
    HOLDER,
    Object,
    Observed,
    Step,
    is_marked,
    lease_of,
    name_of,
    node_of,
    restored,
    rolled_out,
    steps_of,
    unproven,
    version_of,
)

LOOK = 10.0  # seconds between two looks at a namespace,
LEAST = 1.0  # but no more looks than this: with a hundred robots each of them has to wait
HOLD = 300.0  # for the old server to come back: goals are held so long
CLUSTER = "the cluster"
AGAIN = 0.5  # between "idle" and "idle still"
UNREADABLE = 2.0  # times the time to get ready: after that, goals of a node that cannot be read keep nobody waiting


@dataclass(frozen=True)
class Robot:
    """What the keeper does for the robot's graph meanwhile: its own calls."""

    hold: Callable[[str, str, float], list[Any]]  # action, server, seconds
    release: Callable[[str], list[Any]]
    take_back: Callable[[Iterable[str]], None]  # services, by these nodes where they live


class StepWatch:
    """Looks at one namespace after the other."""

    def __init__(  # noqa: PLR0913 - the clocks are the price of tests that never wait
        self,
        cluster: Cluster,
        ros: Backend,
        robot: Robot,
        log: Callable[[str], None],
        now: Callable[[], float] = time.monotonic,
        wall: Callable[[], float] = time.time,
        sleep: Callable[[float], None] = time.sleep,
    ) -> None:
        self.cluster, self.ros, self.robot, self.log = cluster, ros, robot, log
        self.now, self.wall, self.sleep = now, wall, sleep
        self.observed: dict[str, Observed] = {}
        self.turn: list[str] = []
        self.said: dict[str, str] = {}

    def run(self) -> None:
        while True:
            try:
                pause = self.look()
            except Exception as error:  # whatever one look brings, the next one may be better
                self.log(f"error: {type(error).__name__}: {error}")
                pause = LOOK
            self.sleep(pause)

    def look(self) -> float:
        """At the next namespace; seconds until the one after it. An API that is away is looked for again later."""
        where = CLUSTER
        try:
            spaces = self.cluster.namespaces()
            self.turn = [name for name in self.turn if name in spaces] or list(spaces)
            where = self.turn.pop(0)
            self._look(where, self.observed.setdefault(where, Observed()))
            self._tell(where, "")
            self._tell(CLUSTER, "")
        except FleetError as error:
            for seen in self.observed.values() if where == CLUSTER else [self.observed[where]]:
                seen.away()
            self._tell(where, str(error))
            return LOOK
        return max(LEAST, LOOK / len(spaces))

    def _tell(self, about: str, text: str) -> None:
        """What is so now; once, and not again before it changes."""
        if text != self.said.get(about, ""):
            self.log(f"{about}: {text or 'the Kubernetes API answers'}")
            self.said[about] = text

    # ---- the look

    def _look(self, namespace: str, seen: Observed) -> None:
        lease = self.cluster.lease(namespace)
        seen.lease(lease, self.now())
        # whoever changes what is the whole fleet's has the Lease of one of the robots
        involved = list(self.observed.values()) if namespace == FLEET else [seen]
        versions = [one.version for one in involved]
        if not all(one.free for one in involved):
            seen.waited, seen.nothing = {}, None
            return
        if versions == seen.nothing:
            return
        steps = self._steps(namespace)
        seen.nothing = None if steps else versions
        for step in seen.due(steps):
            self._due(namespace, seen, step)

    def _steps(self, namespace: str) -> list[Step]:
        there = self.cluster.deployments(namespace)
        marked = [item for item in there if is_marked(item)]
        return steps_of([unproven(item, self.cluster.update_map(namespace, name_of(item))) for item in marked], there)

    # ---- the way back

    def _due(self, namespace: str, seen: Observed, step: Step) -> None:
        waiting = self._waits(open_goals(self.ros, step), seen, step)
        if waiting:
            self._tell(f"{namespace}/{step.name}", f"is taken back when it rests: {waiting}")
            return
        found = self.cluster.lease(namespace)
        lease = self._lease(namespace, found, HOLDER) if version_of(found) == seen.version else None
        if lease is None:
            return  # somebody else has it now
        try:
            # from here on nobody else changes the robot; what was due may be over by now
            for again in self._steps(namespace):
                if again.key == step.key and again.failing:
                    lease = self._go_back(namespace, seen, again, lease)
        finally:
            self._lease(namespace, lease, "")

    def _waits(self, goals: Goals, seen: Observed, step: Step) -> str:
        patient = seen.waited[step.key] < UNREADABLE * step.ready_timeout
        return ", ".join([*goals.busy, *(goals.unknown if patient else ())])

    def _lease(self, namespace: str, found: Object | None, holder: str) -> Object | None:
        """Take the Lease, keep it, or let it go; None if somebody else has written it since it was `found`."""
        return self.cluster.write_lease(namespace, lease_of(found, namespace, holder, self._time()))

    def _go_back(self, namespace: str, seen: Observed, step: Step, lease: Object) -> Object:
        """The Lease as it is then."""
        held = self._hold(open_goals(self.ros, step))
        self.sleep(AGAIN if held else 0)
        waiting = self._waits(open_goals(self.ros, step), seen, step) if held else ""
        kept = None if waiting else self._lease(namespace, lease, HOLDER)  # the hold may have taken its time
        if kept is None:
            for action in held:
                self.robot.release(action)
            return lease
        self._give_services_back(step)
        reason = f"not ready {seen.waited[step.key]:.0f} s after the run that began it had gone"
        for member in step.going_back:
            self.cluster.apply(namespace, restored(member, reason, self._time()))
            self.log(f"{namespace}: {member.name} was taken back: {reason}")
        return kept

    def _hold(self, goals: Goals) -> list[str]:
        """Goals that come now are for the old server."""
        return [action for action, server in (goals.servers or {}).items() if self.robot.hold(action, server, HOLD)[0]]

    def _give_services_back(self, step: Step) -> None:
        """First, so that a service never points to nothing while its old server lives."""
        new = {node_of(member.deployment) for member in step.going_back}
        old = {node_of(member.before) for member in step.going_back if member.before}
        try:
            self.robot.take_back(old - new - {""})
        except RosError as error:
            self.log(f"{step.name}: services were not given back: {error}")

    def _time(self) -> str:
        seconds = self.wall()
        whole = time.strftime("%Y-%m-%dT%H:%M:%S", time.gmtime(seconds))
        return f"{whole}.{int(seconds % 1 * 1e6):06d}Z"


class Staying:
    """Whether the server of an action is the one that will stay: its version is not on trial, or has passed.

    Where nobody can say so, nobody can take it back either.
    """

    def __init__(self, cluster: Cluster, now: Callable[[], float] = time.monotonic) -> None:
        self.cluster, self.now = cluster, now
        self.of: dict[tuple[str, str], tuple[str, str]] = {}  # action and node -> the Deployment
        self.silent: float | None = None  # since when the API does not answer

    def __call__(self, action: str, node: str) -> bool:
        try:
            found = self._on_trial(action, node)
            self.silent = None
        except KubeError:
            self.silent = self.now() if self.silent is None else self.silent
            return self.now() - self.silent >= LOOK
        return not found

    def _on_trial(self, action: str, node: str) -> bool:
        found = self.of.get((action, node)) or self._find(action, node)
        if found is None:
            return False
        self.of[action, node] = found
        deployment = self.cluster.deployment(*found)
        return deployment is not None and is_marked(deployment) and not rolled_out(deployment)

    def _find(self, action: str, node: str) -> tuple[str, str] | None:
        """The Deployment of that node; a launch file's is the one on trial that served the action before."""
        for namespace in self.cluster.namespaces():
            there = self.cluster.deployments(namespace)
            for item in there:
                if node_of(item) == node:
                    return namespace, name_of(item)
            for item in there:
                if is_marked(item):
                    left = self.cluster.update_map(namespace, name_of(item))
                    if action in (unproven(item, left).contract.get("actions") or ()):
                        return namespace, name_of(item)
        return None
