# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""A snapshot -> metric families with their samples. Pure."""

from __future__ import annotations

from typing import Any, Iterable, Mapping, NamedTuple, Sequence, Tuple

from .snapshot import REASONS, GraphMetrics, Snapshot

GAUGE, COUNTER = "gauge", "counter"
Sample = Tuple[Mapping[str, str], float]


class Family(NamedTuple):
    """A metric by its name as it is queried; a counter's ends in _total."""

    name: str
    kind: str
    help: str
    samples: Sequence[Sample]


def families(snapshot: Snapshot) -> list[Family]:
    """Everything that comes from the polls. What is not known has no sample, rather than a zero."""
    return [*_ros(snapshot.ros), *_own(snapshot)]


def _ros(ros: GraphMetrics) -> list[Family]:
    """The graph's metrics."""
    master: list[Sample] = [] if ros.master is None else [({}, float(ros.master))]
    flows = [(node, flow, count) for node, counts in ros.counts.items() for flow, count in counts.items()]
    messages = "Messages of a topic by the node's own count: published (each once, however many subscribe) or received"
    goals = {(action, state): number for action, states in ros.goals.items() for state, number in states.items()}
    alive = {name: child.alive for name, child in ros.launched.items()}
    starts = {name: child.spawned for name, child in ros.launched.items()}
    there = "Whether a process that a launch file started is there; one that has done its work is not"
    started = "How many times a launch file's process was started by its roslaunch"
    return [
        Family("ros_master_up", GAUGE, "Whether the ROS master answers", master),
        Family("ros_node_up", GAUGE, "Whether a registered node answers at its address", _by("node", ros.nodes)),
        Family(
            "ros_topic_messages_total",
            COUNTER,
            messages,
            [(_flow(node, *flow), float(count.messages)) for node, flow, count in flows],
        ),
        Family(
            "ros_topic_bytes_total",
            COUNTER,
            "Bytes of a topic on all connections of the node",
            [(_flow(node, *flow), float(count.bytes)) for node, flow, count in flows],
        ),
        Family("ros_topic_publishers", GAUGE, "Registered publishers", _by("topic", ros.publishers)),
        Family("ros_topic_subscribers", GAUGE, "Registered subscribers", _by("topic", ros.subscribers)),
        Family(
            "ros_topic_connections",
            GAUGE,
            "Open connections of a topic by the node's word",
            _by("topic node direction", ros.connections),
        ),
        Family(
            "ros_service_up",
            GAUGE,
            "Whether a service answers the handshake of a client",
            _by("service node", ros.services),
        ),
        Family("ros_action_goals", GAUGE, "Goals in an action's status by state", _by("action state", goals)),
        Family("ros_launch_process_up", GAUGE, there, _by("node", alive)),
        Family("ros_launch_process_starts_total", COUNTER, started, _by("node", starts)),
    ]


def _flow(node: str, topic: str, direction: str) -> dict[str, str]:
    return {"topic": topic, "node": node, "direction": direction}


def _by(labels: str, numbers: Mapping[Any, float]) -> list[Sample]:
    """A sample for each; a key has one word for each of the labels."""
    names = labels.split()
    return [
        (dict(zip(names, key if isinstance(key, tuple) else (key,))), float(number))
        for key, number in sorted(numbers.items())
    ]


def _own(snapshot: Snapshot) -> list[Family]:
    """The exporter's metrics of itself."""
    errors = {why: snapshot.errors.get(why, 0) for why in REASONS}
    asked = "Questions to the master or a node that got no usable answer"
    took: list[Sample] = [({}, snapshot.duration)] if snapshot.polls else []
    began: list[Sample] = [({}, snapshot.at)] if snapshot.polls else []
    return [
        Family("ros_exporter_scrape_errors_total", COUNTER, asked, _by("reason", errors)),
        Family("ros_exporter_polls_total", COUNTER, "Looks at the graph", [({}, float(snapshot.polls))]),
        Family("ros_exporter_poll_duration_seconds", GAUGE, "How long the last look took", took),
        Family("ros_exporter_last_poll_timestamp_seconds", GAUGE, "When the last look began", began),
    ]


def claim_families(used: Mapping[str, int], capacity: Mapping[str, int]) -> list[Family]:
    """Persistent claims: what their directories hold, and what they were made for."""
    return [
        Family("rosops_claim_used_bytes", GAUGE, "Bytes on disk in a claim's directory", _by("claim", used)),
        Family(
            "rosops_claim_capacity_bytes",
            GAUGE,
            "Size that a claim asks for; nothing enforces it on a node's disk",
            _by("claim", {name: capacity[name] for name in used if name in capacity}),
        ),
    ]


def statistics_families(rows: Iterable[tuple[tuple[str, str, str], float, int]]) -> list[Family]:
    """Latency and drops by (topic, publisher, subscriber)."""
    found = list(rows)
    aged = "Mean age of messages by their stamp when they came in, by the subscriber's word"
    ages = _by("topic publisher subscriber", {key: age for key, age, _lost in found})
    lost = _by("topic publisher subscriber", {key: lost for key, _age, lost in found})
    return [
        Family("ros_topic_latency_seconds", GAUGE, aged, ages),
        Family(
            "ros_topic_dropped_messages_total", COUNTER, "Messages that the subscriber missed, by its own word", lost
        ),
    ]
