# SPDX-License-Identifier: GPL-3.0-or-later
"""Dashboards of robots: all at a glance, and one."""

from __future__ import annotations

from .page import CARDS, DISKS, ONE_ROBOT, ROBOTS, SENT, TO_ROBOT, TO_RUNBOOK, page
from .page import OF_ROBOT as R
from .panels import RED_ABOVE, Json, graph, latest, log_query, logs, query, share, stat, states, table
from .updates import latest_updates

NODES_UP, NODES = f"sum(ros_node_up{{{R}}})", f"count(ros_node_up{{{R}}})"
MASTERS_UP, MASTERS = f"sum(ros_master_up{{{R}}})", f"count(ros_master_up{{{R}}})"
ANSWER = f"robot:up:max{{{R}}}"
KNOWN = f"max_over_time({ANSWER}[6h])"  # a hub hears nothing at all of a robot that is away, not even that it is


def alerts_now() -> Json:
    """The alerts that fire."""
    return table(
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
        about="A click on an alert opens its runbook: what it means, what to look at, what to do.",
        links={"Alert": TO_RUNBOOK, "Robot": TO_ROBOT},
    )


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
            "Value #H": ("of", "none"),
            "Value #D": ("Messages/s", "cps"),
            "Value #E": ("Processor", "percentunit"),
            "Value #F": ("Memory", "percentunit"),
            "Value #G": ("Alerts", "none"),
        },
        latest(f"{ANSWER} or {KNOWN} * 0"),
        latest(f"min by (robot) (ros_master_up{{{R}}})"),
        latest(f"sum by (robot) (ros_node_up{{{R}}})"),
        latest(f"sum by (robot) (rate({SENT}[$__rate_interval]))"),
        latest(f'1 - avg by (robot) (rate(node_cpu_seconds_total{{{R}, robot!="", mode="idle"}}[$__rate_interval]))'),
        latest(
            f'1 - max by (robot) (node_memory_MemAvailable_bytes{{{R}, robot!=""}})'
            f' / max by (robot) (node_memory_MemTotal_bytes{{{R}, robot!=""}})'
        ),
        latest(f'count by (robot) (ALERTS{{{R}, robot!="", alertstate="firing"}})'),
        latest(f"count by (robot) (ros_node_up{{{R}}})"),
        about="A robot that is off has no figures, only last words in the logs. A click on one opens its dashboard.",
        links={"Robot": TO_ROBOT},
    )
    rows = [
        [
            share("Robots that answer", f"count({ANSWER} == 1) or vector(0)", f"count({KNOWN})"),
            share("ROS masters that answer", MASTERS_UP, MASTERS),
            share("ROS nodes up", NODES_UP, NODES),
            stat(
                "Robots away",
                "none",
                query(f"count({KNOWN} unless {ANSWER} == 1) or vector(0)"),
                about="A hub forgets a robot after 6 hours of silence.",
                steps=RED_ABOVE,
            ),
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
        [alerts_now()],
        [robots],
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


def claims() -> Json:
    """How full a robot's claims are."""
    used, asked = (f"max by (namespace, claim) (rosops_claim_{what}_bytes{{{R}}})" for what in ("used", "capacity"))
    return table(
        "Claims",
        {
            "claim": ("Claim", ""),
            "Value #A": ("Used", "bytes"),
            "Value #B": ("of", "bytes"),
            "Value #C": ("Part", "percentunit"),
        },
        latest(used),
        latest(asked),
        latest(f"{used} / {asked}"),
        about="A directory of the local-path storage has no limit of its own: these are the claims' promises.",
    )


def robot() -> Json:
    """One robot: its ROS graph, its apps' pods, its host."""
    pods = 'namespace="robot-$robot", pod!=""'
    rows = [
        [
            share("ROS master answers", MASTERS_UP, MASTERS),
            share("ROS nodes up", NODES_UP, NODES),
            stat(
                "Alerts",
                "none",
                query(f'count(ALERTS{{alertstate="firing", severity!="info", {R}}}) or vector(0)'),
                steps=RED_ABOVE,
            ),
            stat("Topics", "none", query(f"count(ros_topic_publishers{{{R}}})")),
            stat("Messages sent", "cps", query(f"sum(rate({SENT}[$__rate_interval]))")),
            stat("Host runs since", "s", query(f"max(node_time_seconds{{{R}}} - node_boot_time_seconds{{{R}}})")),
        ],
        [alerts_now(), latest_updates(), claims()],
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
