# SPDX-License-Identifier: GPL-3.0-or-later
"""Names that Kubernetes and ROS must agree on, each made in one place only."""

from __future__ import annotations

from ...module_utils._step import words
from ...module_utils._step.record import record_name

MANAGER = words.MANAGER
FLEET_NAMESPACE = words.FLEET
OBSERVABILITY = "observability"  # the namespace of what watches a cluster
MASTER_NAME = words.MASTER
MASTER_PORT = 11311
MASTER_CONTAINER = "ros-master-container"  # as in the dissertation's manifest, whose overrides keep working
APP_CONTAINER = words.CONTAINER
LABEL_ROBOT = words.ROBOT
LABEL_APP = words.APP
LABEL_REVISION = words.REVISION
LABEL_PLACEMENT = "deploymentType"
# Of Nodes. A kubelet cannot set these on its own one (NodeRestriction), but LABEL_ROBOT and LABEL_PLACEMENT, which are
# there for versions of 1.0 and for users' own pods.
NODE_ROBOT = "node-restriction.kubernetes.io/rosops-robot"
NODE_PLACEMENT = "node-restriction.kubernetes.io/rosops-placement"
NODE_TAINTS = "node-restriction.kubernetes.io/rosops-taints"
LABEL_HOST_ACCESS = "rosops.fleet/edge-host-access"  # on a namespace: its pods may have hosts that are not its robot's
LABEL_FILES = "rosops.fleet/files"  # on a ConfigMap of an app's files: the app. No version changes it
LABEL_KEPT = words.KEPT
ANNOTATION_HASH = words.HASH
ANNOTATION_NODE = words.NODE
NODE_NAME_ENV = "ROSOPS_NODE_NAME"
SETTINGS_ENV = "ROSOPS_SETTINGS"
REVISION_ENV = "ROSOPS_REVISION"
TEMPLATE_ENV = "ROSOPS_TEMPLATE_HASH"
CODE_NAME = "rosops-code"  # the ConfigMap of what runs in pods, and the volume of it
CODE_DIR = "/opt/rosops-fleet/hooks"
SIDECAR = "hooks"  # the container beside the app's where its image has no Python
KEEPER_NAME = words.KEEPER
KEEPER_PORT = words.KEEPER_PORT
EXPORTER_NAME = "ros-exporter"  # of earlier collections; its keeper does its work, and an update takes it away
IDENTITY, OUTCOMES = "rosops-fleet", "rosops-outcomes"  # ConfigMaps of kube-system: whose it is; what became of hosts
update_name = record_name


def robot_namespace(robot: str) -> str:
    """The Kubernetes namespace of a robot: `robot-<inventory name>`."""
    return f"robot-{robot}"


def ros_name(name: str) -> str:
    """A DNS label as a ROS name: ROS knows no dash (wiki ROS/Names)."""
    return name.replace("-", "_")


def claim_name(volume: str) -> str:
    """The claim of a volume, named as in the dissertation: `<volume>-pvc`."""
    return f"{volume}-pvc"


def default_mount_path(volume: str) -> str:
    """Where a volume is mounted if nothing is said, as in the dissertation."""
    return f"/mnt/data/{volume}"
