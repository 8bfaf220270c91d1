# SPDX-License-Identifier: GPL-3.0-or-later
"""What a person sees first: how good each row is, and what is worth a line."""

from __future__ import annotations

from typing import Any

import pytest
from ansible_collections.rosops.fleet.plugins.plugin_utils._report.glance import counts, host_level, level
from ansible_collections.rosops.fleet.plugins.plugin_utils._report.page import host_columns
from ansible_collections.rosops.fleet.plugins.plugin_utils._report.rows import some
from ansible_collections.rosops.fleet.plugins.plugin_utils._report.text import grid
from ansible_collections.rosops.fleet.tests.unit.plugins.plugin_utils._report.a_fleet import (
    EDGE_OFF,
    OFF,
    UP,
    app,
    status,
)

HALF = {"bound": True, "size": "1Ki", "used_bytes": 512}


@pytest.mark.parametrize(
    ("section", "row", "expected"),
    [
        ("hosts", UP, "ok"),
        ("hosts", OFF, "warn"),
        ("hosts", EDGE_OFF, "bad"),
        ("nodes", {"ready": True, "reason": ""}, "ok"),
        ("nodes", {"ready": True, "reason": "cordoned"}, "warn"),
        ("nodes", {"ready": False, "reason": "NodeStatusUnknown"}, "bad"),
        ("apps", app("robot1", 1), "ok"),
        ("apps", app("robot1", 0), "bad"),
        ("apps", app("robot1", 0, wanted=0), "ok"),
        ("went_back", {"name": "sensor"}, "warn"),
        ("ended", {"node": "/map"}, "warn"),
        ("ros_nodes", {"reachable": False}, "bad"),
        ("claims", {"bound": False}, "bad"),
        ("claims", {**HALF, "used_bytes": 921}, "ok"),
        ("claims", {**HALF, "used_bytes": 922}, "warn"),
        *(
            ("claims", {**HALF, **unknown}, "ok")
            for unknown in ({"used_bytes": None}, {"size": ""}, {"size": "much"}, {"size": "0"})
        ),
        ("outcomes", {"outcome": "updated"}, "ok"),
        ("outcomes", {"outcome": "deferred-busy"}, "warn"),
        ("outcomes", {"outcome": "rolled-back"}, "bad"),
        ("topics", {"rate": 0.0}, ""),
    ],
)
def test_how_good_a_row_is(section: str, row: dict[str, Any], expected: str) -> None:
    assert level(*status(**{section: [row]}).rows(section)) == expected


def test_what_is_unknown_is_not_green() -> None:
    """A robot that is off keeps what the API last heard of it, and what it would have said is in no number."""
    found = status(
        hosts=[UP, OFF],
        nodes=[{"name": "robot1", "ready": True}, {"name": "robot2", "ready": False}],
        apps=[app("robot1", 1), app("robot1"), app("robot2"), app("robot2", 1)],
        ros_nodes=[{"robot": "robot1", "reachable": True}],
        claims=[{"robot": robot, "bound": True, "size": "1Gi", "used_bytes": used}
                for robot, used in (("robot1", 5), ("robot1", None), ("robot2", None))],
    )  # fmt: skip
    assert [(count.words, count.level) for count in counts(found)] == [
        ("1 of 2 up, 1 not", "warn"),
        ("1 of 2 ready, 1 unknown (robot2)", "warn"),
        ("2 of 4 ready, 1 not, 1 unknown (robot2)", "bad"),
        ("1 of 1 up, robot2 unknown", "warn"),
        ("2 of 3 in order, 1 unknown (robot2)", "warn"),
    ]


def test_a_graph_that_could_not_be_read_is_unknown_and_so_is_a_cluster() -> None:
    alone = {**OFF, "cluster": "robot2", "role": "server"}
    problems = [{"where": "a", "what": "b", "graph": "robot1"}, {"where": "c", "what": "d", "cluster": "robot2"}]
    found = {count.section: count.words for count in counts(status(hosts=[UP, alone], problems=problems))}
    assert found["ros_nodes"] == "robot1, robot2 unknown"
    assert found["apps"] == found["nodes"] == "robot2 unknown"
    shared = [{"robot": "(shared)", "reachable": True}]  # that of all robots
    assert [count.words for count in counts(status(hosts=[UP, OFF], ros_nodes=shared))][1:] == ["1 of 1 up"]


def test_many_names_are_a_few_and_a_number() -> None:
    assert some([f"robot{number}" for number in range(1, 31)]) == (
        "robot1, robot2, robot3, robot4, robot5, robot6 and 24 more"
    )


def test_a_line_per_host() -> None:
    found = status(
        hosts=[UP, OFF],
        nodes=[{"name": "robot1", "ready": True}],
        masters=[app("robot1", 1)],
        apps=[app("robot1", 1), app("robot1")],
        ros_nodes=[{"robot": "robot1", "reachable": True}],
        topics=[{"robot": "robot1", "rate": 10.0}, {"robot": "robot1"}],
        outcomes=[{"host": "robot1", "outcome": "updated"}],
    )
    assert grid(host_columns(found), found.hosts)[1] == [
        ["robot1", "robots", "up", "Ready", "1/1", "1/2", "1/1", 2, "10.0", "updated"],
        ["robot2", "robots", "offline", None, "", "", "", None, "", None],
    ]
    assert [host_level(found, host) for host in found.hosts] == ["bad", "warn"]
