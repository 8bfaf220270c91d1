# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""A change of a host on which robots work, under the care of a step. The change and the world are handed in.

    look      the robots that work there; where none does, nothing is waited for
    claim     this run alone changes them
    record    their graphs
    hold      idle, new goals held back
    make      the change itself
    prove     the change works, the node and the Deployments are ready, the graphs are what was recorded
    or back   the change is undone, under the same proof

The change may take the cluster's API away for a while, as a restart of a robot's own k3s does. Until it is made that is
an error, from then on weather, for as long as `ready_timeout` says.
"""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Protocol

from ansible_collections.rosops.fleet.plugins.module_utils._common.errors import FleetError, KubeError, NotReadyError
from ansible_collections.rosops.fleet.plugins.module_utils._common.poll import PASS, WAIT
from ansible_collections.rosops.fleet.plugins.module_utils._ros import contract as ros_contract
from ansible_collections.rosops.fleet.plugins.plugin_utils._model import names
from ansible_collections.rosops.fleet.plugins.plugin_utils._model.context import Robot, master_namespace, master_uri
from ansible_collections.rosops.fleet.plugins.plugin_utils._model.outcomes import (
    BUSY,
    FAILED,
    OFFLINE,
    ROLLED_BACK,
    UPDATED,
)
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.engine import BusyError
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.events import step_id
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.outcome import StepResult
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.step import actions_to_rest
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.world import (
    AwayError,
    CancelledError,
    Clock,
    Cluster,
    Graph,
    HeldError,
    Host,
    Live,
    Object,
    Seen,
    unheard,
)

SLICE = 8.0  # seconds of one wait on the robot; what is open is said after each
HOLD_SECONDS = 60.0  # the keeper lets held goals go then by itself
PAUSE = 1.0
UNPROVEN = "it runs unproven beside the way back; the next run proves it or takes it back"


class Change(Protocol):
    """What is to be done to the host. Every method does what it says or raises one of our errors."""

    @property
    def name(self) -> str: ...

    @property
    def before(self) -> str:
        """What an operator reads of what is there."""

    @property
    def after(self) -> str:
        """Of what is to come; the same as `before` where only settings change."""

    def make(self) -> None:
        """Do it. After an error some of it may be done."""

    def works(self) -> None:
        """Wait until what was changed serves by its own word; NotReadyError."""

    def undo(self) -> None:
        """The way back, whatever part of the change was made."""

    def proven(self) -> None:
        """What is there now has been proven, and is what a later change goes back to."""


class NodeCluster(Cluster, Protocol):
    """The cluster as a change of one of its nodes needs it."""

    def beat(self, node: str) -> str:
        """When the node's kubelet was last heard of, in its own words; empty where it never was."""


@dataclass(frozen=True)
class Limits:
    """How patient a change is, in seconds; `on_busy` is wait, defer or force."""

    on_busy: str = "wait"
    busy_timeout: float = 600.0
    ready_timeout: float = 300.0
    look: float | None = None  # of waiting in this run, which then is over and may come back. None: all of it
    since: float | None = None  # when an earlier run began to wait, by the clock's `now`
    stable: float = 1.0
    check: bool = False


@dataclass(frozen=True)
class Surroundings:
    """What the change is made in; without a `cluster` nobody can be asked who works here."""

    host: Host
    clock: Clock
    cluster: NodeCluster | None = None
    say: Callable[[str], None] = unheard
    trace: Callable[[str], None] = unheard
    sleep: Callable[[float], None] = time.sleep


@dataclass
class _Ward:
    """A robot that works on the host."""

    robot: Robot
    live: Live
    graph: Graph | None = None
    rest: Sequence[Mapping[str, str]] = ()
    held: bool = False

    @property
    def master(self) -> str:
        robot = self.robot
        return master_uri(robot) if robot.master.mode == "external" else self.live.service_uri(names.MASTER_NAME)

    @property
    def keeper(self) -> str:
        return self.live.service_uri(names.KEEPER_NAME)


