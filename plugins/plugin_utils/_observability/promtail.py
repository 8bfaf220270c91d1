# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Promtail, as the dissertation has it: the same files, the same labels as from the collector. Pure.

Its life ended in March 2026. It has no queue of its own: it stops reading while Loki is away, and what the kubelet
removes meanwhile is lost (it keeps 50 MB per container by default).
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from ansible_collections.rosops.fleet.plugins.plugin_utils._observability import names as obs
from ansible_collections.rosops.fleet.plugins.plugin_utils._observability.otelcol import NODE_ENV, STATE_DIR
from ansible_collections.rosops.fleet.plugins.plugin_utils._observability.pod_labels import (
    APP_OF_POD,
    PATH,
    POD_LOGS,
    ROBOT_OF_NAMESPACE,
    STREAM_LABELS,
    anchored,
    remote_regex,
)

Spec = Mapping[str, Any]


def promtail_config(spec: Spec, loki_url: str) -> dict[str, Any]:
    """Promtail's configuration, to be read with -config.expand-env; spec is complete, `loki_url` without a path."""
    return {
        "server": {
            "http_listen_port": obs.SHIPPER_PORTS["promtail"],
            "grpc_listen_port": 0,
            "log_level": "warn",
        },
        "positions": {"filename": f"{STATE_DIR}/positions.yaml"},
        "clients": [
            {
                "url": f"{loki_url}/loki/api/v1/push",
                "backoff_config": {"min_period": "1s", "max_period": "15s", "max_retries": 0},  # 0: for ever
            }
        ],
        "scrape_configs": [
            {
                "job_name": "pods",
                "static_configs": [{"labels": _labels(spec)}],
                "relabel_configs": _placement(spec),
                "pipeline_stages": _stages(),
            }
        ],
    }


def _labels(spec: Spec) -> dict[str, str]:
    own = f"{POD_LOGS}/{obs.NAMESPACE}_{obs.SHIPPER}-*/*/*"
    labels = {
        "__path__": f"{POD_LOGS}/*/*/*.log",
        "__path_exclude__": own,
        "placement": "local",
        "__node__": f"${{{NODE_ENV}}}",
    }
    return {**labels, "robot": spec["robot"]} if spec["robot"] else labels


def _placement(spec: Spec) -> list[dict[str, Any]]:
    return [
        {
            "source_labels": ["__node__"],
            "regex": remote_regex(spec["remote_nodes"]),
            "target_label": "placement",
            "replacement": "remote",
        }
    ]


def _stages() -> list[dict[str, Any]]:
    return [
        {"cri": {}},
        {"regex": {"source": "filename", "expression": anchored(PATH)}},
        {"regex": {"source": "namespace", "expression": anchored(ROBOT_OF_NAMESPACE)}},
        {"regex": {"source": "pod", "expression": anchored(APP_OF_POD)}},
        {"labels": dict.fromkeys(label for label in STREAM_LABELS if label != "placement")},
        {"structured_metadata": {"container": None, "stream": None}},
        {"labelallow": list(STREAM_LABELS)},
    ]
