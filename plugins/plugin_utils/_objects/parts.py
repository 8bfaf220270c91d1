# SPDX-License-Identifier: GPL-3.0-or-later
"""The parts of a robot in its cluster, the stages of rosops.fleet.site, and what the ROS graph shows then. Pure."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from typing import Any

from ...module_utils._common.documents import Variables
from ...module_utils._ros.names import resolve
from ...module_utils._step.objects import Object
from .._model import context, names
from .._model.app import USUAL, App
from .._model.context import Robot
from .app import app_deployment, app_objects
from .belongings import belongings
from .common import Files
from .master import keeper_objects, master_objects
from .namespace import namespace_objects, pull_secret_objects, storage_objects
from .network import UNKNOWN, Hosts, network_policies
from .placement import is_placed
from .pod_code import code_maps, pod_files
from .pod_settings import full_name, rest_maps
from .rights import keeper_access

NAMESPACE, STORAGE, MASTER, APPS, READY = PARTS = ("namespace", "storage", "master", "apps", "ready")
POLICED = (NAMESPACE, MASTER, APPS)  # with these come the NetworkPolicies

# Read once in Ansible's main process, which imports the actions: the workers of all robots have it then.
CODE = pod_files()


def tagged_parts(parts: Sequence[str], run_tags: Collection[str], skip_tags: Collection[str] = ()) -> tuple[str, ...]:
    """Those of the parts that a run's tags mean: all of them, unless some are named."""
    named = [part for part in parts if part in run_tags] or parts
    return tuple(part for part in named if part not in skip_tags)


def ground_objects(
    robot: Robot, parts: Collection[str], pull_secrets: Sequence[Variables], code: Files, hosts: Hosts = UNKNOWN
) -> list[Object]:
    """What the pods stand on, and what changes without any of them: also a keeper that keeps nothing of a master.

    `pull_secrets` are the items of robot_namespace_pull_secrets, `code` is file name -> content.
    """
    found: list[Object] = []
    if NAMESPACE in parts:
        found += [*namespace_objects(robot), *pull_secret_objects(robot, pull_secrets)]
    elif MASTER in parts:
        found += keeper_access(robot)
    if {*POLICED} & {*parts}:
        found += network_policies(robot, hosts)
    if STORAGE in parts:
        found += storage_objects(robot)
    if MASTER in parts or APPS in parts:
        found += [*code_maps(robot, code), *rest_maps(robot)]
    if APPS in parts:
        found += belongings(robot)
    if MASTER in parts and not robot.master.ours:
        found += keeper_objects(robot)
    return found


def workload_objects(robot: Robot, parts: Collection[str]) -> list[Object]:
    """What runs, with its Services."""
    made = master_objects(robot) if MASTER in parts and robot.master.ours else []
    return [*made, *(app_objects(robot) if APPS in parts else [])]


def images(robot: Robot, placement: str) -> list[str]:
    """The images of the pods of the robot's master and apps that are placed so, sorted."""
    made = [*master_objects(robot), *app_objects(robot)]
    pods = [item["spec"]["template"]["spec"] for item in made if item["kind"] == "Deployment"]
    placed = [pod for pod in pods if is_placed(pod, "local") == (placement == "local")]
    containers = [one for pod in placed for one in (*(pod.get("initContainers") or ()), *pod["containers"])]
    return sorted({one["image"] for one in containers if one.get("image")})


def graph_conditions(robot: Robot) -> dict[str, Any]:
    """Options of ros_ready, every name in full.

    `{nodes, topics, services, actions, absent, timeout, interval, consecutive}`, and `master_uri` for an external
    master only: the address of a master in the cluster is known to the cluster (its Service), not to the inventory.
    """
    lists: dict[str, list[Any]] = {key: [] for key in ("nodes", "topics", "services", "actions", "absent")}
    for app in robot.apps:
        for kind, items in _app_conditions(app, robot).items():
            lists[kind] += [item for item in items if item not in lists[kind]]
    ready = [app.readiness for app in robot.apps] or [USUAL]
    return {
        **lists,
        "timeout": max(item.timeout for item in ready),
        "interval": min(item.interval for item in ready),
        "consecutive": max(item.consecutive for item in ready),
        **({"master_uri": robot.master.uri} if robot.master.mode == "external" else {}),
    }


def _app_conditions(app: App, robot: Robot) -> dict[str, list[Any]]:
    metadata = app_deployment(app, robot)["spec"]["template"]["metadata"]
    # those of a launch file are not promised
    node = metadata["annotations"].get(names.ANNOTATION_NODE) or context.graph_node(app, robot)
    readiness = app.readiness

    def full(name: str) -> str:
        return resolve(full_name(name, app, robot), "/", node)

    kinds = {"topics": readiness.topics, "services": readiness.services, "actions": readiness.actions}
    named = {kind: [{**item, "name": full(item["name"])} for item in items] for kind, items in kinds.items()}
    return {"nodes": [node] if readiness.nodes else [], **named, "absent": [full(name) for name in readiness.absent]}
