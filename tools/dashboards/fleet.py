# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Dashboards of robots: all at a glance, and one."""

from __future__ import annotations

from .page import CARDS, DISKS, ONE_ROBOT, ROBOTS, SENT, page
from .page import OF_ROBOT as R
from .panels import GREEN_ABOVE, RED_ABOVE, Json, graph, latest, log_query, logs, query, stat, states, table


def fleet() -> Json:
    """All robots at a glance."""
    up = 'up{robot!="", robot=~"$robot"}'
    robots = table(
        "Robots",
        {
            "robot": ("Robot", ""),
            "Value #A": ("Answers", "yes/no"),
            "Value #B": ("ROS master", "yes/no"),
            "Value #C": ("Nodes up", "none"),
            "Value #D": ("Messages/s", "cps"),
            "Value #E": ("Processor", "percentunit"),
            "Value #F": ("Memory", "percentunit"),
            "Value #G": ("Alerts", "none"),
        },
        latest(f"max by (robot) ({up})"),
        latest(f"min by (robot) (ros_master_up{{{R}}})"),
        latest(f"sum by (robot) (ros_node_up{{{R}}})"),
        latest(f"sum by (robot) (rate({SENT}[$__rate_interval]))"),
        latest(f'1 - avg by (robot) (rate(node_cpu_seconds_total{{{R}, robot!="", mode="idle"}}[$__rate_interval]))'),
        latest(
            f'1 - max by (robot) (node_memory_MemAvailable_bytes{{{R}, robot!=""}})'
            f' / max by (robot) (node_memory_MemTotal_bytes{{{R}, robot!=""}})'
        ),
        latest(f'count by (robot) (ALERTS{{{R}, robot!="", alertstate="firing"}})'),
        about="A robot that is off has no figures, only its last words in the logs.",
    )
    alerts = table(
        "Alerts now",
        {
            "alertname": ("Alert", ""),
            "severity": ("Severity", ""),
            "robot": ("Robot", ""),
            "node": ("Node", ""),
            "topic": ("Topic", ""),
            "namespace": ("Namespace", ""),
        },
        latest(f'ALERTS{{alertstate="firing", {R}}}'),
        about="Each has a page in docs/runbooks that says what to do.",
    )
    rows = [
        [
            stat(
                "Robots that answer",
                "none",
                query(f"count(max by (robot) ({up}) == 1) or vector(0)"),
                steps=GREEN_ABOVE,
            ),
            stat("Robots away", "none", query(f"count(max by (robot) ({up}) == 0) or vector(0)"), steps=RED_ABOVE),
            stat("Masters down", "none", query(f"count(ros_master_up{{{R}}} == 0) or vector(0)"), steps=RED_ABOVE),
            stat("ROS nodes down", "none", query(f"count(ros_node_up{{{R}}} == 0) or vector(0)"), steps=RED_ABOVE),
            stat(
                "Updates running",
                "none",
                query(f'count(robot_update_info{{{R}, outcome="running"}}) or vector(0)'),
            ),
            stat(
                "Alerts",
                "none",
                query(f'count(ALERTS{{alertstate="firing", severity!="info", {R}}}) or vector(0)'),
                steps=RED_ABOVE,
            ),
        ],
        [robots, alerts],
        [
            states("Robots that answered", query(f"max by (robot) ({up})", "{{robot}}")),
            graph("Messages sent", "cps", query(f"sum by (robot) (rate({SENT}[$__rate_interval]))", "{{robot}}")),
        ],
        [
            graph(
                "Processor",
                "percentunit",
                query(
                    f'1 - avg by (node) (rate(node_cpu_seconds_total{{{R}, mode="idle"}}[$__rate_interval]))',
                    "{{node}}",
                ),
            ),
            graph(
                "Memory",
                "percentunit",
                query(
                    f"1 - max by (node) (node_memory_MemAvailable_bytes{{{R}}})"
                    f" / max by (node) (node_memory_MemTotal_bytes{{{R}}})",
                    "{{node}}",
                ),
            ),
        ],
    ]
    return page("fleet", "Fleet", "All robots at a glance", rows, [ROBOTS])


