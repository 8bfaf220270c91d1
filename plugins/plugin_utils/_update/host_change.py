# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""A change of a host on which robots work: of its k3s, or what a user's own tasks do.

All robots that work there rest at the same time. What their graphs were lies in their namespaces before the change is
made, so that a run after one that was killed proves the change against what was there before it. The change may take
the cluster's API away for a while, as a restart of a robot's own k3s does. Until the change is made that is an error,
from then on weather, for as long as `ready_timeout` says.
"""

from __future__ import annotations

import contextlib
import dataclasses
import functools
import json
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

from ...module_utils._common.errors import FleetError, KubeError, NotReadyError
from ...module_utils._common.poll import FAIL, PASS
from ...module_utils._ros import contract as ros_contract
from ...module_utils._ros.names import is_tool
from ...module_utils._step.words import CONTRACT
from .._model import names
from .._model.context import Robot
from .._objects.common import config_map, owner_labels
from .change import Change, Ended
from .events import step_id
from .hands import SLICE, Hands
from .outcome import StepResult
from .plan import wanted_before
from .rest import HOLD_SECONDS, BusyError, Rest
from .settings import Settings
from .step import actions_to_rest
from .world import AwayError, Calm, CancelledError, Cluster, Graph, Object, World

PAUSE = 1.0  # between two looks at what comes up


class Work(Protocol):
    """What is to be done to the host. Every method does what it says or raises one of our errors."""

    @property
    def name(self) -> str: ...

    @property
    def before(self) -> str:
        """What an operator reads of what is there."""

    @property
    def after(self) -> str:
        """Of what is to come; the same as `before` where only settings change."""

    @property
    def unproven(self) -> bool:
        """Whether what is there was made by a run that ended before it was proven."""

    @property
    def left(self) -> str:
        """What a run leaves that can neither prove it nor go back."""

    def make(self) -> None:
        """Do it. After an error some of it may be done."""

    def works(self) -> None:
        """Wait until what was changed serves by its own word; NotReadyError."""

    def undo(self) -> None:
        """The way back, whatever part of the work was done."""

    def proven(self) -> None:
        """What is there now has been proven, and is what a later change goes back to."""


@dataclass(frozen=True)
class Place:
    """The host in its cluster, by the name of its `node`, with those `robots` that may work there.

    Without a cluster nobody can be asked who works there, and without a node there is none to be proven by.
    """

    cluster: Cluster | None = None
    node: str = ""
    robots: Sequence[Robot] = ()


class HostChange(Change):
    """The work with its gate, its proof and its way back."""

    where = "host"

    def __init__(self, work: Work, place: Place, settings: Settings, world: World) -> None:
        self.work, self.settings, self.world = work, settings, world
        self.cluster, self.node, self.robots = place.cluster, place.node, place.robots
        self.wards: list[Ward] = []
        self._beat = ""  # the kubelet's last word before the change
        self._claims = contextlib.ExitStack()
        name, before, after, now = work.name, work.before, work.after, world.clock.wall()
        new = {"image": after, "revision": "settings" if before == after else ""}
        told = StepResult(
            step_id(place.node, [name], now), name, [name], "replace", {name: {"image": before}}, {name: new}, now, {}
        )
        super().__init__(told, world, settings.check)

    def take(self) -> Ended:
        """The claims end when nothing is held any more."""
        with self._claims:
            ended = super().take()
            self.release()
            return ended

    @property
    def left(self) -> str:
        return self.work.left

    # --- before -----------------------------------------------------------------------------------------------------

    def gate(self) -> None:
        """See who works here, and be the only run that changes these robots."""
        self.world.host.there()
        if self.cluster is None:
            return
        for robot in sorted(self.robots, key=lambda one: one.name):
            ward = Ward(robot, self.cluster, self.world, self.check)
            ward.live = ward.read()
            if any(item["metadata"]["namespace"] == robot.namespace for item in ward.live.deployments):
                self.wards.append(ward)
        for ward in self.wards if not self.check else ():
            self._claims.enter_context(ward.cluster.claim(ward.robot.namespace))
            ward.live = ward.read()  # the run that had it may have changed it just now

    def hold(self) -> None:
        """Wait until all robots rest at the same time."""
        self._record()
        settings, now = self.settings, self.clock.now()
        since = settings.since.get(self.name, now)
        seconds = settings.busy_timeout if settings.on_busy == "wait" and not self.check else 0.0
        wards = [ward for ward in self.wards if ward.calm and (settings.on_busy != "force" or self.check)]
        rests = [Rest(ward, seconds, since) for ward in wards]
        self.rests = rests
        while True:
            began = self.clock.now()
            for ward, rest in zip(wards, rests, strict=True):
                look = None if settings.look_timeout is None else settings.look_timeout - (self.clock.now() - now)
                self._rest(ward, rest, look if look is None else max(look, 0.0))
            if len(wards) < 2 or self.check or self.clock.now() - began < HOLD_SECONDS - SLICE:
                return
            # what was held first has been let go by its keeper meanwhile
            if self.clock.now() >= since + seconds:
                raise BusyError(f"{', '.join(ward.robot.name for ward in wards)} were not idle at the same time")

    def _record(self) -> None:
        """What each robot's graph is now, and has to be again; of a change that was cut off, what it was before."""
        for ward in self.wards:
            if self.work.unproven and not self.check:
                ward.recall(self.node)
            try:
                ward.record()
            except (AwayError, CancelledError):
                raise
            except FleetError as error:
                # what the change has done to it is seen by the proof, and it is taken back
                if self.settings.on_busy != "force" and ward.contract is None:
                    raise
                self.say(f"the graph of {ward.robot.name} cannot be read, and is not waited for: {error}")

    def _rest(self, ward: Ward, rest: Rest, look: float | None) -> None:
        name, policy = ward.robot.name, self.settings.on_busy
        seen = rest.idle(ward.calm, f"{self.name} waits until {name} is idle", look)
        if seen.verdict == FAIL:
            raise NotReadyError(f"it cannot be seen whether {name} is idle: {seen.reason}")
        if self.check:
            self.say(f"{self.name}: {name} is {'idle now' if seen.verdict == PASS else f'busy now: {seen.reason}'}")
        # in check mode nobody has waited: what would be waited for is no reason against the change
        if seen.verdict != PASS and not (self.check and policy != "defer"):
            raise BusyError(f"{name}: {seen.reason}")

    # --- the change -------------------------------------------------------------------------------------------------

    def apply(self) -> None:
        if self.check:
            return
        for ward in self.wards:
            ward.keep(self.node)
        self._confirm()
        self.begun = True  # from the first moment on
        self.work.make()

    def _confirm(self) -> None:
        """That the robots are this run's still, and what the kubelet says just before the change; KubeError."""
        if self.cluster:
            self.cluster.confirm()
        if self.cluster and self.node:
            self._beat = self.cluster.beat(self.node)

    def verify(self) -> None:
        """By the change's own word, by the node and its Deployments, by the graphs; NotReadyError says what is not."""
        self.work.works()
        end = self.clock.now() + self.settings.ready_timeout
        if self.cluster and self.node:
            self._patiently(end, functools.partial(self._heard_anew, self.cluster))
            self._patiently(end, functools.partial(self._rolled_out, self.cluster, end))
        for ward in self.wards:
            self._patiently(end, functools.partial(ward.as_recorded, self.settings.verify_seconds))
        self.work.proven()
        for ward in self.wards:
            ward.forget(self.node)

    def _heard_anew(self, cluster: Cluster) -> None:
        """The API's word on a node may be older than the change: only a kubelet that says something new is up."""
        if cluster.beat(self.node) == self._beat:
            raise NotReadyError(f"node {self.node}: its kubelet has not been heard of since")

    def _rolled_out(self, cluster: Cluster, end: float) -> None:
        node = {"apiVersion": "v1", "kind": "Node", "metadata": {"name": self.node}}
        there = [item for ward in self.wards for item in ward.available()]
        cluster.wait([node, *there], max(end - self.clock.now(), 0.0))

    def _patiently(self, end: float, look: Callable[[], None]) -> None:
        """Again and again until it is well or the time is over; what was seen last is the error."""
        said = self.clock.now()
        while True:
            try:
                return look()
            except (KubeError, NotReadyError) as error:
                if self.clock.now() >= end:
                    raise NotReadyError(str(error)) from error
                if self.clock.now() - said >= SLICE:
                    said = self.clock.now()
                    self.say(f"{self.name}: not yet proven: {error}")
                self.clock.sleep(PAUSE)

    def back(self) -> None:
        self.say(f"{self.name}: it is taken back")
        with self.phase("rollback"):
            with contextlib.suppress(KubeError):  # the API may be what the change has broken
                self._confirm()
            self.work.undo()
            self.verify()


