# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Names that Kubernetes and ROS must agree on, each made in one place only."""

from __future__ import annotations

MANAGER = "rosops.fleet"
FLEET_NAMESPACE = "fleet"
MASTER_NAME = "ros-master"
MASTER_PORT = 11311
MASTER_CONTAINER = "ros-master-container"  # as in the dissertation's manifest, whose overrides keep working
APP_CONTAINER = "ros-app"
LABEL_ROBOT = "rosops.fleet/robot"
LABEL_APP = "rosops.fleet/app"
LABEL_REVISION = "rosops.fleet/revision"
LABEL_PLACEMENT = "deploymentType"
LABEL_FILES = "rosops.fleet/files"  # on a ConfigMap of an app's files: the app. No version changes it
LABEL_KEPT = "rosops.fleet/kept"  # on a ConfigMap of the namespace `fleet`: the shared master's keeper watches over
# the namespace of that name
ANNOTATION_HASH = "rosops.fleet/spec-hash"
ANNOTATION_HANDOFF = "rosops.fleet/handoff"
ANNOTATION_NODE = "rosops.fleet/ros-node"
ANNOTATION_UPDATING = "rosops.fleet/updating"  # on a Deployment while a step changes it: its version is not proven yet
ANNOTATION_WENT_BACK = "rosops.fleet/went-back"  # on one that the keeper took back: JSON of from, to, at, reason
NODE_NAME_ENV = "ROSOPS_NODE_NAME"
SETTINGS_ENV = "ROSOPS_SETTINGS"
REVISION_ENV = "ROSOPS_REVISION"
CODE_NAME = "rosops-code"  # the ConfigMap of what runs in pods, and the volume of it
CODE_DIR = "/opt/rosops-fleet/hooks"
SIDECAR = "hooks"  # the container beside the app's where its image has no Python
KEEPER_NAME = "ros-keeper"
KEEPER_PORT = 11411


def robot_namespace(robot: str) -> str:
    """The Kubernetes namespace of a robot: `robot-<inventory name>`."""
    return f"robot-{robot}"


def ros_name(name: str) -> str:
    """A DNS label as a ROS name: ROS knows no dash (wiki ROS/Names)."""
    return name.replace("-", "_")


def claim_name(volume: str) -> str:
    """The claim of a volume, named as in the dissertation: `<volume>-pvc`."""
    return f"{volume}-pvc"


def update_name(app: str) -> str:
    """The ConfigMap that keeps an app's contract and its earlier versions."""
    return f"{app}-update"


def files_name(app: str, revision: str) -> str:
    """The ConfigMap of an app's files with this content."""
    return f"{app}-files-{revision}"


def default_mount_path(volume: str) -> str:
    """Where a volume is mounted if nothing is said, as in the dissertation."""
    return f"/mnt/data/{volume}"
