# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Names and ports of the observability stack, each made in one place only."""

from __future__ import annotations

NAMESPACE = "observability"
PROMETHEUS = "prometheus"
LOKI = "loki"
GRAFANA = "grafana"
ALERTMANAGER = "alertmanager"
NODE_EXPORTER = "node-exporter"
SHIPPER = "log-shipper"
VMAGENT = "vmagent"
ROS_EXPORTER = "ros-exporter"

PORTS = {
    PROMETHEUS: 9090,
    LOKI: 3100,
    GRAFANA: 3000,
    ALERTMANAGER: 9093,
    NODE_EXPORTER: 9100,
    SHIPPER: 8888,
    VMAGENT: 8429,
}
HTTP = "http"  # the name of every such port, in Services and containers

ADMIN_SECRET = "grafana-admin"  # noqa: S105 - the name of a Secret
ANNOTATION_CONFIG = "rosops.fleet/config-hash"

ROBOT = "robot"
HUB = "hub"

# What may end up on the cluster: what a profile, or a switch, no longer wants is taken away.
WORKLOADS = {
    PROMETHEUS: "Deployment",
    LOKI: "Deployment",
    GRAFANA: "Deployment",
    ALERTMANAGER: "Deployment",
    VMAGENT: "Deployment",
    NODE_EXPORTER: "DaemonSet",
    SHIPPER: "DaemonSet",
}


# The addresses of the stack's Services inside the cluster.
URLS = {name: f"http://{name}.{NAMESPACE}:{port}" for name, port in PORTS.items()}
