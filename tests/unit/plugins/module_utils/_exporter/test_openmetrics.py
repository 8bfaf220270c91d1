# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""The text against the real parser of prometheus_client, and against what its own exposition makes of the same."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Any

from ansible_collections.rosops.fleet.plugins.module_utils._exporter import updates
from ansible_collections.rosops.fleet.plugins.module_utils._exporter.families import (
    COUNTER,
    GAUGE,
    Family,
    claim_families,
    families,
    statistics_families,
)
from ansible_collections.rosops.fleet.plugins.module_utils._exporter.openmetrics import CONTENT_TYPE, text
from ansible_collections.rosops.fleet.plugins.module_utils._exporter.snapshot import GraphMetrics, Snapshot
from hypothesis import given
from hypothesis import strategies as st
from prometheus_client.metrics_core import Metric
from prometheus_client.openmetrics import exposition
from prometheus_client.openmetrics.parser import text_string_to_metric_families


def parsed(made: bytes) -> list[tuple[str, str, str, list[tuple[str, dict[str, str], float]]]]:
    return [
        (one.name, one.type, one.documentation, [(sample.name, sample.labels, sample.value) for sample in one.samples])
        for one in text_string_to_metric_families(made.decode())
    ]


def expected(given_: Iterable[Family]) -> list[Any]:
    return [
        (
            family.name[: -len("_total")] if family.kind == COUNTER else family.name,
            family.kind,
            family.help,
            [(family.name, dict(labels), value) for labels, value in family.samples],
        )
        for family in given_
        if family.samples
    ]


class Official:
    """The same families in prometheus_client's own collector."""

    def __init__(self, given_: Iterable[Family]) -> None:
        self.families = given_

    def collect(self) -> Iterable[Any]:
        for name, kind, help_, samples in expected(self.families):
            metric = Metric(name, help_, kind)
            for sample, labels, value in samples:
                metric.add_sample(sample, labels, value)
            yield metric


def official(given_: Iterable[Family]) -> bytes:
    made: bytes = exposition.generate_latest(Official(given_))
    return made


WORDS = st.text(st.characters(exclude_categories=["Cs"]), max_size=12)
LABELS = st.dictionaries(st.sampled_from(["topic", "node", "state"]), WORDS)
GAUGES = st.lists(st.tuples(LABELS, st.floats(allow_nan=False)), unique_by=lambda one: tuple(sorted(one[0].items())))
COUNTERS = st.lists(
    st.tuples(LABELS, st.floats(0, allow_infinity=False)), unique_by=lambda one: tuple(sorted(one[0].items()))
)


@given(WORDS, GAUGES, COUNTERS)
def test_whatever_is_in_it_comes_back_from_the_real_parser(help_: str, gauges: Any, counters: Any) -> None:
    made = [Family("ros_up", GAUGE, help_, gauges), Family("ros_messages_total", COUNTER, help_, counters)]
    assert parsed(text(made)) == expected(made)


def test_line_for_line_as_the_real_exposition_makes_it() -> None:
    made = [
        Family("ros_master_up", GAUGE, "Whether it answers", [({}, 1.0)]),
        Family("ros_topic_messages_total", COUNTER, "Messages", [({"topic": '/a"\\\n', "node": "/n"}, 5.0)]),
        Family("ros_topic_latency_seconds", GAUGE, "Age", [({"topic": "/a"}, 1e-05), ({"topic": "/b"}, math.inf)]),
        Family("ros_node_up", GAUGE, "None of them", []),
    ]
    assert sorted(text(made).splitlines()) == sorted(official(made).splitlines())
    assert CONTENT_TYPE == exposition.CONTENT_TYPE_LATEST


def test_what_is_no_number() -> None:
    assert b"\nx NaN\n" in text([Family("x", GAUGE, "", [({}, math.nan)])])
    assert b"\nx -Inf\n" in text([Family("x", GAUGE, "", [({}, -math.inf)])])


def test_every_family_that_the_exporter_has_is_good_style() -> None:
    """As `promtool check metrics` and Prometheus want it: one family per name, one sample per set of labels."""
    links, goals = {("/t", "/n", "out"): 1}, {"/a": {"active": 1}}
    graph = GraphMetrics(True, {"/n": True}, connections=links, publishers={"/t": 1}, goals=goals)
    update = updates.Update("1", "a", "drain", "updated", "", "", "2", 1.0, 2.0, 0.5, {"gate": 1.0})
    made = [
        *families(Snapshot(graph, polls=1)),
        *claim_families({"data": 1}, {"data": 2}),
        *statistics_families([(("/t", "/p", "/s"), 0.5, 1)]),
        *updates.families([update]),
    ]
    assert len({family.name for family in made}) == len(made)
    for family in made:
        assert family.help
        assert family.help[-1] != "."
        assert family.name.endswith("_total") == (family.kind == COUNTER)
        assert not family.name.endswith(("_count", "_sum", "_bucket", "_info")) or family.name == "robot_update_info"
        keys = [tuple(sorted(labels.items())) for labels, _value in family.samples]
        assert len(set(keys)) == len(keys)
    assert parsed(text(made)) == expected(made)
