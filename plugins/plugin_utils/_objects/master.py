# SPDX-License-Identifier: GPL-3.0-or-later
"""The ROS master and the keeper beside it, which outlives it: a Deployment and a Service each. Pure.

The two are never replaced together: the master's record is the keeper's, and the keeper's is the master's. The keeper
goes first, and the master once the new keeper is ready, which it is not before it has read everything.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from typing import Any

from ...module_utils._common.documents import Variables
from ...module_utils._exporter.exporter import PATH
from ...module_utils._step.objects import Object
from ...module_utils._step.update_record import NAME as UPDATES
from .._model import context, names
from .._model.context import Robot
from .._model.formats import quantity_value
from .._model.merge import deep_merge
from .common import (
    ALL,
    FOR_EVER,
    ONE_HEAP,
    PRIORITY,
    RECREATE_STRATEGY,
    annotate,
    cluster_service,
    field_variable,
    harden,
    mount,
    pod_spec,
    variable,
    workload,
)
from .placement import STORAGE, node_selector
from .pod_code import CODE_MOUNT, code_command, code_volume
from .pod_security import CLOSED

# roscore hands -t (socket time-out of the master's calls to nodes, s) and -w (worker threads) on to rosmaster: three
# hung subscribers then delay a new publisher by 0.4 s instead of 12 s. Both flags: `roscore --help` of ros_comm 1.15.
ROSCORE = ["roscore", "-p", str(names.MASTER_PORT), "-t", "2", "-w", "16"]

# Started means that the master answers its own API, not that its port is open. Standard library only, so that any ROS
# image will do. getSystemState takes the lock that registrations take: a master that is stuck does not pass.
PROBE = f"""\
import socket, sys, xmlrpc.client
socket.setdefaulttimeout(2)
master = xmlrpc.client.ServerProxy("http://127.0.0.1:{names.MASTER_PORT}")
sys.exit(0 if master.getPid("/rosops_probe")[0] == 1 and master.getSystemState("/rosops_probe")[0] == 1 else 1)"""
UNTIL = 'until python3 -I -S -c "$0"; do sleep 0.2; done'

# Measured with ros_comm 1.15: 75 MB before a node has registered. No limits: a master does not choose whom it serves.
MASTERS = {"requests": {"cpu": "20m", "memory": "96Mi"}}
ROS_HOME = "/tmp/ros"  # noqa: S108 - the container's: whoever runs it may write its logs and process id there
# a keeper beside an external master, whose registrations are not ours; and one of a robot without ROS
KEEPS_NOTHING = {"external": ["--keep", "off"], "none": ["--keep", "none"]}
RECORD_DIR, RECORD_SIZE = "/var/lib/rosops-fleet", "64Mi"
# Measured with ten nodes, and scraped: 0.4 % of a core and 25 MB; there is room for a hundred and for held goals.
KEEPERS = {"requests": {"cpu": "10m", "memory": "32Mi"}, "limits": {"memory": "192Mi"}}

UPDATES_DIR = "/etc/rosops-fleet/updates"
CLAIMS_DIR = "/var/lib/rosops-fleet/claims"
# Only with claims, mounted read-only: apps' directories may be closed to others. Not DAC_READ_SEARCH, which sounds like
# less but opens files by handle, those outside of the mount, too.
SEE_ALL = "DAC_OVERRIDE"


def master_objects(robot: Robot) -> list[Object]:
    """`ros_core_objects` and `keeper_objects`: all of the robot's ROS master, as a robot that runs nothing gets it."""
    return [*ros_core_objects(robot), *keeper_objects(robot)]


def ros_core_objects(robot: Robot) -> list[Object]:
    """Deployment and Service `ros-master`, in the robot's namespace or in `fleet`; nothing where none of ours is."""
    if not robot.master.ours:
        return []
    return _served(robot, plain_master(robot), robot.master.overrides, names.MASTER_PORT)


def keeper_objects(robot: Robot) -> list[Object]:
    """Deployment and Service of the keeper; also beside an external master, which is in no pod."""
    return _served(robot, plain_keeper(robot), robot.master.keeper_overrides, names.KEEPER_PORT)


def plain_master(robot: Robot) -> Object:
    """The Deployment before the overrides."""
    container = {
        "name": names.MASTER_CONTAINER,
        "image": robot.master.image,
        "imagePullPolicy": "IfNotPresent",
        "args": ROSCORE,
        # no ROS_MASTER_URI: roscore's own rosout would wait for a Service that waits for this pod to be ready
        "env": [field_variable("ROS_IP", "status.podIP"), variable("ROS_HOME", ROS_HOME)],
        "ports": [{"name": "xmlrpc", "containerPort": names.MASTER_PORT, "protocol": "TCP"}],
        "resources": MASTERS,
        # A hook and no probes: nothing asks it later. The keeper does so all the time, and a restart would lose every
        # registration, which is worse than a slow answer.
        "lifecycle": {"postStart": {"exec": {"command": ["sh", "-c", UNTIL, PROBE]}}},
    }
    return _with_the_master(robot, names.MASTER_NAME, container, [], {}, terminationGracePeriodSeconds=30)


