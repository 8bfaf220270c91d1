# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""The keeper's Deployment and Service: beside each ROS master that is ours, what outlives it. Pure."""

from __future__ import annotations

from ...module_utils._step.objects import Object
from .._model import context, names
from .._model.context import Robot
from .common import FOR_EVER, ONE_HEAP, field_variable, mount, node_selector, pod_spec, variable, workload
from .pod_code import code_command, code_mount, code_volume
from .security import served

RECORD_VOLUME = "record"
RECORD_DIR = "/var/lib/rosops-fleet"
RECORD_SIZE = "64Mi"
# Measured with 20 nodes: 0.3 % of a core and 24 MB; the limits leave room for a hundred and for held goals.
RESOURCES = {"requests": {"cpu": "10m", "memory": "32Mi"}, "limits": {"memory": "128Mi"}}


def keeper_objects(robot: Robot) -> list[Object]:
    """Deployment and Service of the keeper; nothing for an external master."""
    return served(robot, plain_keeper(robot), robot.master.keeper_overrides, names.KEEPER_PORT)


def plain_keeper(robot: Robot) -> Object:
    """The Deployment before the overrides."""
    pod = pod_spec(
        [_container(robot)],
        # outlives the container and the host's reboots, and goes with the pod, as do the addresses that it knows
        [code_volume(), {"name": RECORD_VOLUME, "emptyDir": {"sizeLimit": RECORD_SIZE}}],
        robot.pull_secrets,
        terminationGracePeriodSeconds=10,
        serviceAccountName=names.KEEPER_NAME,
        automountServiceAccountToken=True,
        nodeSelector=node_selector(robot.master.placement, robot.name),
    )
    # two keepers would each forward the goals that they hold: one goes before the next comes
    return workload(names.KEEPER_NAME, context.master_namespace(robot), context.master_owner(robot), pod)


def _container(robot: Robot) -> Object:
    # asked of its XML-RPC server, which answers while its look at the master goes on: no process, next to no CPU
    probe = {"httpGet": {"path": "/ready", "port": names.KEEPER_PORT}, "timeoutSeconds": 5}
    forwarding = () if robot.master.goal_forwarding else ("--goal-forwarding", "off")
    return {
        "name": names.KEEPER_NAME,
        "image": robot.master.image,
        "imagePullPolicy": "IfNotPresent",
        "command": [*code_command("keeper"), "--record", RECORD_DIR, *forwarding],
        "env": [
            variable("ROS_MASTER_URI", context.master_uri(robot)),
            field_variable("ROS_IP", "status.podIP"),
            ONE_HEAP,
        ],
        "ports": [{"name": "xmlrpc", "containerPort": names.KEEPER_PORT, "protocol": "TCP"}],
        "resources": RESOURCES,
        "volumeMounts": [code_mount(), mount(RECORD_VOLUME, RECORD_DIR)],
        # until it has read the whole graph, for which its master has to be there
        "startupProbe": {**probe, "periodSeconds": 1, "failureThreshold": FOR_EVER},
        "readinessProbe": {**probe, "periodSeconds": 10, "failureThreshold": 3},
    }
