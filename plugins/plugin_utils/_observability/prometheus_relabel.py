# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""From what Kubernetes says about a target to the fleet's labels: robot, namespace, app, pod, placement, node. Pure."""

from __future__ import annotations

import re
from typing import Any

from ansible_collections.rosops.fleet.plugins.plugin_utils._model import names
from ansible_collections.rosops.fleet.plugins.plugin_utils._observability.pod_labels import (
    APP_OF_POD,
    ROBOT_OF_NAMESPACE,
)

Rule = dict[str, Any]


def meta_label(kind: str, label: str) -> str:
    """The name under which service discovery gives a label: what no label of Prometheus may have becomes `_`.

    >>> meta_label("pod", "rosops.fleet/robot")
    '__meta_kubernetes_pod_label_rosops_fleet_robot'
    """
    return f"__meta_kubernetes_{kind}_label_{re.sub(r'[^A-Za-z0-9_]', '_', label)}"


def annotation(name: str) -> str:
    """The same for a pod's annotation."""
    return f"__meta_kubernetes_pod_annotation_{re.sub(r'[^A-Za-z0-9_]', '_', name)}"


def take(source: str, target: str) -> Rule:
    """A label's value for another one, where it has one."""
    return {"source_labels": [source], "regex": "(.+)", "target_label": target, "replacement": "$1"}


def of_robot(robot: str) -> list[Rule]:
    """On a robot's own cluster everything is the robot's."""
    return [{"target_label": "robot", "replacement": robot}] if robot else []


def of_pod(robot: str) -> list[Rule]:
    """The labels of a pod's series."""
    return [
        *of_robot(robot),
        take(meta_label("pod", names.LABEL_ROBOT), "robot"),
        take("__meta_kubernetes_namespace", "namespace"),
        take("__meta_kubernetes_pod_name", "pod"),
        # pods of others have no label of ours: then the owner's name, as in their log lines
        {
            "source_labels": ["__meta_kubernetes_pod_name"],
            "regex": plain(APP_OF_POD),
            "target_label": "app",
            "replacement": "$1",
        },
        take(meta_label("pod", names.LABEL_APP), "app"),
        take(meta_label("node", names.LABEL_PLACEMENT), "placement"),
    ]


def of_node(robot: str) -> list[Rule]:
    """The labels of a host's series."""
    return [
        *of_robot(robot),
        take(meta_label("node", names.LABEL_ROBOT), "robot"),
        take(meta_label("node", names.LABEL_PLACEMENT), "placement"),
    ]


def of_container(robot: str) -> list[Rule]:
    """cAdvisor's series say themselves which pod they are about; applied to the metrics, not to the target.

    The target's robot is the host's, and not that of a pod which only happens to run there.
    """
    cleared = [] if robot else [{"source_labels": ["pod"], "regex": ".+", "target_label": "robot", "replacement": ""}]
    return [
        *cleared,
        {
            "source_labels": ["namespace", "pod"],
            "separator": "/",
            "regex": f"{plain(ROBOT_OF_NAMESPACE)}/.+",
            "target_label": "robot",
            "replacement": "$1",
        },
        {"source_labels": ["pod"], "regex": plain(APP_OF_POD), "target_label": "app", "replacement": "$1"},
    ]


def plain(regex: str) -> str:
    """Named groups as numbered ones."""
    return re.sub(r"\(\?P<\w+>", "(", regex)
