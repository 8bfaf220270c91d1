# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""A robot that works on a host which is changed: its graph, its rest, and that it is what it was."""

from __future__ import annotations

import contextlib
import dataclasses
import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

from ansible_collections.rosops.fleet.plugins.module_utils._common.errors import FleetError, NotReadyError
from ansible_collections.rosops.fleet.plugins.module_utils._common.poll import PASS
from ansible_collections.rosops.fleet.plugins.module_utils._ros import contract as ros_contract
from ansible_collections.rosops.fleet.plugins.module_utils._step.words import CONTRACT
from ansible_collections.rosops.fleet.plugins.plugin_utils._model import names
from ansible_collections.rosops.fleet.plugins.plugin_utils._model.context import Robot
from ansible_collections.rosops.fleet.plugins.plugin_utils._objects.common import config_map, owner_labels
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.hands import SLICE, Hands
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.plan import wanted_before
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.rest import Rest
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.step import actions_to_rest
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.world import Calm, Graph, Object


class Ward(Hands):
    """What is known of it. `contract` is what it has to be after the change; None where nobody has recorded it.

    The contract lies in the robot's namespace before the change is made, so that a run after one that was killed proves
    the change against what was there before it.
    """

    contract: Contract | None = None
    calm = Calm()  # what has to be seen of it before
    rest: Rest | None = None

    def recall(self, node: str) -> None:
        """The contract of a change that nobody has proven, if the same versions run still.

        A step that changed an app since has proven it by what it was, and its nodes may have new names.
        """
        kept = [item for item in self.live.maps if item["metadata"]["name"] == contract_name(node)]
        for item in kept:
            found = Contract(**json.loads(item["data"][CONTRACT]))
            if found.versions == _versions(self.live.deployments):
                self.contract = found

    def record(self) -> None:
        """Its graph as it is now; RosError."""
        graph = self.host.graph(self.master)
        nodes = own_nodes(graph, self.robot)
        self.calm = Calm(actions_to_rest(graph, nodes), wanted_before(self.robot), self.robot.windows)
        if self.contract is None:
            there = self.live.deployments
            well = [_key(item) for item in there if _available(item)]
            self.contract = Contract(conditions(graph, nodes), _versions(there), well)

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
        well = [_key(item) for item in self.live.deployments if _available(item)]
        return [item for item in self.live.deployments if _key(item) in (self.contract.well if self.contract else well)]

    def as_recorded(self, stable: float) -> None:
        """One look whether its graph is what was recorded; NotReadyError."""
        if self.contract is None:
            return
        seen = self.host.ready(self.master, self.contract.conditions, SLICE + stable, stable=stable)
        if seen.verdict != PASS:
            raise NotReadyError(f"the graph of {self.robot.name}: {seen.reason}")


@dataclass(frozen=True)
class Contract:
    """What a robot was before a change of its host, as JSON has it."""

    conditions: Object  # options of ros_ready
    versions: Mapping[str, str]  # Deployment -> its hash
    well: Sequence[str]  # Deployments that were available


def contract_name(node: str) -> str:
    """Of its ConfigMap."""
    return f"host-change-{node}" if node else "host-change"


def own_nodes(graph: Graph, robot: Robot) -> list[str]:
    """The robot's nodes but somebody's tools; where it shares a master they are below its name."""
    below = "/" if robot.master.mode == "robot" else f"/{names.ros_name(robot.name)}/"
    return [name for name in graph.names if name.startswith(below) and not ros_contract.is_tool(name)]


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


def _available(deployment: Object) -> bool:
    status = deployment.get("status") or {}
    return int(status.get("availableReplicas") or 0) >= int((deployment.get("spec") or {}).get("replicas", 1))