class Guarded:
    """One change of one host. `node` is its name in the cluster; empty where it has none to be proven by.

    `robots` are those that may work there.
    """

    def __init__(self, change: Change, robots: Sequence[Robot], node: str, limits: Limits, world: Surroundings) -> None:
        self.change, self.robots, self.node, self.limits = change, robots, node, limits
        self.host, self.cluster, self.clock = world.host, world.cluster, world.clock
        self.say, self.trace, self.sleep = world.say, world.trace, world.sleep
        self.wards: list[_Ward] = []
        self.before = ""  # the kubelet's last word before the change
        self.made = False
        self.waiting: float | None = None  # since when it has waited, where only this look is over
        name, before, after = change.name, change.before, change.after
        self.result = StepResult(
            step_id(node, [name], self.clock.wall()),
            name, [name], "replace",
            {name: {"image": before}},
            {name: {"image": after, "revision": "settings" if before == after else ""}},
            self.clock.wall(), {},
        )  # fmt: skip

    def run(self) -> StepResult:
        """From the look to the outcome. Whatever goes wrong with this host is its outcome, and no error."""
        try:
            with self._phase("gate"):
                self.host.there()
                self._look()
            if self.limits.check:
                return self._foresee()
            with self._claimed():
                return self._changed()
        except HeldError as error:
            return self._ends(BUSY, f"nothing was touched: {error}")
        except AwayError as error:
            return self._ends(OFFLINE, f"nothing was touched: {error}")
        except FleetError as error:
            return self._ends(FAILED, f"nothing was touched: {error}")

    # --- before -----------------------------------------------------------------------------------------------------

    def _look(self) -> None:
        """Who works here, and what each robot's graph is now."""
        if self.cluster is None:
            return
        for robot in sorted(self.robots, key=lambda one: one.name):
            live = self.cluster.read(dict.fromkeys([robot.namespace, master_namespace(robot)]))
            if any(item["metadata"]["namespace"] == robot.namespace for item in live.deployments):
                self.wards.append(_Ward(robot, live))

    def _record(self) -> None:
        for ward in self.wards:
            try:
                ward.graph = self.host.graph(ward.master)
            except (AwayError, CancelledError):
                raise
            except FleetError as error:
                if self.limits.on_busy != "force":
                    raise
                self.say(f"the graph of {ward.robot.name} cannot be read, and is not waited for: {error}")
                continue
            ward.rest = actions_to_rest(ward.graph, _nodes(ward.graph, ward.robot))

    def _foresee(self) -> StepResult:
        """What the change would meet now."""
        self._record()
        for ward in self.wards:
            seen = self.host.hold(ward.master, "", ward.rest, HOLD_SECONDS, 0.0) if ward.rest else Seen(PASS)
            busy = "" if seen.verdict == PASS else seen.reason
            self.say(f"{self.change.name}: {ward.robot.name} is {f'busy now: {busy}' if busy else 'idle now'}")
            if busy and self.limits.on_busy == "defer":
                return self._ends(BUSY, busy)
        return self._ends(UPDATED)

    @contextlib.contextmanager
    def _claimed(self) -> Iterator[None]:
        with contextlib.ExitStack() as claims:
            if self.cluster is not None:
                for ward in self.wards:
                    claims.enter_context(self.cluster.claim(ward.robot.namespace))
            yield

    def _hold(self) -> None:
        """Wait until all robots are idle, and hold new goals back until the change is over."""
        limits, now = self.limits, self.clock.now()
        began = now if limits.since is None else limits.since
        end = began + limits.busy_timeout if limits.on_busy == "wait" else now
        look_end = end if limits.look is None else min(end, now + limits.look)
        for ward in self.wards if limits.on_busy != "force" else ():
            while ward.rest:
                left = max(look_end - self.clock.now(), 0.0)
                ward.held = True  # as long as nobody knows better: an answer may be lost
                seen = self.host.hold(ward.master, ward.keeper, ward.rest, HOLD_SECONDS, min(left, SLICE))
                ward.held = bool(seen.held)
                if seen.verdict == PASS:
                    break
                if seen.verdict != WAIT:
                    raise NotReadyError(f"the actions of {ward.robot.name} cannot be looked at: {seen.reason}")
                if left <= SLICE:
                    self.waiting = began if look_end < end else None
                    raise BusyError(f"{ward.robot.name}: {seen.reason}")
                spent = self.clock.now() - began
                what = f"{self.change.name} waits until {ward.robot.name} is idle"
                self.say(f"{what}, for {spent:.0f} s now: {seen.reason}")

    # --- the change -------------------------------------------------------------------------------------------------

    def _changed(self) -> StepResult:
        try:
            with self._phase("wait"):
                self._record()
                self._hold()
            with self._phase("apply"):
                if self.cluster is not None:
                    self.cluster.confirm()
                    self.before = self.cluster.beat(self.node) if self.node else ""
                self.made = True  # from the first moment on
                self.change.make()
            with self._phase("verify"):
                self._prove()
                self.change.proven()
            return self._ends(UPDATED)
        except BusyError as error:
            return self._ends(BUSY, f"nothing was touched: {error}")
        except AwayError as error:
            return self._ends(OFFLINE, self._left(f"the host went away: {error}"))
        except CancelledError as error:
            return self._ends(FAILED, self._left(str(error)))
        except FleetError as error:
            return self._back(error) if self.made else self._ends(FAILED, f"nothing was touched: {error}")
        finally:
            self._release()

    def _back(self, error: FleetError) -> StepResult:
        self.say(f"{self.change.name}: {error}; it is taken back")
        try:
            with self._phase("rollback"):
                with contextlib.suppress(KubeError):  # the API may be what the change has broken
                    self.before = self.cluster.beat(self.node) if self.cluster and self.node else ""
                self.change.undo()
                self._prove()
                self.change.proven()
        except AwayError as away:
            return self._ends(OFFLINE, self._left(f"the host went away: {away}; before that: {error}"))
        except FleetError as worse:
            return self._ends(FAILED, f"{error}; the way back failed, too: {worse}; {UNPROVEN}")
        return self._ends(ROLLED_BACK, str(error))

    def _prove(self) -> None:
        """By the change's own word, by the node and the Deployments, by the graphs."""
        self.change.works()
        end = self.clock.now() + self.limits.ready_timeout
        cluster = self.cluster
        if cluster is not None and self.node:
            self._patiently(end, lambda: self._heard_anew(cluster))
            self._patiently(end, lambda: self._rolled_out(cluster, end))
        for ward in self.wards:
            if ward.graph is not None:
                self._as_recorded(ward, ward.graph, end)

    def _heard_anew(self, cluster: NodeCluster) -> None:
        """The API's word on a node may be older than the change: only a kubelet that says something new is up."""
        if cluster.beat(self.node) == self.before:
            raise NotReadyError(f"node {self.node}: its kubelet has not been heard of since")

    def _rolled_out(self, cluster: NodeCluster, end: float) -> None:
        node = {"apiVersion": "v1", "kind": "Node", "metadata": {"name": self.node}}
        there = [item for ward in self.wards for item in ward.live.deployments if _available(item)]
        cluster.wait([node, *there], max(end - self.clock.now(), 0.0))

    def _as_recorded(self, ward: _Ward, graph: Graph, end: float) -> None:
        conditions = _conditions(graph, _nodes(graph, ward.robot))
        while True:
            left = max(end - self.clock.now(), self.limits.stable)
            seen = self.host.ready(
                ward.master, conditions, min(left, SLICE + self.limits.stable), stable=self.limits.stable
            )
            if seen.verdict == PASS:
                return
            if self.clock.now() >= end:
                raise NotReadyError(f"the graph of {ward.robot.name}: {seen.reason}")
            self.say(f"{self.change.name}: the graph of {ward.robot.name} is not yet what it was: {seen.reason}")

    def _patiently(self, end: float, look: Callable[[], None]) -> None:
        """Again and again until it is well or the time is over; what was seen last is the error."""
        said = self.clock.now()
        while True:
            try:
                look()
            except (KubeError, NotReadyError) as error:
                if self.clock.now() >= end:
                    raise NotReadyError(str(error)) from error
                if self.clock.now() - said >= SLICE:
                    said = self.clock.now()
                    self.say(f"{self.change.name}: not yet proven: {error}")
                self.sleep(PAUSE)
            else:
                return

    # --- after ------------------------------------------------------------------------------------------------------

    def _release(self) -> None:
        """Let the goals go that are still held. If nobody can, the keeper does it by itself."""
        for ward in self.wards:
            if ward.held:
                ward.held = False
                with contextlib.suppress(FleetError):
                    self.host.release(ward.master, ward.keeper, ward.rest)

    def _left(self, why: str) -> str:
        return f"{why}; {UNPROVEN}" if self.made else f"{why}; nothing was touched"

    def _ends(self, outcome: str, reason: str = "") -> StepResult:
        self.result = replace(self.result, outcome=outcome, reason=reason)
        return self.result

    @contextlib.contextmanager
    def _phase(self, name: str) -> Iterator[None]:
        began = self.clock.now()
        self.trace(f"{self.change.name}: {name}")
        try:
            yield
        finally:
            phases = {**self.result.phases, name: round(self.clock.now() - began, 3)}
            self.result = replace(self.result, phases=phases)


def _nodes(graph: Graph, robot: Robot) -> list[str]:
    """The robot's nodes but somebody's tools; where it shares a master they are below its name."""
    below = "/" if robot.master.mode == "robot" else f"/{names.ros_name(robot.name)}/"
    return [name for name in sorted(graph["nodes"]) if name.startswith(below) and not ros_contract.is_tool(name)]


def _conditions(graph: Graph, nodes: Sequence[str]) -> Object:
    """What these nodes are to the graph. A change of the host is no reason for another rate."""
    found = ros_contract.conditions(ros_contract.record(graph, nodes))
    return {**found, "topics": [{key: topic[key] for key in topic if key != "min_rate"} for topic in found["topics"]]}


def _available(deployment: Object) -> bool:
    """What was not well before the change is none of its proof."""
    status = deployment.get("status") or {}
    return int(status.get("availableReplicas") or 0) >= int((deployment.get("spec") or {}).get("replicas", 1))
