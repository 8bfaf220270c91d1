# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Loki's configuration: one process, everything on its claim, retention by the compactor. Pure."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from ansible_collections.rosops.fleet.plugins.plugin_utils._observability import names as obs
from ansible_collections.rosops.fleet.plugins.plugin_utils._observability.pod_labels import STREAM_LABELS
from ansible_collections.rosops.fleet.plugins.plugin_utils._observability.spec import runs

Spec = Mapping[str, Any]

DATA = "/loki"
RULES_DIR = "/etc/loki-rules"
TENANT = "fake"  # Loki's own name for the only tenant there is without authentication
SCHEMA_FROM = "2024-01-01"  # never changed: it says how what is stored was written


def loki_config(spec: Spec) -> dict[str, Any]:
    """loki.yml; spec is complete."""
    retention = spec["loki"]["retention"]
    config: dict[str, Any] = {
        "auth_enabled": False,
        "server": {"http_listen_port": obs.PORTS[obs.LOKI], "grpc_listen_port": 9095, "log_level": "warn"},
        "common": {
            "instance_addr": "127.0.0.1",
            "path_prefix": DATA,
            "replication_factor": 1,
            "ring": {"kvstore": {"store": "inmemory"}},
            "storage": {"filesystem": {"chunks_directory": f"{DATA}/chunks", "rules_directory": f"{DATA}/rules"}},
        },
        "schema_config": {
            "configs": [
                {
                    "from": SCHEMA_FROM,
                    "store": "tsdb",
                    "object_store": "filesystem",
                    "schema": "v13",
                    "index": {"prefix": "index_", "period": "24h"},
                }
            ]
        },
        "limits_config": _limits(retention),
        "compactor": {
            "working_directory": f"{DATA}/compactor",
            "retention_enabled": True,
            "delete_request_store": "filesystem",
            "compaction_interval": "10m",
            "retention_delete_delay": "2h",
        },
        "ingester": {
            "chunk_idle_period": "30m",
            # lines may be older than a stream's newest by half of it
            "max_chunk_age": "4h" if spec["profile"] == obs.HUB else "2h",
            "wal": {"enabled": True, "dir": f"{DATA}/wal", "replay_memory_ceiling": "64MB"},
        },
        "ruler": {
            "storage": {"type": "local", "local": {"directory": RULES_DIR}},
            "rule_path": f"{DATA}/rules-temp",
            "ring": {"kvstore": {"store": "inmemory"}},
            "enable_api": True,
        },
        "analytics": {"reporting_enabled": False},
    }
    if runs(spec)[obs.ALERTMANAGER]:
        config["ruler"]["alertmanager_url"] = obs.url(obs.ALERTMANAGER)
    return config


def _limits(retention: str) -> dict[str, Any]:
    return {
        "retention_period": retention,
        # what a host kept while it was cut off is taken as long as it would be kept
        "reject_old_samples": True,
        "reject_old_samples_max_age": retention,
        "allow_structured_metadata": True,
        "discover_service_name": [],  # else a further label, and another one from each shipper
        "otlp_config": {
            "resource_attributes": {
                "ignore_defaults": True,
                "attributes_config": [{"action": "index_label", "attributes": list(STREAM_LABELS)}],
            }
        },
        # a host that comes back sends hours in minutes; beyond these it is told to wait, and loses nothing
        "ingestion_rate_mb": 16,
        "ingestion_burst_size_mb": 32,
        "per_stream_rate_limit": "8MB",
        "per_stream_rate_limit_burst": "32MB",
    }
