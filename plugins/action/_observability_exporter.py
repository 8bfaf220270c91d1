# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""For the role observability: apply the exporter beside a robot's ROS master."""

from __future__ import annotations

from typing import Any, Mapping

from ansible_collections.rosops.fleet.plugins.plugin_utils._action.cluster import ClusterAction, foreseen, written
from ansible_collections.rosops.fleet.plugins.plugin_utils._action.variables import role_variables
from ansible_collections.rosops.fleet.plugins.plugin_utils._objects.code_files import exporter_files
from ansible_collections.rosops.fleet.plugins.plugin_utils._objects.common import Object
from ansible_collections.rosops.fleet.plugins.plugin_utils._objects.exporter import Settings, exporter_objects


class ActionModule(ClusterAction):
    def work(self, params: Mapping[str, Any], known: dict[str, Any]) -> dict[str, Any]:
        with self.cluster(params) as kube:
            return written(kube.apply(self._objects(known), self._task.check_mode))

    def foresee(self, _params: Mapping[str, Any], known: dict[str, Any]) -> dict[str, Any]:
        return foreseen(self._objects(known))

    def _objects(self, known: Mapping[str, Any]) -> list[Object]:
        variables = role_variables("observability", self._templar, known)
        settings = Settings(
            statistics=variables["observability_ros_statistics"], claims_path=variables["observability_claims_path"]
        )
        return exporter_objects(self.robot(known), exporter_files(), settings)
