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
import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

from ...module_utils._common.documents import json_of
from ...module_utils._common.errors import FleetError, KubeError, NotReadyError
from ...module_utils._common.poll import PASS
from ...module_utils._ros import contract as ros_contract
from ...module_utils._ros.graph import Graph
from ...module_utils._step.objects import hash_of
from ...module_utils._step.rest import actions_to_rest, nodes_below
from ...module_utils._step.words import CONTRACT
from .._model.context import Robot, own_space, wanted_before
from .._objects.common import config_map, owner_labels
from .change import Change
from .cluster import KubeCluster
from .hands import HOLD_SECONDS, SLICE, BusyError, Hands, Rest, Settings, World
from .outcome import StepResult
from .revisions import key_of
from .world import AwayError, Calm, CancelledError, Object

PAUSE = 1.0  # between two looks at what comes up


class Work:
    """What is to be done to the host. Every method does what it says or raises one of our errors."""

    name: str
    node: str  # of the host in its cluster
    before = ""  # what an operator reads of what is there
    after = ""  # of what is to come; the same as `before` where only settings change
    unproven: bool  # whether what is there was made by a run that ended before it was proven
    left: str  # what a run leaves that can neither prove it nor go back

    def make(self) -> None:
        """Do it. After an error some of it may be done."""

    def works(self) -> None:
        """Wait until what was changed serves by its own word; NotReadyError."""

    def undo(self) -> None:
        """The way back, whatever part of the work was done."""

    def proven(self) -> None:
        """What is there now has been proven, and is what a later change goes back to."""


