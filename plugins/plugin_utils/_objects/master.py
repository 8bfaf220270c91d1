# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""The ROS master's Deployment and Service, and those of the keeper beside it.

The two are never replaced together: the master's record is the keeper's, and the keeper's is the master's. The keeper
goes first, and the master once the new keeper is ready, which it is not before it has read everything.
"""

from __future__ import annotations

from ...module_utils._step.objects import Object
from .._model import context, names
from .._model.context import Robot
from .common import field_variable, node_selector, pod_spec, workload
from .keeper import keeper_objects
from .security import served

# roscore hands -t (socket time-out of the master's calls to nodes, s) and -w (worker threads) on to rosmaster: three
# hung subscribers then delay a new publisher by 0.4 s instead of 12 s. Both flags: `roscore --help` of ros_comm 1.15.
ROSCORE = ["roscore", "-p", str(names.MASTER_PORT), "-t", "2", "-w", "16"]

# Started means that the master answers its own API, not that its port is open. Standard library only, so that any ROS
# image will do. getSystemState takes the lock that registrations take: a master that is stuck does not pass.
PROBE = (
    """
import socket, sys, xmlrpc.client
socket.setdefaulttimeout(2)
master = xmlrpc.client.ServerProxy("http://127.0.0.1:%d")
sys.exit(0 if master.getPid("/rosops_probe")[0] == 1 and master.getSystemState("/rosops_probe")[0] == 1 else 1)
""".strip()
    % names.MASTER_PORT
)


UNTIL = 'until python3 -I -S -c "$0"; do sleep 0.2; done'


def master_objects(robot: Robot) -> list[Object]:
    """`ros_core_objects` and `keeper_objects`: all of the robot's ROS master, as a robot that runs nothing gets it."""
    return [*ros_core_objects(robot), *keeper_objects(robot)]


def ros_core_objects(robot: Robot) -> list[Object]:
    """Deployment and Service `ros-master`, in the robot's namespace or in `fleet`; nothing for an external master.

    The overrides are the master's alone.
    """
    return served(robot, plain_master(robot), robot.master.overrides, names.MASTER_PORT)


def plain_master(robot: Robot) -> Object:
    """The Deployment before the overrides. Two masters would split the graph: one goes before the next comes."""
    container = {
        "name": names.MASTER_CONTAINER,
        "image": robot.master.image,
        "imagePullPolicy": "IfNotPresent",
        "args": ROSCORE,
        # no ROS_MASTER_URI: roscore's own rosout would wait for a Service that waits for this pod to be ready
        "env": [field_variable("ROS_IP", "status.podIP")],
        "ports": [{"name": "xmlrpc", "containerPort": names.MASTER_PORT, "protocol": "TCP"}],
        # A hook and no probes: nothing asks it later. The keeper does so all the time, and a restart would lose every
        # registration, which is worse than a slow answer.
        "lifecycle": {"postStart": {"exec": {"command": ["sh", "-c", UNTIL, PROBE]}}},
    }
    pod = pod_spec(
        [container],
        pull_secrets=robot.pull_secrets,
        terminationGracePeriodSeconds=30,
        nodeSelector=node_selector(robot.master.placement, robot.name),
    )
    return workload(names.MASTER_NAME, context.master_namespace(robot), context.master_owner(robot), pod)
