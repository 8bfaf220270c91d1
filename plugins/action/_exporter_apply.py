# SPDX-License-Identifier: GPL-3.0-or-later
"""For the role observability: the ROS exporter beside a robot's master."""

from __future__ import annotations

from ..module_utils._common.documents import Arguments, Result, Variables
from ..module_utils._step.objects import Object
from ..plugin_utils._action.cluster import ClusterAction, foreseen, written
from ..plugin_utils._model.context import Robot, master_namespace
from ..plugin_utils._model.fleet import robot_from_vars
from ..plugin_utils._objects.code_files import exporter_files
from ..plugin_utils._objects.exporter import exporter_objects
from ..plugin_utils._update.addresses import located
from ..plugin_utils._update.cluster import live_in


class ActionModule(ClusterAction):
    """No app needs the exporter, so a changed exporter is restarted at once, without a gate."""

    def work(self, params: Arguments, known: Variables) -> Result:
        with self.cluster(params, known) as kube:
            robot = robot_from_vars(known)
            there = located(robot, live_in(kube, [master_namespace(robot)]))
            return written(kube.apply(_objects(there), self._task.check_mode))

    def foresee(self, _params: Arguments, known: Variables) -> Result:
        return foreseen(_objects(robot_from_vars(known)))


def _objects(robot: Robot) -> list[Object]:
    # a directory of the host is more than these levels allow
    closed = robot.pod_security in ("baseline", "restricted")
    return exporter_objects(robot, exporter_files(), claims=not closed)
