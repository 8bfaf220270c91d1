# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Minimal configurations of the programs: enough for a sample or a log line to go all the way."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

LABELS = ("robot", "namespace", "app", "pod", "placement")


def write(path: Path, config: dict[str, Any]) -> str:
    """JSON, which is YAML, too."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps(config, indent=1))
    return str(path)


def prometheus(targets: dict[str, int], alertmanager: int, rules: str) -> dict[str, Any]:
    return {
        "global": {"scrape_interval": "1s", "evaluation_interval": "1s"},
        "rule_files": [rules],
        "alerting": {
            "alertmanagers": [{"static_configs": [{"targets": [f"127.0.0.1:{alertmanager}"]}]}],
        },
        "scrape_configs": [
            {"job_name": job, "static_configs": [{"targets": [f"127.0.0.1:{port}"], "labels": {"robot": "robot1"}}]}
            for job, port in targets.items()
        ],
    }


def always_firing() -> dict[str, Any]:
    rule = {"alert": "Always", "expr": "up == 1", "labels": {"severity": "info"}}
    return {"groups": [{"name": "test", "rules": [rule]}]}


def alertmanager() -> dict[str, Any]:
    return {"route": {"receiver": "none"}, "receivers": [{"name": "none"}]}


def loki(data: Path, http: int, grpc: int) -> dict[str, Any]:
    attributes = [{"action": "index_label", "attributes": list(LABELS)}]
    return {
        "auth_enabled": False,
        "server": {
            "http_listen_address": "127.0.0.1",
            "http_listen_port": http,
            "grpc_listen_address": "127.0.0.1",
            "grpc_listen_port": grpc,
        },
        "common": {
            "path_prefix": str(data),
            "instance_addr": "127.0.0.1",
            "replication_factor": 1,
            "ring": {"kvstore": {"store": "inmemory"}},
            "storage": {
                "filesystem": {"chunks_directory": str(data / "chunks"), "rules_directory": str(data / "rules")}
            },
        },
        "ingester": {"lifecycler": {"min_ready_duration": "0s", "final_sleep": "0s"}},
        "schema_config": {
            "configs": [
                {
                    "from": "2024-01-01",
                    "store": "tsdb",
                    "object_store": "filesystem",
                    "schema": "v13",
                    "index": {"prefix": "index_", "period": "24h"},
                }
            ]
        },
        "limits_config": {
            "otlp_config": {"resource_attributes": {"ignore_defaults": True, "attributes_config": attributes}}
        },
        "analytics": {"reporting_enabled": False},
    }


def otelcol(log: Path, queue: Path, loki_port: int, own_port: int) -> dict[str, Any]:
    return {
        "extensions": {"file_storage": {"directory": str(queue), "create_directory": True}},
        "receivers": {
            "filelog": {
                "include": [str(log)],
                "start_at": "beginning",
                "storage": "file_storage",
                "resource": {"robot": "robot1", "app": "talker"},
            }
        },
        "processors": {
            "memory_limiter": {"check_interval": "1s", "limit_mib": 100},
            "batch": {"timeout": "200ms"},
            "resource": {"attributes": [{"key": "placement", "value": "local", "action": "upsert"}]},
            "transform": {
                "log_statements": [{"context": "log", "statements": ['set(log.attributes["container"], "node")']}]
            },
        },
        "exporters": {
            "otlphttp": {
                "endpoint": f"http://127.0.0.1:{loki_port}/otlp",
                "sending_queue": {"enabled": True, "storage": "file_storage"},
            }
        },
        "service": {
            "extensions": ["file_storage"],
            "telemetry": {
                "metrics": {
                    "readers": [
                        {"pull": {"exporter": {"prometheus": {"host": "127.0.0.1", "port": own_port}}}},
                    ]
                }
            },
            "pipelines": {
                "logs": {
                    "receivers": ["filelog"],
                    "processors": ["memory_limiter", "resource", "transform", "batch"],
                    "exporters": ["otlphttp"],
                }
            },
        },
    }


def vmagent(target: int) -> dict[str, Any]:
    job = {"job_name": "by-vmagent", "static_configs": [{"targets": [f"127.0.0.1:{target}"]}]}
    return {"global": {"scrape_interval": "1s"}, "scrape_configs": [job]}