@dataclass(frozen=True)
class HostContract:
    """What a robot was before a change of its host, as JSON has it."""

    conditions: Object  # options of ros_ready
    versions: Mapping[str, str]  # Deployment -> its hash
    well: Sequence[str]  # Deployments that were available


class Ward(Hands):
    """A robot that works on a host which is changed.

    `contract` is what the robot has to be after the change; None where nobody has recorded it.
    """

    contract: HostContract | None = None
    calm = Calm()  # what has to be seen of it before

    def recall(self, node: str) -> None:
        """The contract of a change that nobody has proven, if the same versions run still.

        A step that changed an app since has proven it by what it was, and its nodes may have new names.
        """
        kept = [item for item in self.live.maps if item["metadata"]["name"] == contract_name(node)]
        for item in kept:
            found = HostContract(**json.loads(item["data"][CONTRACT]))
            if found.versions == _versions(self.live.deployments):
                self.contract = found

    def record(self) -> None:
        """Its graph as it is now; RosError."""
        graph = self.host.graph(self.master)
        nodes = own_nodes(graph, self.robot)
        self.calm = Calm(actions_to_rest(graph, nodes), wanted_before(self.robot), self.robot.windows)
        if self.contract is None:
            there = self.live.deployments
            self.contract = HostContract(conditions(graph, nodes), _versions(there), _well(there))

    def keep(self, node: str) -> None:
        """Lay the contract down for the next run; KubeError."""
        if self.contract is not None:
            data = {CONTRACT: json.dumps(dataclasses.asdict(self.contract), sort_keys=True)}
            labels = owner_labels(self.robot.name)
            self.apply_all([config_map(contract_name(node), self.robot.namespace, labels, data)])

    def forget(self, node: str) -> None:
        """It was fulfilled. One that stays is asked for by nobody: no change is unproven then."""
        with contextlib.suppress(FleetError):
            self.cluster.delete([config_map(contract_name(node), self.robot.namespace, {}, {})])

    def available(self) -> list[Object]:
        """The robot's Deployments that were well before the change. The proof asks for no others."""
        there = self.live.deployments
        return [item for item in there if _key(item) in (self.contract.well if self.contract else _well(there))]

    def as_recorded(self, stable: float) -> None:
        """One look whether its graph is what was recorded; NotReadyError."""
        if self.contract is None:
            return
        seen = self.host.ready(self.master, self.contract.conditions, SLICE + stable, stable=stable)
        if seen.verdict != PASS:
            raise NotReadyError(f"the graph of {self.robot.name}: {seen.reason}")


