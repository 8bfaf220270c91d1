# SPDX-License-Identifier: GPL-3.0-or-later
"""What a scrape shows: how many series, and its text against prometheus_client's real parser and exposition."""

from __future__ import annotations

import math
import os
from collections.abc import Iterable
from typing import Any

import pytest
from ansible_collections.rosops.fleet.plugins.module_utils._exporter import families as metrics_of
from ansible_collections.rosops.fleet.plugins.module_utils._exporter import updates
from ansible_collections.rosops.fleet.plugins.module_utils._exporter.families import (
    CONTENT_TYPE,
    COUNTER,
    GAUGE,
    Family,
    bounded,
    claim_families,
    families,
    text,
)
from ansible_collections.rosops.fleet.plugins.module_utils._exporter.snapshot import History, Snapshot
from ansible_collections.rosops.fleet.plugins.module_utils._ros.bus_stats import OUT
from hypothesis import given, settings
from hypothesis import strategies as st
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


WORDS = st.text(st.characters(exclude_categories=["Cs"]), max_size=12)
LABELS = st.dictionaries(st.sampled_from(["topic", "node", "state"]), WORDS)
GAUGES = st.lists(st.tuples(LABELS, st.floats(allow_nan=False)), unique_by=lambda one: tuple(sorted(one[0].items())))
COUNTERS = st.lists(
    st.tuples(LABELS, st.floats(0, allow_infinity=False)), unique_by=lambda one: tuple(sorted(one[0].items()))
)


@settings(max_examples=100 if os.environ.get("ROSOPS_TEST_ALL") else 40, deadline=None)
@given(WORDS, GAUGES, COUNTERS)
def test_whatever_is_in_it_comes_back_from_the_real_parser(help_: str, gauges: Any, counters: Any) -> None:
    made = [Family("ros_up", GAUGE, help_, gauges), Family("ros_messages_total", COUNTER, help_, counters)]
    assert parsed(text(made)) == expected(made)


def test_values_that_are_none_and_what_it_is() -> None:
    assert (
        text([Family("x", GAUGE, "", [({}, math.nan)]), Family("y", GAUGE, "", [])])
        == b"# TYPE x gauge\n# HELP x \nx NaN\n# EOF\n"
    )
    assert CONTENT_TYPE == exposition.CONTENT_TYPE_LATEST


def test_every_family_that_the_exporter_has_is_good_style() -> None:
    """As `promtool check metrics` and Prometheus want it: one family per name, one sample per set of labels."""
    words = {"": (), "node": "/n", "topic": "/t"}
    graph = {name: {words.get(labels, tuple(labels.split())): 1.0} for name, _about, labels in metrics_of.ROS}
    update = updates.Update("", "", "2", 1.0, 2.0, 0.5, {"gate": 1.0}, "1", "a", "drain", "updated")
    seen = Snapshot(graph, History(polls=1))
    made = [*families(seen), *claim_families({"data": 1}, {"data": 2}), *updates.families([update])]
    assert len({family.name for family in made}) == len(made)
    for family in made:
        assert family.help
        assert family.help[-1] != "."
        assert family.name.endswith("_total") == (family.kind == COUNTER)
        assert not family.name.endswith(("_count", "_sum", "_bucket", "_info")) or family.name == "robot_update_info"
        keys = [tuple(sorted(labels.items())) for labels, _value in family.samples]
        assert len(set(keys)) == len(keys)
    assert parsed(text(made)) == expected(made)


# ---- however many names somebody brings into the graph


def left_out(found: list[Family]) -> float:
    return next(family.samples[0][1] for family in found if family.name == metrics_of.LEFT_OUT)


def shown(found: list[Family], name: str) -> list[tuple[dict[str, str], float]]:
    return [(dict(labels), value) for family in found if family.name == name for labels, value in family.samples]


@pytest.mark.parametrize(
    ("name", "passes"),
    [
        ("/rostopic_4711_1700000000000", True),
        ("/rviz_1700000000123456789", True),
        ("/listener_12_1700000000000/debug", True),
        ("/temperature_732a4ce7", False),
        ("/camera_2024", False),
        ("/run_12_1700000000000x", False),
    ],
)
@pytest.mark.parametrize("kind", [GAUGE, COUNTER])
def test_a_name_that_never_comes_again_leaves_no_series(name: str, passes: bool, kind: str) -> None:
    samples = [({"topic": "/chatter", "node": one}, 1.0) for one in ("/talker", name)]
    found = bounded([Family("ros_x", kind, "", samples)])
    assert shown(found, "ros_x") == samples[: 1 if passes else 2]
    assert left_out(found) == 0
    update = Family("robot_update_info", GAUGE, "", [({"id": name}, 1.0)])  # no name of the graph
    assert bounded([update])[0] == update


def many(name: str, number: int, kind: str = GAUGE) -> Family:
    return Family(name, kind, "", [({"topic": f"/t{one:05d}"}, float(one)) for one in reversed(range(number))])


def test_a_node_with_thousands_of_topics_does_not_fill_the_database() -> None:
    flows = {(f"/t{number}", "/bad", OUT): 1.0 for number in range(20_000)}
    graph = {"ros_node_up": {"/bad": 1.0}, "ros_topic_messages_total": flows, "ros_topic_bytes_total": flows}
    found = bounded(families(Snapshot(graph)))
    assert sum(len(family.samples) for family in found) <= metrics_of.MOST + 1
    assert shown(found, "ros_node_up") == [({"node": "/bad"}, 1.0)]
    assert left_out(found) > 30_000


def test_the_largest_families_are_left_out_as_a_whole() -> None:
    found = bounded([many("a", 3), many("b", 500), many("c", 40), many("d", 500, COUNTER)], 543)
    assert {family.name: len(family.samples) for family in found[:-1]} == {"a": 3, "c": 40, "b": 500}
    assert left_out(found) == 500
    assert left_out(bounded([many("a", 3), many("b", 500)], 502)) == 500


@pytest.mark.parametrize("sizes", [[], [0], [5, 5], [10]])
def test_what_fits_stays_as_it_is(sizes: list[int]) -> None:
    given = [many(str(number), size) for number, size in enumerate(sizes)]
    found = bounded(given, 10)
    assert (found[:-1], left_out(found)) == (given, 0)
