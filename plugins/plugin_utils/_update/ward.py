# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""A robot that works on a host which is changed: its graph, its rest, and that it is what it was."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from ansible_collections.rosops.fleet.plugins.module_utils._common.errors import NotReadyError
from ansible_collections.rosops.fleet.plugins.module_utils._common.poll import PASS
from ansible_collections.rosops.fleet.plugins.module_utils._ros import contract as ros_contract
from ansible_collections.rosops.fleet.plugins.plugin_utils._model import names
from ansible_collections.rosops.fleet.plugins.plugin_utils._model.context import Robot
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.hands import SLICE, Hands
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.rest import Rest
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.step import actions_to_rest
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.world import Graph, Object


class Ward(Hands):
    """What is known of it. `graph` is None where nobody has recorded it."""

    graph: Graph | None = None
    actions: Sequence[Mapping[str, str]] = ()  # that have to be idle
    rest: Rest | None = None

    def record(self) -> None:
        """Its graph as it is now; RosError."""
        self.graph = self.host.graph(self.master)
        self.actions = actions_to_rest(self.graph, own_nodes(self.graph, self.robot))

    def available(self) -> list[Object]:
        """Its Deployments that were well: what was not well before the change is none of its proof."""
        return [item for item in self.live.deployments if _available(item)]

    def as_recorded(self, stable: float) -> None:
        """One look whether its graph is what was recorded; NotReadyError."""
        if self.graph is None:
            return
        wanted = conditions(self.graph, own_nodes(self.graph, self.robot))
        seen = self.host.ready(self.master, wanted, SLICE + stable, stable=stable)
        if seen.verdict != PASS:
            raise NotReadyError(f"the graph of {self.robot.name}: {seen.reason}")


def own_nodes(graph: Graph, robot: Robot) -> list[str]:
    """The robot's nodes but somebody's tools; where it shares a master they are below its name."""
    below = "/" if robot.master.mode == "robot" else f"/{names.ros_name(robot.name)}/"
    return [name for name in sorted(graph["nodes"]) if name.startswith(below) and not ros_contract.is_tool(name)]


def conditions(graph: Graph, nodes: Sequence[str]) -> Object:
    """What these nodes are to the graph. A change of the host is no reason for another rate."""
    found = ros_contract.conditions(ros_contract.record(graph, nodes))
    return {**found, "topics": [{key: topic[key] for key in topic if key != "min_rate"} for topic in found["topics"]]}


def _available(deployment: Object) -> bool:
    status = deployment.get("status") or {}
    return int(status.get("availableReplicas") or 0) >= int((deployment.get("spec") or {}).get("replicas", 1))
