# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Names that somebody may write where a fleet's variables stand, and that nothing reads there. Pure."""

from __future__ import annotations

from .._model.finding import Problem, join_path
from .said import Said

# Keys of a Rigelfile; docs/rigel.md has all of them.
RIGEL = {
    "additional_k8s_params": "the keys and overrides of an app in ros_apps; for the master ros_master_overrides",
    "deploy_ros_master": "ros_master_mode, which is robot, shared, or external with ros_master_uri",
    "distributed": "placement of an app in ros_apps, which is local or remote",
    "readiness": "readiness of an app in ros_apps",
    "rolling_update": "pattern or handoff of an app in ros_apps",
    "ros_version": "nothing: an app's image has its ROS, and that is ROS 1; ROS 2 is not served",
}
# Variables of versions before 1.0.0. Those of observability that are keys of its mapping now:
_IN_THE_MAPPING = {
    "enabled": "enabled",
    "prometheus_enabled": "prometheus.enabled",
    "scrape_interval": "prometheus.scrape_interval",
    "evaluation_interval": "prometheus.evaluation_interval",
    "prometheus_retention": "prometheus.retention",
    "loki_enabled": "loki.enabled",
    "loki_retention": "loki.retention",
    "loki_persistence": "loki.persistence.enabled",
    "loki_size": "loki.persistence.size",
    "grafana_enabled": "grafana.enabled",
    "grafana_admin_password": "grafana.admin_password",
    "default_dashboards": "grafana.default_dashboards",
    "grafana_service_type": "grafana.service_type",
    "grafana_persistence": "grafana.persistence.enabled",
    "grafana_size": "grafana.persistence.size",
    "node_exporter": "node_exporter",
    "ros_metrics": "ros_metrics",
}
_IMAGES = ("prometheus", "loki", "grafana", "alertmanager", "node_exporter", "otelcol", "vmagent")
_STORAGE = "nothing: it is /var/lib/rancher/k3s/storage, where another disk may be mounted"
_DROP_IN = "MemoryHigh or MemoryMax in a drop-in of the unit k3s or k3s-agent"
GONE = {
    **{
        f"{role}_{name}": f"update_{name}, which counts for every change of a host"
        for role in ("k3s", "guarded")
        for name in ("on_busy", "busy_timeout", "failure_budget")
    },
    **{f"observability_{name}": f"{key} in the mapping observability" for name, key in _IN_THE_MAPPING.items()},
    **{f"observability_{name}_image": f"observability_images: {{{name}: ...}}" for name in _IMAGES},
    "collect_storage_path": _STORAGE,
    "guarded_name": "nothing: a change is called as the file of its tasks",
    "images_logins": "robot_namespace_pull_secrets",
    "images_needed": "images_refs",
    "k3s_disable": "disable in k3s_config",
    "k3s_memory_high": _DROP_IN,
    "k3s_memory_max": _DROP_IN,
    "node_name": "k3s_node_name",
    "node_ready_timeout": "k3s_start_timeout",
    "observability_alertmanager_enabled": "observability_alertmanager_config: with one Alertmanager runs",
    "observability_claims_path": _STORAGE,
    "preflight_interface": "flannel-iface in k3s_config",
}
INSTEAD = {**RIGEL, **GONE}


def without_refused(variables: Said, path: str, problems: list[Problem]) -> Said:
    """The host's variables but for these, each of which is a problem that says what to write instead."""
    problems += [
        Problem(
            join_path(path, name),
            "is a key of a Rigelfile and has no effect here" if name in RIGEL else "is no variable any more",
            INSTEAD[name],
        )
        for name in variables
        if name in INSTEAD
    ]
    return {name: value for name, value in variables.items() if name not in INSTEAD}
