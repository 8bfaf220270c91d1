# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""JSON Schema of those of the observability stack's variables whose form matters; see _schema for the rest."""

from __future__ import annotations

from typing import Any, Mapping

# _schema imports this file, so its helpers cannot be used here
DURATION = {"type": "string", "format": "retention"}
IMAGE = {"type": "string", "format": "image"}
FLAG = {"type": "boolean"}
SIZE: Mapping[str, Any] = {
    "anyOf": [{"type": "string", "format": "size"}, {"type": "number", "exclusiveMinimum": 0}],
    "x-allowed": "a Kubernetes quantity above zero such as 500Mi or 1Gi",
}
NODE_PORT = {"type": "integer", "minimum": 30000, "maximum": 32767}
PARTS = ("prometheus", "loki", "grafana", "alertmanager", "node_exporter", "otelcol", "promtail", "vmagent")
WORKLOADS = ("prometheus", "loki", "grafana", "alertmanager", "vmagent", "node-exporter", "log-shipper")


def _mapping(properties: Mapping[str, Any]) -> dict[str, Any]:
    return {"type": "object", "properties": dict(properties), "required": [], "additionalProperties": False}


PERSISTENCE = _mapping({"enabled": FLAG, "size": SIZE})

# The dissertation's listing 6.
SEED = _mapping(
    {
        "enabled": FLAG,
        "grafana": _mapping(
            {
                "enabled": FLAG,
                "admin_password": {"type": "string"},
                "default_dashboards": FLAG,
                "service_type": {"enum": ["NodePort", "ClusterIP"]},
                "persistence": PERSISTENCE,
            }
        ),
        "prometheus": _mapping(
            {
                "enabled": FLAG,
                "scrape_interval": DURATION,
                "evaluation_interval": DURATION,
                "retention": DURATION,
            }
        ),
        "loki": _mapping({"enabled": FLAG, "retention": DURATION, "persistence": PERSISTENCE}),
        "node_exporter": FLAG,
        "ros_metrics": FLAG,
    }
)

OBSERVABILITY_VARIABLES: dict[str, Mapping[str, Any]] = {
    "observability": SEED,
    **dict.fromkeys(
        (
            "observability_scrape_interval",
            "observability_evaluation_interval",
            "observability_prometheus_retention",
            "observability_loki_retention",
            "observability_out_of_order_window",
        ),
        DURATION,
    ),
    **dict.fromkeys(
        (
            "observability_prometheus_size",
            "observability_loki_size",
            "observability_grafana_size",
            "observability_store_size",
            "observability_log_queue_size",
        ),
        SIZE,
    ),
    **dict.fromkeys(
        (
            "observability_grafana_node_port",
            "observability_hub_metrics_port",
            "observability_hub_logs_port",
        ),
        NODE_PORT,
    ),
    **{f"observability_{part}_image": IMAGE for part in PARTS},
    # empty is the role's default and says the same as leaving it out
    "observability_hub_url": {
        "anyOf": [{"type": "string", "format": "hub-url"}, {"const": ""}],
        "x-allowed": "http://<host> or https://<host>, without a port and a path",
    },
    "observability_allowed_networks": {"type": "array", "items": {"type": "string", "format": "network"}},
    "observability_overrides": _mapping({name: {"type": "object"} for name in WORKLOADS}),
}
