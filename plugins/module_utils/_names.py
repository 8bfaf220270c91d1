# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Names that Kubernetes and ROS must agree on, each made in one place only."""

from __future__ import annotations

MANAGER = "rosops.fleet"
FLEET_NAMESPACE = "fleet"
MASTER_NAME = "ros-master"
MASTER_PORT = 11311
MASTER_CONTAINER = "ros-master-container"  # the names of the seed's listing 1, so that its overrides keep working
APP_CONTAINER = "ros-app"
LABEL_ROBOT = "rosops.fleet/robot"
LABEL_APP = "rosops.fleet/app"
LABEL_REVISION = "rosops.fleet/revision"
LABEL_PLACEMENT = "deploymentType"
ANNOTATION_HASH = "rosops.fleet/spec-hash"
ANNOTATION_HANDOFF = "rosops.fleet/handoff"
ANNOTATION_NODE = "rosops.fleet/ros-node"
NODE_NAME_ENV = "ROSOPS_NODE_NAME"


def robot_namespace(robot: str) -> str:
    """The Kubernetes namespace of a robot: `robot-<inventory name>`."""
    return f"robot-{robot}"


def ros_name(name: str) -> str:
    """A DNS label as a ROS name: ROS knows no dash (wiki ROS/Names)."""
    return name.replace("-", "_")


def claim_name(volume: str) -> str:
    """The seed's pattern for claims: `<volume>-pvc`."""
    return f"{volume}-pvc"


def default_mount_path(volume: str) -> str:
    """The seed's default mount path of a volume."""
    return f"/mnt/data/{volume}"


def resolve_graph_name(name: str, namespace: str, node: str) -> str:
    """A ROS graph name as the master shows it (wiki ROS/Names, "Resolving").

    >>> resolve_graph_name("temperature", "/robot1", "/robot1/sensor")
    '/robot1/temperature'
    >>> resolve_graph_name("~rate", "/robot1", "/robot1/sensor")
    '/robot1/sensor/rate'
    """
    if name.startswith("/"):
        return name
    if name.startswith("~"):
        return f"{node}/{name[1:].lstrip('/')}"
    return f"{namespace.rstrip('/')}/{name}"
