# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""What is kept of the large expositions: a k3s server has some 10,000 series; these are looked at."""

from __future__ import annotations

from typing import Any

KUBELET = (
    "go_goroutines",
    "k3s_certificate_expiration_seconds",
    "kubelet_certificate_manager_.*",
    "kubelet_container_log_filesystem_used_bytes",
    "kubelet_node_name",
    "kubelet_node_startup_duration_seconds",
    "kubelet_pleg_relist_duration_seconds_(?:sum|count)",
    "kubelet_pod_start_duration_seconds_(?:sum|count)",
    "kubelet_pod_start_sli_duration_seconds_(?:sum|count)",
    "kubelet_running_containers",
    "kubelet_running_pods",
    "kubelet_runtime_operations_errors_total",
    "kubelet_runtime_operations_total",
    "kubelet_server_expiration_renew_errors",
    "kubelet_started_containers_total",
    "kubelet_started_containers_errors_total",
    "kubelet_started_pods_total",
    "kubelet_started_pods_errors_total",
    "kubelet_volume_stats_.*",
    "kubernetes_build_info",
    "process_.*",
    "rest_client_requests_total",
    "storage_operation_duration_seconds_count",
)

PROBES = ("prober_probe_total",)

CADVISOR = (
    "container_cpu_cfs_(?:periods|throttled_periods)_total",
    "container_cpu_usage_seconds_total",
    "container_fs_(?:reads|writes)_bytes_total",
    "container_fs_(?:usage|limit)_bytes",
    "container_last_seen",
    "container_memory_(?:cache|rss|usage_bytes|working_set_bytes)",
    "container_network_(?:receive|transmit)_(?:bytes|errors|packets_dropped)_total",
    "container_oom_events_total",
    "container_processes",
    "container_spec_memory_limit_bytes",
    "container_start_time_seconds",
    "container_threads",
    "machine_.*",
)

APISERVER = (
    "apiserver_client_certificate_expiration_seconds_(?:bucket|count|sum)",
    "apiserver_current_inflight_requests",
    "apiserver_request_total",
    "apiserver_request_duration_seconds_(?:sum|count)",
    "apiserver_storage_objects",
    "apiserver_storage_size_bytes",
    "apiserver_resource_objects",
    "etcd_disk_wal_fsync_duration_seconds_(?:sum|count)",
    "etcd_mvcc_db_total_size_in_bytes",
    "etcd_server_has_leader",
    "etcd_server_leader_changes_seen_total",
    "go_goroutines",
    "kubernetes_build_info",
    "process_.*",
    "workqueue_depth",
    "workqueue_adds_total",
)


def keep(names: tuple[str, ...]) -> dict[str, Any]:
    """The relabelling that drops all other metrics."""
    return {"source_labels": ["__name__"], "regex": "|".join(names), "action": "keep"}