class HostChange(Change):
    """Of a host where these `robots` may work. Without its cluster nobody can be asked who does."""

    where = "host"

    def __init__(
        self,
        work: Work,
        settings: Settings,
        world: World,
        cluster: KubeCluster | None = None,
        robots: Sequence[Robot] = (),
    ) -> None:
        self.work, self.world, self.left, self.node = work, world, work.left, work.node
        self.cluster, self.robots = cluster, robots
        self.wards: list[Ward] = []
        self._beat = ""  # the kubelet's last word before the change
        self._claims = contextlib.ExitStack()
        new = {"image": work.after, "revision": "settings" if work.before == work.after else ""}
        before, after = {work.name: {"image": work.before}}, {work.name: new}
        told = StepResult("", work.name, (work.name,), "replace", before, after)
        super().__init__(self.node, told, settings, world)

    def take(self) -> StepResult:
        """The claims end when nothing is held any more."""
        with self._claims:
            return super().take()

    # --- before -----------------------------------------------------------------------------------------------------

    def gate(self) -> None:
        """See who works here, and be the only run that changes these robots."""
        self.world.host.there()
        if self.cluster is None:
            return
        for robot in sorted(self.robots, key=lambda one: one.name):
            ward = Ward(robot, self.settings, self.cluster, self.world)
            ward.live = ward.read()
            if any(item["metadata"]["namespace"] == robot.namespace for item in ward.live.deployments):
                self.wards.append(ward)
        for ward in self.wards if not self.check else ():
            self._claims.enter_context(self.cluster.claim(ward.robot.namespace))
            ward.live = ward.read()  # the run that had it may have changed it just now

    def hold(self) -> None:
        """Wait until all robots rest at the same time."""
        self._record()
        settings, now = self.settings, self.clock.now
        first, since = now(), settings.since.get(self.name, now())
        resting = {ward: Rest(ward, settings.on_busy, since) for ward in self.wards}
        resting = {ward: rest for ward, rest in resting.items() if rest.needed(ward.calm)}
        self.rests = [*resting.values()]
        while True:
            began = now()
            for ward, rest in resting.items():
                rest.look = settings.look_timeout and max(settings.look_timeout - (now() - first), 0.0)
                rest.begin(ward.calm, self.name, ward.robot.name)
            if len(resting) < 2 or self.check or now() - began < HOLD_SECONDS - SLICE:
                return
            # what was held first has been let go by its keeper meanwhile
            if not any(rest.patient for rest in self.rests):
                robots = ", ".join(ward.robot.name for ward in resting)
                raise BusyError(f"{robots} were not idle at the same time")

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
            self._beat = self.cluster.beat(self.node)

    def verify(self) -> None:
        """By the change's own word, by the node and its Deployments, by the graphs; NotReadyError says what is not."""
        self.work.works()
        end = self.clock.now() + self.settings.ready_timeout
        said = self.clock.now()
        while True:  # what was seen last is the error
            try:
                self._look(end)
                break
            except (KubeError, NotReadyError) as error:
                if self.clock.now() >= end:
                    raise NotReadyError(str(error)) from error
                if self.clock.now() - said >= SLICE:
                    said = self.clock.now()
                    self.say(f"{self.name}: not yet proven: {error}")
                self.clock.sleep(PAUSE)
        self.work.proven()
        for ward in self.wards:
            ward.forget(self.node)

    def _look(self, end: float) -> None:
        """Once, whether all is there again; KubeError, NotReadyError."""
        if self.cluster:
            # the API's word on a node may be older than the change: only a kubelet that says something new is up
            if self.cluster.beat(self.node) == self._beat:
                raise NotReadyError(f"node {self.node}: its kubelet has not been heard of since")
            node = {"apiVersion": "v1", "kind": "Node", "metadata": {"name": self.node}}
            there = [item for ward in self.wards for item in ward.available()]
            self.cluster.wait([node, *there], max(end - self.clock.now(), 0.0))
        for ward in self.wards:
            ward.as_recorded()

    def finish(self) -> StepResult:
        self.release()
        return super().finish()

    def back(self) -> None:
        self.say(f"{self.name}: it is taken back")
        self.phase("rollback")
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

        A step that changed an app since has proven it by what it was, and its nodes may have new names. What cannot be
        read there is not there.
        """
        for item in self.live.maps:
            if item["metadata"]["name"] == contract_name(node):
                with contextlib.suppress(LookupError, TypeError, ValueError):
                    said = json_of(item["data"][CONTRACT])
                    found = HostContract(dict(said["conditions"]), dict(said["versions"]), list(said["well"]))
                    if found.versions == self._versions():
                        self.contract = found

    def record(self) -> None:
        """Its graph as it is now; RosError."""
        self.learn(self.host.graph(self.master))
        nodes = nodes_below(self.graph, own_space(self.robot))
        self.calm = Calm(actions_to_rest(self.graph, nodes), wanted_before(self.robot), self.robot.windows)
        if self.contract is None:
            well = [_name(item) for item in self.live.deployments if _available(item)]
            self.contract = HostContract(conditions(self.graph, nodes), self._versions(), well)

    def _versions(self) -> dict[str, str]:
        return {_name(item): hash_of(item) for item in self.live.deployments}

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
        there, kept = self.live.deployments, self.contract
        return [item for item in there if (_name(item) in kept.well if kept else _available(item))]

    def as_recorded(self) -> None:
        """One look whether its graph is what was recorded; NotReadyError."""
        if self.contract is None:
            return
        stable = self.settings.verify_seconds
        seen = self.host.ready(self.master, self.contract.conditions, SLICE + stable, stable=stable)
        if seen.verdict != PASS:
            raise NotReadyError(f"the graph of {self.robot.name}: {seen.reason}")


def contract_name(node: str) -> str:
    return f"host-change-{node}"


def conditions(graph: Graph, nodes: Iterable[str]) -> Object:
    """What these nodes are to the graph. A change of the host is no reason for another rate."""
    return ros_contract.unstreamed(ros_contract.conditions(ros_contract.record(graph, [*nodes])))


def _name(item: Object) -> str:
    return "/".join(key_of(item))


def _available(deployment: Object) -> bool:
    status = deployment.get("status") or {}
    return int(status.get("availableReplicas") or 0) >= int((deployment.get("spec") or {}).get("replicas", 1))