def contract_name(node: str) -> str:
    """Of the ConfigMap of a contract."""
    return f"host-change-{node}" if node else "host-change"


def own_nodes(graph: Graph, robot: Robot) -> list[str]:
    """The robot's nodes but somebody's tools; where it shares a master they are below its name."""
    below = "/" if robot.master.mode == "robot" else f"/{names.ros_name(robot.name)}/"
    return [name for name in graph.names if name.startswith(below) and not is_tool(name)]


def conditions(graph: Graph, nodes: Sequence[str]) -> Object:
    """What these nodes are to the graph. A change of the host is no reason for another rate."""
    found = ros_contract.conditions(ros_contract.record(graph, nodes))
    return {**found, "topics": ros_contract.unstreamed(found["topics"])}


def _key(item: Object) -> str:
    return f"{item['metadata']['namespace']}/{item['metadata']['name']}"


def _versions(deployments: Iterable[Object]) -> dict[str, str]:
    return {
        _key(item): (item["metadata"].get("annotations") or {}).get(names.ANNOTATION_HASH, "") for item in deployments
    }


def _well(deployments: Iterable[Object]) -> list[str]:
    return [_key(item) for item in deployments if _available(item)]


def _available(deployment: Object) -> bool:
    status = deployment.get("status") or {}
    return int(status.get("availableReplicas") or 0) >= int((deployment.get("spec") or {}).get("replicas", 1))
