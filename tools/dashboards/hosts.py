# SPDX-License-Identifier: GPL-3.0-or-later
"""The dashboard of hosts and of the cluster on them."""

from __future__ import annotations

from .page import CARDS, DISKS, ROBOTS, page
from .panels import Json, graph, label_variable, query, share, stat

N = 'node=~"$node"'
NODES = label_variable("node", "label_values(node_time_seconds, node)")
IDLE = 'mode="idle"'
CONTAINER = 'pod!=""'
FAILED = 'result!="successful"'


def hosts() -> Json:
    """Hosts of robots and edge, and the cluster on them."""

    def rate(metric: str, *matchers: str) -> str:
        return f"rate({metric}{{{', '.join([N, *matchers])}}}[$__rate_interval])"

    answer = f'up{{job="node-exporter", {N}}}'
    rows = [
        [
            share("Hosts that answer", f"sum({answer})", f"count({answer})"),
            stat("Pods running", "none", query(f"sum(kubelet_running_pods{{{N}}})")),
            stat(
                "Fullest disk",
                "percentunit",
                query(
                    f"max(1 - node_filesystem_avail_bytes{{{N}, {DISKS}}} / node_filesystem_size_bytes{{{N}, {DISKS}}})"
                ),
                steps=(("green", None), ("orange", 0.8), ("red", 0.9)),
            ),
            stat(
                "Largest clock offset",
                "s",
                query(f"max(abs(node_timex_offset_seconds{{{N}}}))"),
                steps=(("green", None), ("red", 0.1)),
            ),
            stat("API requests", "reqps", query("sum(rate(apiserver_request_total[$__rate_interval]))")),
            stat(
                "Next certificate ends in",
                "s",
                query("min(k3s_certificate_expiration_seconds)"),
                about="k3s's own figure. k3s renews its certificates when it is restarted.",
                steps=(("red", None), ("orange", 30 * 86400), ("green", 90 * 86400)),
            ),
        ],
        [
            graph(
                "Processor",
                "percentunit",
                query(f"1 - avg by (node) ({rate('node_cpu_seconds_total', IDLE)})", "{{node}}"),
            ),
            graph("Load of a minute", "short", query(f"node_load1{{{N}}}", "{{node}}")),
            graph(
                "Memory",
                "percentunit",
                query(
                    f"1 - max by (node) (node_memory_MemAvailable_bytes{{{N}}})"
                    f" / max by (node) (node_memory_MemTotal_bytes{{{N}}})",
                    "{{node}}",
                ),
            ),
        ],
        [
            graph(
                "Disks, part used",
                "percentunit",
                query(
                    f"1 - max by (node, device) (node_filesystem_avail_bytes{{{N}, {DISKS}}})"
                    f" / max by (node, device) (node_filesystem_size_bytes{{{N}, {DISKS}}})",
                    "{{node}} {{device}}",
                ),
            ),
            graph(
                "Disks, written",
                "Bps",
                query(f"sum by (node) ({rate('node_disk_written_bytes_total')})", "{{node}}"),
                about="What wears an SD card.",
            ),
            graph(
                "Network",
                "Bps",
                query(f"sum by (node) ({rate('node_network_receive_bytes_total', CARDS)})", "{{node}} in"),
                query(f"sum by (node) ({rate('node_network_transmit_bytes_total', CARDS)})", "{{node}} out"),
            ),
        ],
        [
            graph("Clock offset", "s", query(f"node_timex_offset_seconds{{{N}}}", "{{node}}"), floor=None),
            graph(
                "Pods: processor",
                "short",
                query(
                    f"topk(10, sum by (namespace, pod) ({rate('container_cpu_usage_seconds_total', CONTAINER)}))",
                    "{{namespace}} {{pod}}",
                ),
                about="Cores; the ten largest.",
            ),
            graph(
                "Pods: memory",
                "bytes",
                query(
                    f'topk(10, sum by (namespace, pod) (container_memory_working_set_bytes{{{N}, pod!=""}}))',
                    "{{namespace}} {{pod}}",
                ),
                about="The ten largest.",
            ),
        ],
        [
            graph(
                "Claims, part used",
                "percentunit",
                query(
                    "max by (namespace, claim) (rosops_claim_used_bytes)"
                    " / max by (namespace, claim) (rosops_claim_capacity_bytes)",
                    "{{namespace}} {{claim}}",
                ),
                query(
                    "max by (namespace, persistentvolumeclaim) (kubelet_volume_stats_used_bytes)"
                    " / max by (namespace, persistentvolumeclaim) (kubelet_volume_stats_capacity_bytes)",
                    "{{namespace}} {{persistentvolumeclaim}}",
                ),
                about="A directory of the local-path storage has no limit of its own: these are the claims' promises.",
            ),
            graph(
                "Probes that failed",
                "cps",
                query(
                    f"sum by (namespace, pod, probe_type) ({rate('prober_probe_total', FAILED)})",
                    "{{namespace}} {{pod}} {{probe_type}}",
                ),
            ),
            graph(
                "API requests",
                "reqps",
                query("sum by (code) (rate(apiserver_request_total[$__rate_interval]))", "{{code}}"),
            ),
        ],
    ]
    return page(
        "hosts-k3s", "Hosts and k3s", "Hosts of robots and edge, and the cluster on them", rows, [ROBOTS, NODES]
    )