def plain_keeper(robot: Robot) -> Object:
    """The Deployment before the overrides. Whichever robot that of a shared master comes from, it is the same."""
    command = [*code_command("keeper"), "--record", RECORD_DIR]
    master = [variable("ROS_MASTER_URI", context.master_uri(robot))] if robot.master.mode != "none" else []
    # outlives the container and the host's reboots, and goes with the pod, as do the addresses that it knows
    record = {"name": "record", "emptyDir": {"sizeLimit": RECORD_SIZE}}
    updates = {"name": "updates", "configMap": {"name": UPDATES, "optional": True}}  # made by the first update
    volumes = [code_volume(), record, updates]
    mounts = [CODE_MOUNT, mount("record", RECORD_DIR), mount("updates", UPDATES_DIR, read_only=True)]
    # asked of its server, which answers while its look at the master goes on: no process, next to no CPU
    probe = {"httpGet": {"path": "/ready", "port": names.KEEPER_PORT}, "timeoutSeconds": 5}
    container: Object = {
        "name": names.KEEPER_NAME,
        "image": robot.master.image,
        "imagePullPolicy": "IfNotPresent",
        "command": command,
        "env": [*master, field_variable("ROS_IP", "status.podIP"), ONE_HEAP],
        "ports": [{"name": "xmlrpc", "containerPort": names.KEEPER_PORT, "protocol": "TCP"}],
        "resources": KEEPERS,
        "volumeMounts": mounts,
        # until it has read the whole graph, for which its master has to be there
        "startupProbe": {**probe, "periodSeconds": 1, "failureThreshold": FOR_EVER},
        "readinessProbe": {**probe, "periodSeconds": 10, "failureThreshold": 3},
    }
    if not robot.master.ours:
        command += KEEPS_NOTHING[robot.master.mode]
    elif not robot.master.goal_forwarding:
        command += ["--goal-forwarding", "off"]
    if capacities := _capacities(robot):
        command += ["--claims", CLAIMS_DIR, "--namespace", robot.namespace, "--capacities", json.dumps(capacities)]
        # as the storage class itself would make it, should there be no claim on this host yet
        volumes.append({"name": "claims", "hostPath": {"path": STORAGE, "type": "DirectoryOrCreate"}})
        mounts.append(mount("claims", CLAIMS_DIR, read_only=True))
        container["securityContext"] = {"capabilities": {"add": [SEE_ALL]}}
    seen = context.master_owner(robot) is None or robot.observability.ros_metrics
    found = {"scrape": "true", "port": str(names.KEEPER_PORT), "path": PATH} if seen else {}
    notes = {f"prometheus.io/{key}": value for key, value in found.items()}
    account = {"serviceAccountName": names.KEEPER_NAME, "automountServiceAccountToken": True}
    pod = {"terminationGracePeriodSeconds": 10, **account}
    return _with_the_master(robot, names.KEEPER_NAME, container, volumes, notes, **pod)


def _capacities(robot: Robot) -> dict[str, int]:
    """Bytes that each claim asks for, of those that the keeper looks at; one of a shared master sees none."""
    seen = robot.observability.enabled and robot.observability.ros_metrics
    if context.master_owner(robot) is None or robot.pod_security in CLOSED or not seen:
        return {}
    sizes = {names.claim_name(claim.name): quantity_value(str(claim.size)) for claim in robot.volumes}
    return {name: int(size) for name, size in sorted(sizes.items()) if size is not None}


def _with_the_master(
    robot: Robot, name: str, container: Object, volumes: Sequence[Object], notes: Variables, **pod: Any
) -> Object:
    """The Deployment of a pod that is where the robot's ROS master is.

    One goes before the next comes: two masters would split the graph, and two keepers would each forward the goals that
    they hold, and show every series twice.
    """
    where = node_selector(robot.master.placement, robot.name, name in robot.old_labels)
    pod |= {} if robot.master.mode == "external" else {"priorityClassName": PRIORITY}
    spec = pod_spec([container], volumes, robot.pull_secrets, nodeSelector=where, **pod)
    namespace, owner = context.master_namespace(robot), context.master_owner(robot)
    return workload(name, namespace, owner, spec, notes, RECREATE_STRATEGY)


def _served(robot: Robot, plain: Object, overrides: Variables, port: int) -> list[Object]:
    """A Deployment with its overrides, and its Service. Our own code gets no more of its host than it asks for."""
    deployment = deep_merge(plain, overrides)
    ours = {container["name"] for container in plain["spec"]["template"]["spec"]["containers"]}
    pod = deployment["spec"]["template"]["spec"]
    for container in pod["containers"]:
        if container["name"] in ours:
            harden(container, ALL, pod)
    annotate(deployment["spec"]["template"])
    service = cluster_service(plain, port, robot.master.addresses.get(plain["metadata"]["name"]))
    return [annotate(deployment), service]
