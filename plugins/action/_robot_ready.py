# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""For the role ros_app: wait until everything of the robot is rolled out and its ROS graph shows what it promises."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar

from ansible_collections.rosops.fleet.plugins.module_utils._common.errors import KubeError
from ansible_collections.rosops.fleet.plugins.plugin_utils._action.cluster import ClusterAction
from ansible_collections.rosops.fleet.plugins.plugin_utils._action.host import ActionHost
from ansible_collections.rosops.fleet.plugins.plugin_utils._kube.cache import Ref, parse_refs
from ansible_collections.rosops.fleet.plugins.plugin_utils._kube.client import Kube
from ansible_collections.rosops.fleet.plugins.plugin_utils._kube.wait import Settings, wait_for_rollout
from ansible_collections.rosops.fleet.plugins.plugin_utils._model.context import Robot, master_namespace
from ansible_collections.rosops.fleet.plugins.plugin_utils._model.fleet import robot_from_vars
from ansible_collections.rosops.fleet.plugins.plugin_utils._model.names import MASTER_NAME
from ansible_collections.rosops.fleet.plugins.plugin_utils._objects.conditions import graph_conditions
from ansible_collections.rosops.fleet.plugins.plugin_utils._objects.parts import awaited_objects


class ActionModule(ClusterAction):
    """The result is that of ros_ready, and in `rollout` that of the wait before it."""

    _requires_connection = True
    ARGUMENTS: ClassVar = {"timeout": {"type": "float", "default": 300}}

    def work(self, params: Mapping[str, Any], known: dict[str, Any]) -> dict[str, Any]:
        if self._task.check_mode:
            return {"changed": False, "skipped": True, "msg": "check mode made nothing that could be waited for"}
        robot = robot_from_vars(known)
        refs = parse_refs(awaited_objects(robot))
        with self.cluster(params, known) as kube:
            settings = Settings(timeout=params["timeout"], say=self.say(known))
            rollout = wait_for_rollout(kube, refs, settings) if refs else {"objects": [], "elapsed": 0.0}
            conditions = {"master_uri": _master_uri(kube, robot), **graph_conditions(robot)}
        # On the robot's own host: pod and Service addresses are routable there, and its link does not matter.
        found = ActionHost(self, known).module("rosops.fleet.ros_ready", conditions)
        return {**found, "rollout": rollout}


def _master_uri(kube: Kube, robot: Robot) -> str:
    """Where the master is: the Service's address is known to the cluster only."""
    if robot.master.mode == "external":
        return robot.master.uri
    ref = Ref("Service", MASTER_NAME, master_namespace(robot), "v1")
    service = kube.get(ref)
    if service is None:
        raise KubeError(f"The cluster at {kube.host} has no {ref}. Run the stage master of rosops.fleet.site first.")
    return f"http://{service['spec']['clusterIP']}:{service['spec']['ports'][0]['port']}"
