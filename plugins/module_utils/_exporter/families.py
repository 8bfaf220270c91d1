# SPDX-License-Identifier: GPL-3.0-or-later
"""A snapshot -> metric families with their samples, how many of these may be, and their text. Pure.

Names come from whoever reaches the master. Each one that never comes again (rostopic's, rviz's, with a process id and
a time in it) would leave its series in the database for good, and a node with thousands of topics fill it.

The text is OpenMetrics', which Prometheus, vmagent and the OpenTelemetry collector read:
https://prometheus.io/docs/specs/om/open_metrics_spec/.
"""

from __future__ import annotations

import math
import re
from itertools import accumulate
from typing import Any, Iterable, Mapping, NamedTuple, Sequence, Tuple

from .._ros.names import ANONYMOUS
from .snapshot import Snapshot

GAUGE, COUNTER = "gauge", "counter"
TOTAL = "_total"  # ends the name of a counter and of its samples, and is no part of its family's in the text
CONTENT_TYPE = "application/openmetrics-text; version=1.0.0; charset=utf-8"
MOST = 20_000  # samples of a scrape
LEFT_OUT = "ros_exporter_series_left_out"
NAMES = frozenset({"node", "topic", "service", "action"})  # labels with names of the graph

_ANONYMOUS = re.compile(ANONYMOUS + r"(?=/|\Z)")

Sample = Tuple[Mapping[str, str], float]


class Family(NamedTuple):
    """A metric by its name as it is queried."""

    name: str
    kind: str
    help: str
    samples: Sequence[Sample]


def family(name: str, about: str, labels: str, numbers: Mapping[Any, float]) -> Family:
    """Of numbers, whose keys have one word for each of the labels."""
    names, kind = labels.split(), COUNTER if name.endswith(TOTAL) else GAUGE
    rows = ((key if isinstance(key, tuple) else (key,), number) for key, number in sorted(numbers.items()))
    return Family(name, kind, about, [(dict(zip(names, key)), float(number)) for key, number in rows])


# The graph's: name, what it is, and its labels.
ROS = (
    ("ros_master_up", "Whether the ROS master answers", ""),
    ("ros_node_up", "Whether a registered node answers at its address", "node"),
    (
        "ros_topic_messages_total",
        "Messages of a topic by the node's own count: published (each once, however many subscribe) or received",
        "topic node direction",
    ),
    ("ros_topic_bytes_total", "Bytes of a topic on all connections of the node", "topic node direction"),
    ("ros_topic_publishers", "Registered publishers", "topic"),
    ("ros_topic_subscribers", "Registered subscribers", "topic"),
    ("ros_topic_connections", "Open connections of a topic by the node's word", "topic node direction"),
    ("ros_service_up", "Whether a service answers the handshake of a client", "service node"),
    ("ros_action_goals", "Goals in an action's status by state", "action state"),
    (
        "ros_launch_process_up",
        "Whether a process that a launch file started is there; one that has done its work is not",
        "node",
    ),
    ("ros_launch_process_starts_total", "How many times a launch file's process was started by its roslaunch", "node"),
)


def families(snapshot: Snapshot) -> list[Family]:
    """Everything that comes from the polls. What is not known has no sample, rather than a zero."""
    ros = [family(name, about, labels, snapshot.ros.get(name, {})) for name, about, labels in ROS]
    return [*ros, *_own(snapshot)]


def _own(snapshot: Snapshot) -> list[Family]:
    """The exporter's metrics of itself."""
    polls = snapshot.history.polls
    asked = "Questions to the master or a node that got no usable answer"
    took, began = ({(): number} if polls else {} for number in (snapshot.duration, snapshot.at))
    return [
        family("ros_exporter_scrape_errors_total", asked, "reason", snapshot.history.errors),
        family("ros_exporter_polls_total", "Looks at the graph", "", {(): polls}),
        family("ros_exporter_poll_duration_seconds", "How long the last look took", "", took),
        family("ros_exporter_last_poll_timestamp_seconds", "When the last look began", "", began),
    ]


def claim_families(used: Mapping[str, int], capacity: Mapping[str, int]) -> list[Family]:
    """Persistent claims: what their directories hold, and what they were made for."""
    asked = {name: capacity[name] for name in used if name in capacity}
    sized = "Size that a claim asks for; nothing enforces it on a node's disk"
    return [
        family("rosops_claim_used_bytes", "Bytes on disk in a claim's directory", "claim", used),
        family("rosops_claim_capacity_bytes", sized, "claim", asked),
    ]


# ---- how many


def bounded(families: Iterable[Family], most: int = MOST) -> list[Family]:
    """The families without anonymous nodes, and no more than so many samples: the largest are left out, as a whole.

    How many samples that are has a family of its own.
    """
    lasting = (one._replace(samples=[it for it in one.samples if not _is_passing(it[0])]) for one in families)
    rising = sorted(lasting, key=lambda one: len(one.samples))
    totals = accumulate(len(one.samples) for one in rising)
    kept = [one for one, total in zip(rising, totals) if total <= most]
    left_out = sum(len(one.samples) for one in rising[len(kept) :])
    about = "Samples of metrics that are left out, as there are more than the exporter shows"
    return [*kept, family(LEFT_OUT, about, "", {(): left_out})]


def _is_passing(labels: Mapping[str, str]) -> bool:
    """Whether it is of an anonymous node, or of what only that has: it never comes again by this name."""
    return any(key in NAMES and _ANONYMOUS.search(word) for key, word in labels.items())


# ---- as text


def text(families: Iterable[Family]) -> bytes:
    """The whole answer to a scrape. A family without samples is left out: its lines would say nothing."""
    lines = []
    for one in families:
        if not one.samples:
            continue
        name = one.name[: -len(TOTAL)] if one.kind == COUNTER else one.name
        lines += [f"# TYPE {name} {one.kind}", f"# HELP {name} {escaped(one.help)}"]
        for labels, value in one.samples:
            inner = ",".join(f'{key}="{escaped(word)}"' for key, word in sorted(labels.items()))
            lines.append(f"{one.name}{{{inner}}} {number(value)}" if inner else f"{one.name} {number(value)}")
    return "\n".join([*lines, "# EOF\n"]).encode(errors="replace")


def escaped(word: str) -> str:
    return word.replace("\\", r"\\").replace("\n", r"\n").replace('"', r"\"")


def number(value: float) -> str:
    if math.isnan(value):
        return "NaN"
    return repr(float(value)) if math.isfinite(value) else f"{'+' if value > 0 else '-'}Inf"