def robot() -> Json:
    """One robot: its ROS graph, its apps' pods, its host."""
    pods = 'namespace="robot-$robot", pod!=""'
    rows = [
        [
            stat("ROS master answers", "none", query(f"min(ros_master_up{{{R}}})"), steps=GREEN_ABOVE),
            stat("Nodes up", "none", query(f"sum(ros_node_up{{{R}}})"), steps=GREEN_ABOVE),
            stat("Nodes down", "none", query(f"count(ros_node_up{{{R}}} == 0) or vector(0)"), steps=RED_ABOVE),
            stat("Topics", "none", query(f"count(ros_topic_publishers{{{R}}})")),
            stat("Messages sent", "cps", query(f"sum(rate({SENT}[$__rate_interval]))")),
            stat("Host runs since", "s", query(f"max(node_time_seconds{{{R}}} - node_boot_time_seconds{{{R}}})")),
        ],
        [
            states("ROS nodes", query(f"max by (node) (ros_node_up{{{R}}})", "{{node}}")),
            graph(
                "Topics: messages sent", "cps", query(f"sum by (topic) (rate({SENT}[$__rate_interval]))", "{{topic}}")
            ),
        ],
        [
            graph(
                "Pods: processor",
                "short",
                query(f"sum by (pod) (rate(container_cpu_usage_seconds_total{{{pods}}}[$__rate_interval]))", "{{pod}}"),
                about="Cores.",
            ),
            graph(
                "Pods: memory",
                "bytes",
                query(f"sum by (pod) (container_memory_working_set_bytes{{{pods}}})", "{{pod}}"),
            ),
            graph(
                "Pods: readiness probes that failed",
                "cps",
                query(
                    'sum by (pod) (rate(prober_probe_total{namespace="robot-$robot", probe_type="Readiness",'
                    ' result!="successful"}[$__rate_interval]))',
                    "{{pod}}",
                ),
            ),
        ],
        [
            graph(
                "Host: processor",
                "percentunit",
                query(
                    f'avg by (mode) (rate(node_cpu_seconds_total{{{R}, mode!="idle"}}[$__rate_interval]))', "{{mode}}"
                ),
                stack=True,
            ),
            graph(
                "Host: memory",
                "bytes",
                query(f"node_memory_MemTotal_bytes{{{R}}} - node_memory_MemAvailable_bytes{{{R}}}", "used"),
                query(f"node_memory_MemTotal_bytes{{{R}}}", "there is"),
            ),
            graph(
                "Host: network",
                "Bps",
                query(
                    f"sum by (device) (rate(node_network_receive_bytes_total{{{R}, {CARDS}}}[$__rate_interval]))",
                    "{{device}} in",
                ),
                query(
                    f"sum by (device) (rate(node_network_transmit_bytes_total{{{R}, {CARDS}}}[$__rate_interval]))",
                    "{{device}} out",
                ),
            ),
        ],
        [
            graph(
                "Host: disks, part used",
                "percentunit",
                query(
                    f"1 - max by (device) (node_filesystem_avail_bytes{{{R}, {DISKS}}})"
                    f" / max by (device) (node_filesystem_size_bytes{{{R}, {DISKS}}})",
                    "{{device}}",
                ),
            ),
            graph(
                "Host: temperature",
                "celsius",
                query(f"max by (chip, sensor) (node_hwmon_temp_celsius{{{R}}})"),
                floor=None,
            ),
            graph("Host: battery", "percent", query(f"node_power_supply_capacity{{{R}}}", "{{power_supply}}")),
        ],
        [logs("Logs", log_query('{namespace="robot-$robot"}'))],
    ]
    return page("robot", "Robot", "One robot: its ROS graph, its pods, its host", rows, [ONE_ROBOT])
