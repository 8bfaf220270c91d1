# SPDX-License-Identifier: GPL-3.0-or-later
"""Dashboards of ROS: who is connected with whom, and what the topics carry."""

from __future__ import annotations

from .page import OF_ROBOT as R
from .page import ROBOTS, SENT, page
from .panels import Json, graph, label_variable, latest, query, share, stat, states, table

TOPICS = label_variable("topic", f"label_values(ros_topic_publishers{{{R}}}, topic)")
RECORDED = "robot_topic:ros_topic_messages_out:rate1m"


def ros_graph() -> Json:
    """Who is there and who is connected with whom."""
    per_topic = table(
        "Topics",
        {
            "robot": ("Robot", ""),
            "topic": ("Topic", ""),
            "Value #A": ("Publishers", "none"),
            "Value #B": ("Subscribers", "none"),
            "Value #C": ("Connections", "none"),
            "Value #D": ("Messages/s", "cps"),
        },
        latest(f"max by (robot, topic) (ros_topic_publishers{{{R}}})"),
        latest(f"max by (robot, topic) (ros_topic_subscribers{{{R}}})"),
        latest(f'sum by (robot, topic) (ros_topic_connections{{{R}, direction="out"}})'),
        latest(f"sum by (robot, topic) (rate({SENT}[$__rate_interval]))"),
    )
    nodes = table(
        "Nodes",
        {"robot": ("Robot", ""), "node": ("Node", ""), "Value": ("Answers", "yes/no")},
        latest(f"max by (robot, node) (ros_node_up{{{R}}})"),
    )
    services = table(
        "Services",
        {"robot": ("Robot", ""), "service": ("Service", ""), "node": ("Node", ""), "Value": ("Served", "yes/no")},
        latest(f"max by (robot, service, node) (ros_service_up{{{R}}})"),
    )
    rows = [
        [
            share("Masters that answer", f"sum(ros_master_up{{{R}}})", f"count(ros_master_up{{{R}}})"),
            share("Nodes up", f"sum(ros_node_up{{{R}}})", f"count(ros_node_up{{{R}}})"),
            stat(
                "Topics nobody publishes",
                "none",
                query(f"count(ros_topic_subscribers{{{R}}} > 0 unless ros_topic_publishers{{{R}}} > 0) or vector(0)"),
                about="Somebody has subscribed to them.",
                steps=(("green", None), ("orange", 1)),
            ),
            share("Services there", f"sum(ros_service_up{{{R}}})", f"count(ros_service_up{{{R}}})"),
        ],
        [nodes, services],
        [per_topic],
        [
            graph(
                "Connections",
                "none",
                query(f'sum by (robot) (ros_topic_connections{{{R}, direction="out"}})', "{{robot}}"),
            ),
            graph(
                "Goals of actions",
                "none",
                query(f"sum by (action, state) (ros_action_goals{{{R}}})", "{{action}} {{state}}"),
            ),
        ],
        [
            states("Masters", query(f"max by (robot, namespace) (ros_master_up{{{R}}})", "{{robot}} {{namespace}}")),
            states("Nodes", query(f"max by (robot, node) (ros_node_up{{{R}}})", "{{robot}} {{node}}")),
        ],
    ]
    return page(
        "ros-graph", "ROS graph", "Nodes, topics, services and actions, as masters and nodes say", rows, [ROBOTS]
    )


def topics() -> Json:
    """Rates and volume of topics."""
    sel = f'{R}, topic=~"$topic"'

    def flow(metric: str, direction: str) -> str:
        return f'sum by (robot, topic) (rate({metric}{{{sel}, direction="{direction}"}}[$__rate_interval]))'

    who = "{{robot}} {{topic}}"
    rows = [
        [
            graph("Messages sent", "cps", query(flow("ros_topic_messages_total", "out"), who)),
            graph("Messages received", "cps", query(flow("ros_topic_messages_total", "in"), who)),
        ],
        [
            graph("Bytes sent", "Bps", query(flow("ros_topic_bytes_total", "out"), who)),
            graph(
                "Bytes a message",
                "bytes",
                query(f"{flow('ros_topic_bytes_total', 'out')} / ({flow('ros_topic_messages_total', 'out')} > 0)", who),
            ),
        ],
        [
            graph(
                "Rate against the last hour's",
                "percentunit",
                query(f"{RECORDED}{{{sel}}} / (quantile_over_time(0.5, {RECORDED}{{{sel}}}[1h] offset 3m) > 0)", who),
                about="Below 70 % the alert RosTopicRateDrop is raised, for topics that are sent steadily.",
            ),
            graph(
                "Connections",
                "none",
                query(f'sum by (robot, topic) (ros_topic_connections{{{sel}, direction="out"}})', who),
            ),
        ],
    ]
    return page("topics", "Topics", "Rates and volume of topics", rows, [ROBOTS, TOPICS])
