# SPDX-License-Identifier: GPL-3.0-or-later
"""Dashboards of logs, and of the telemetry itself."""

from __future__ import annotations

from .page import OF_ROBOT as R
from .page import ROBOTS, page
from .panels import (
    RED_ABOVE,
    Json,
    graph,
    label_variable,
    log_query,
    logs,
    query,
    share,
    stat,
    states,
    table,
    text_variable,
)

NAMESPACES = label_variable("namespace", "label_values(container_memory_working_set_bytes, namespace)", empty=".+")


def log_pages() -> Json:
    """Logs of all pods."""
    chosen = '{robot=~"$robot", namespace=~"$namespace"}'
    searched = f"{chosen} |~ `(?i)$search`"
    errors = f"{chosen} |~ `(?i)(error|fatal|traceback|exception|panic)`"
    rows = [
        [
            stat("Lines", "none", log_query(f"sum(count_over_time({searched} [$__range]))", "lines", instant=True)),
            stat(
                "Lines with errors",
                "none",
                log_query(f"sum(count_over_time({errors} [$__range])) or vector(0)", "errors", instant=True),
                steps=(("green", None), ("orange", 1)),
            ),
        ],
        [
            graph(
                "Lines of an app",
                "cps",
                log_query(f"sum by (robot, app) (rate({searched} [$__auto]))", "{{robot}} {{app}}"),
                stack=True,
            ),
            graph(
                "Lines with errors",
                "cps",
                log_query(f"sum by (robot, app) (rate({errors} [$__auto]))", "{{robot}} {{app}}"),
                stack=True,
            ),
        ],
        [logs("Lines", log_query(searched))],
    ]
    variables = [ROBOTS, NAMESPACES, text_variable("search", "Search (regular expression)")]
    return page("logs", "Logs", "What the pods of robots and edge write", rows, variables)


def telemetry() -> Json:
    """Whether what the other dashboards show can be trusted."""

    def shipper(name: str) -> str:
        # the collector's names end in _total or not, by how its own metrics are configured
        return f'{{__name__=~"otelcol_{name}(_total)?", {R}}}'

    rows = [
        [
            share("Targets that answer", f"sum(up{{{R}}})", f"count(up{{{R}}})"),
            stat("Targets away", "none", query(f"count(up{{{R}}} == 0) or vector(0)"), steps=RED_ABOVE),
            stat(
                "Samples stored",
                "cps",
                query("sum(rate(prometheus_tsdb_head_samples_appended_total[$__rate_interval]))"),
            ),
            stat("Series", "short", query("sum(prometheus_tsdb_head_series)")),
            stat("Metrics on disk", "bytes", query("sum(prometheus_tsdb_storage_blocks_bytes)")),
            stat(
                "Log lines stored", "cps", query("sum(rate(loki_distributor_lines_received_total[$__rate_interval]))")
            ),
        ],
        [
            states("Targets", query(f"min by (job, robot, node) (up{{{R}}})", "{{job}} {{robot}} {{node}}")),
            graph("Duration of scrapes", "s", query(f"max by (job) (scrape_duration_seconds{{{R}}})", "{{job}}")),
            graph("Samples of a scrape", "short", query(f"sum by (job) (scrape_samples_scraped{{{R}}})", "{{job}}")),
        ],
        [
            graph(
                "ROS exporters: a poll",
                "s",
                query(f"max by (robot, namespace) (ros_exporter_poll_duration_seconds{{{R}}})"),
            ),
            graph(
                "ROS exporters: since the last poll",
                "s",
                query(
                    f"max by (robot, namespace) (time() - ros_exporter_last_poll_timestamp_seconds{{{R}}})",
                    "{{robot}} {{namespace}}",
                ),
            ),
            graph(
                "ROS exporters: errors",
                "cps",
                query(
                    f"sum by (robot, reason) (rate(ros_exporter_scrape_errors_total{{{R}}}[$__rate_interval]))",
                    "{{robot}} {{reason}}",
                ),
            ),
        ],
        [
            graph(
                "Log shipper: lines sent",
                "cps",
                query(
                    f"sum by (robot, pod) (rate({shipper('exporter_sent_log_records')}[$__rate_interval]))",
                    "{{robot}} {{pod}}",
                ),
            ),
            graph(
                "Log shipper: queue on disk, part used",
                "percentunit",
                query(
                    f"max by (robot, pod) (otelcol_exporter_queue_size{{{R}}})"
                    f" / max by (robot, pod) (otelcol_exporter_queue_capacity{{{R}}})",
                    "{{robot}} {{pod}}",
                ),
            ),
            graph(
                "Log lines lost",
                "cps",
                query(
                    f"sum by (robot, pod) (rate({shipper('exporter_enqueue_failed_log_records')}[$__rate_interval]))",
                    "{{robot}} {{pod}} not queued",
                ),
                query(
                    f"sum by (robot, pod) (rate({shipper('exporter_send_failed_log_records')}[$__rate_interval]))",
                    "{{robot}} {{pod}} not sent",
                ),
                query("sum by (reason) (rate(loki_discarded_samples_total[$__rate_interval]))", "loki: {{reason}}"),
            ),
        ],
        [
            graph(
                "Metrics that wait for their way out",
                "bytes",
                query(f"sum by (robot) (vmagent_remotewrite_pending_data_bytes{{{R}}})", "{{robot}}"),
                about="Profile robot: the disk queue of vmagent.",
            ),
            graph(
                "Remote write: samples that wait",
                "short",
                query(f"sum by (robot) (prometheus_remote_storage_samples_pending{{{R}}})", "{{robot}}"),
                about="A Prometheus that sends on to a hub.",
            ),
            graph(
                "Memory of the stack",
                "bytes",
                query(
                    'sum by (pod) (container_memory_working_set_bytes{namespace="observability", pod!=""})',
                    "{{pod}}",
                ),
            ),
        ],
        [
            table(
                "Targets that are away",
                {"job": ("Job", ""), "robot": ("Robot", ""), "node": ("Node", ""), "instance": ("Address", "")},
                query(f"up{{{R}}} == 0", instant=True),
            )
        ],
    ]
    return page("telemetry", "Telemetry", "Whether what the other dashboards show can be trusted", rows, [ROBOTS])
