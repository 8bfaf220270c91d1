# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""However many names somebody brings into the graph, the series of an exporter stay few."""

from __future__ import annotations

import pytest
from ansible_collections.rosops.fleet.plugins.module_utils._exporter import bounds
from ansible_collections.rosops.fleet.plugins.module_utils._exporter.bounds import bounded, stable
from ansible_collections.rosops.fleet.plugins.module_utils._exporter.families import COUNTER, GAUGE, Family, families
from ansible_collections.rosops.fleet.plugins.module_utils._exporter.snapshot import GraphMetrics, Snapshot
from ansible_collections.rosops.fleet.plugins.module_utils._ros.bus_stats import IN, OUT, Count

COME_AND_GO = ["/rostopic_4711_1700000000000", "/rostopic_4712_1700000000999"]


def left_out(found: list[Family]) -> float:
    return next(family.samples[0][1] for family in found if family.name == bounds.LEFT_OUT)


def shown(found: list[Family], name: str) -> list[tuple[dict[str, str], float]]:
    return [(dict(labels), value) for family in found if family.name == name for labels, value in family.samples]


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("/rostopic_4711_1700000000000", "/rostopic_*"),
        ("/rviz_1700000000123456789", "/rviz_*"),
        ("/listener_12_1700000000000/debug", "/listener_*/debug"),
        ("/temperature_732a4ce7", "/temperature_732a4ce7"),
        ("/camera_2024", "/camera_2024"),
        ("/run_12_1700000000000x", "/run_12_1700000000000x"),
    ],
)
def test_names_without_their_process(name: str, expected: str) -> None:
    assert stable(name) == expected


def metrics(names: list[str], up: bool = True) -> list[Family]:
    flow = ("/chatter", IN)
    graph = GraphMetrics(
        True,
        {"/talker": True, **dict.fromkeys(names, up)},
        {"/talker": {("/chatter", OUT): Count(7, 70)}, **{name: {flow: Count(3, 30)} for name in names}},
        connections={("/chatter", name, IN): 1 for name in names},
    )
    return bounded(families(Snapshot(graph, {}, 1)))


def test_tools_that_come_and_go_leave_one_series() -> None:
    for names in (COME_AND_GO, COME_AND_GO[:1], COME_AND_GO[1:]):
        found = metrics(names)
        assert shown(found, "ros_node_up") == [({"node": "/talker"}, 1.0), ({"node": "/rostopic_*"}, 1.0)]
        together = {"topic": "/chatter", "node": "/rostopic_*", "direction": "in"}
        assert shown(found, "ros_topic_connections") == [(together, float(len(names)))]
        # a sum of counters that come and go would jump
        assert [labels["node"] for labels, _n in shown(found, "ros_topic_messages_total")] == ["/talker"]
        assert left_out(found) == 0


def test_one_of_those_that_is_down_is_seen() -> None:
    assert ({"node": "/rostopic_*"}, 0.0) in shown(metrics(COME_AND_GO, up=False), "ros_node_up")


def many(name: str, number: int, kind: str = GAUGE) -> Family:
    return Family(name, kind, "", [({"topic": f"/t{one:05d}"}, float(one)) for one in reversed(range(number))])


def test_a_node_with_thousands_of_topics_does_not_fill_the_database() -> None:
    graph = GraphMetrics(
        True,
        {"/bad": True},
        {"/bad": {(f"/t{number}", OUT): Count(1, 1) for number in range(20_000)}},
        {f"/t{number}": 1 for number in range(20_000)},
    )
    found = bounded(families(Snapshot(graph, {}, 1)))
    assert sum(len(family.samples) for family in found) <= bounds.MOST + 1
    assert shown(found, "ros_node_up") == [({"node": "/bad"}, 1.0)]
    assert left_out(found) > 30_000


def test_the_small_families_are_whole_and_the_large_ones_share_the_rest() -> None:
    found = bounded([many("a", 3), many("b", 500), many("c", 40), many("d", 500, COUNTER)], 143)
    assert [len(family.samples) for family in found[:4]] == [3, 50, 40, 50]
    assert left_out(found) == 900
    # always the same ones
    assert [labels["topic"] for labels, _n in found[1].samples][:2] == ["/t00000", "/t00001"]


@pytest.mark.parametrize("sizes", [[], [0], [5, 5], [10]])
def test_what_fits_stays_as_it_is(sizes: list[int]) -> None:
    given = [many(str(number), size) for number, size in enumerate(sizes)]
    found = bounded(given, 10)
    assert (found[:-1], left_out(found)) == (given, 0)
