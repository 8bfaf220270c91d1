# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""The role's variables as one complete spec, and what follows: who runs, which images, how much is kept. Pure."""

from __future__ import annotations

from typing import Any, Mapping

from ansible_collections.rosops.fleet.plugins.module_utils._common.errors import SpecError
from ansible_collections.rosops.fleet.plugins.plugin_utils._model.formats import quantity_value
from ansible_collections.rosops.fleet.plugins.plugin_utils._model.merge import deep_merge
from ansible_collections.rosops.fleet.plugins.plugin_utils._observability import names as obs

Spec = Mapping[str, Any]

DEFAULTS: dict[str, Any] = {
    "profile": obs.STANDALONE,
    "robot": "",  # the robot whose own cluster this is; empty: the shared one
    "remote_nodes": [],
    "node_exporter": True,
    "log_shipper": "otelcol",
    "log_queue_size": "256Mi",
    "storage_class": "",
    "allowed_networks": [],
    "overrides": {},
    "prometheus": {
        "enabled": True,
        "scrape_interval": "10s",
        "evaluation_interval": "10s",
        "retention": "7d",
        "size": "8Gi",
    },
    "loki": {"enabled": True, "retention": "7d", "persistence": {"enabled": True, "size": "5Gi"}},
    "grafana": {
        "enabled": True,
        "default_dashboards": True,
        "service_type": "NodePort",
        "node_port": 30300,
        "persistence": {"enabled": True, "size": "2Gi"},
        "admin_version": "",
    },
    "alertmanager": {"enabled": False, "config": {}},
    "hub": {"url": "", "metrics_port": 30090, "logs_port": 30100, "window": "24h"},
    "store": {"size": "1Gi"},
    "images": {
        "prometheus": "prom/prometheus:v3.2.1",
        "loki": "grafana/loki:3.4.6",
        "grafana": "grafana/grafana:11.5.2",
        "alertmanager": "prom/alertmanager:v0.28.1",
        "node_exporter": "prom/node-exporter:v1.9.1",
        "otelcol": "otel/opentelemetry-collector-k8s:0.145.0",
        "promtail": "grafana/promtail:3.4.6",
        "vmagent": "victoriametrics/vmagent:v1.115.0",
    },
}

# Blocks are dropped when they would exceed this part of the claim. The rest is for what is not counted among them: the
# write-ahead log of the last three hours, and the copy that a compaction makes.
RETENTION_PART = 0.8
# vmagent drops the oldest once its queue is this part of its claim; the rest is for its open file.
STORE_PART = 0.9

_WHOLE = ("overrides", "remote_nodes", "allowed_networks")


def complete_spec(spec: Spec) -> dict[str, Any]:
    """Every key filled in; null stands for the default."""
    unknown = sorted(set(spec) - set(DEFAULTS))
    if unknown:
        raise SpecError(f"unknown keys: {', '.join(unknown)}")
    # null in the spec would remove a key: here it means that nothing was said
    full = deep_merge(DEFAULTS, _said({key: value for key, value in spec.items() if key not in _WHOLE}))
    for key in _WHOLE:
        full[key] = spec[key] if spec.get(key) is not None else DEFAULTS[key]
    # Alertmanager's own file: a null in it is its author's
    full["alertmanager"]["config"] = (spec.get("alertmanager") or {}).get("config") or {}
    return full


def _said(value: Any) -> Any:
    if not isinstance(value, Mapping):
        return value
    return {key: _said(item) for key, item in value.items() if item is not None}


def runs(spec: Spec) -> dict[str, bool]:
    """Which parts of the stack run; spec is complete."""
    robot = spec["profile"] == obs.ROBOT
    loki = not robot and spec["loki"]["enabled"]
    prometheus = not robot and spec["prometheus"]["enabled"]
    return {
        obs.PROMETHEUS: prometheus,
        obs.LOKI: loki,
        obs.GRAFANA: not robot and spec["grafana"]["enabled"],
        obs.ALERTMANAGER: prometheus and spec["alertmanager"]["enabled"],
        obs.VMAGENT: robot,
        obs.NODE_EXPORTER: spec["node_exporter"],
        # lines that nobody takes would fill the hosts' disks
        obs.SHIPPER: spec["log_shipper"] != "none" and (robot or loki),
    }


def images(spec: Spec) -> list[str]:
    """The images of what runs, sorted, each once; spec is complete."""
    keys = {name: name.replace("-", "_") for name in obs.WORKLOADS} | {obs.SHIPPER: spec["log_shipper"]}
    return sorted({spec["images"][keys[name]] for name, wanted in runs(spec).items() if wanted})


def retention_size(claim: str) -> str:
    """Prometheus's --storage.tsdb.retention.size for a claim, below the claim's capacity.

    >>> retention_size("8Gi"), retention_size("500Mi")
    ('6553MB', '400MB')
    """
    return f"{int(_mebibytes(claim) * RETENTION_PART)}MB"  # Prometheus's MB is 2^20 bytes


def store_size(claim: str) -> str:
    """vmagent's -remoteWrite.maxDiskUsagePerURL for a claim."""
    return f"{int(_mebibytes(claim) * STORE_PART)}MiB"


def bytes_of(size: str) -> int:
    """A Kubernetes quantity in bytes."""
    value = quantity_value(str(size))
    if value is None:
        raise SpecError(f"{size!r} is no Kubernetes quantity")
    return int(value)


def _mebibytes(size: str) -> float:
    return bytes_of(size) / 2**20


def hub_url(spec: Spec, port: str) -> str:
    """The hub's address for metrics or for logs: `http://192.0.2.10` and one of its two ports."""
    url = str(spec["hub"]["url"]).rstrip("/")
    if not url:
        raise SpecError("the profile robot needs observability_hub_url, the hub's address")
    return f"{url}:{spec['hub'][port]}"
