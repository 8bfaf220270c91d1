# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""What a person sees first: how good each row is, and what is worth a line."""

from __future__ import annotations

from typing import Any

import pytest
from ansible_collections.rosops.fleet.plugins.plugin_utils._report.glance import (
    attention,
    counts,
    host_lines,
    hosts_off,
    level,
    used_share,
)

UP = {"name": "robot1", "group": "robots", "reachable": True}
OFF = {"name": "robot2", "group": "robots", "reachable": False, "reason": "timed out"}
EDGE_OFF = {"name": "edge1", "group": "edge", "reachable": False}


def app(robot: str, ready: int = 1, **more: Any) -> dict[str, Any]:
    return {"name": "sensor", "robot": robot, "ready": ready, "wanted": 1, "nodes": [robot], "note": "", **more}


@pytest.mark.parametrize(
    ("section", "row", "expected"),
    [
        ("hosts", UP, "ok"),
        ("hosts", OFF, "warn"),
        ("hosts", EDGE_OFF, "bad"),
        ("nodes", {"ready": True, "reason": ""}, "ok"),
        ("nodes", {"ready": True, "reason": "cordoned"}, "warn"),
        ("nodes", {"ready": False, "reason": "NodeStatusUnknown"}, "bad"),
        ("apps", app("robot1"), "ok"),
        ("apps", app("robot1", 0), "bad"),
        ("apps", app("robot1", 0, wanted=0), "ok"),
        ("went_back", {"name": "sensor"}, "warn"),
        ("ended", {"node": "/map"}, "warn"),
        ("ros_nodes", {"reachable": False}, "bad"),
        ("claims", {"bound": False}, "bad"),
        ("claims", {"bound": True, "size": "1Ki", "used_bytes": 900}, "ok"),
        ("claims", {"bound": True, "size": "1Ki", "used_bytes": 930}, "warn"),
        ("claims", {"bound": True, "size": "1Gi", "used_bytes": None}, "ok"),
        ("outcomes", {"outcome": "updated"}, "ok"),
        ("outcomes", {"outcome": "deferred-busy"}, "warn"),
        ("outcomes", {"outcome": "rolled-back"}, "bad"),
        ("topics", {"rate": 0.0}, ""),
    ],
)
def test_how_good_a_row_is(section: str, row: dict[str, Any], expected: str) -> None:
    assert level(section, row) == expected


def test_what_goes_with_a_robot_that_is_off_is_no_fault_of_its_own() -> None:
    status = {
        "hosts": [UP, OFF],
        "nodes": [{"name": "robot2", "ready": False, "reason": "NodeStatusUnknown"}],
        "apps": [app("robot1", 0, note="CrashLoopBackOff"), app("robot2", 0), app("robot2", 0, nodes=["edge1"])],
        "outcomes": [{"host": "robot2", "outcome": "deferred-offline", "playbook": "update.yml"}],
    }
    assert [(row["level"], row["where"], row["what"]) for row in attention(status)] == [
        ("bad", "app sensor of robot1", "0 of 1 ready: CrashLoopBackOff"),
        ("bad", "app sensor of robot2", "0 of 1 ready"),  # the one on edge1
        ("warn", "host robot2", "offline: timed out"),
    ]
    assert [level("apps", row, hosts_off(status)) for row in status["apps"]] == ["bad", "warn", "bad"]


def test_who_has_ended_in_a_launch_file_is_for_a_person_to_judge() -> None:
    known = {"robot": "robot1", "app": "base", "node": "/map", "host": "10.42.0.7"}
    status = {"hosts": [UP], "ended": [known, {**known, "app": ""}]}
    what = "/map has ended; its exit code is in the pod's log alone"
    assert [(row["level"], row["where"], row["what"]) for row in attention(status)] == [
        ("warn", "app base of robot1", what),
        ("warn", "launch file at 10.42.0.7 of robot1", what),
    ]


def test_what_an_edge_host_takes_with_it_is_told() -> None:
    status = {"hosts": [EDGE_OFF], "apps": [app("robot1", 0, nodes=["edge1"])]}
    assert [row["where"] for row in attention(status)] == ["host edge1", "app sensor of robot1"]


def test_a_pod_that_is_on_no_node_is_nobodys_absence() -> None:
    assert level("apps", app("robot2", 0, nodes=[]), {"robot2"}) == "bad"


def test_counts_leave_out_what_there_is_nothing_of() -> None:
    assert counts({}) == []
    assert counts({"hosts": [UP, OFF, EDGE_OFF], "apps": []}) == [
        {"label": "Hosts up", "section": "hosts", "good": 1, "total": 3, "level": "bad"}
    ]


def test_a_line_per_host() -> None:
    status = {
        "hosts": [UP, OFF],
        "nodes": [{"name": "robot1", "ready": True, "reason": ""}],
        "masters": [app("robot1")],
        "apps": [app("robot1"), app("robot1", 0)],
        "ros_nodes": [{"robot": "robot1", "reachable": True}],
        "topics": [{"robot": "robot1", "rate": 10.0}, {"robot": "robot1", "rate": None}],
        "outcomes": [{"host": "robot1", "outcome": "updated"}],
    }
    first, second = host_lines(status)
    assert first == {
        "host": "robot1",
        "group": "robots",
        "state": "up",
        "node": "Ready",
        "master": "1/1",
        "apps": "1/2",
        "ros_nodes": "1/1",
        "topics": 2,
        "messages": 10.0,
        "outcome": "updated",
        "level": "bad",
    }
    assert (second["state"], second["node"], second["apps"], second["messages"], second["level"]) == (
        "offline",
        "",
        "",
        None,
        "warn",
    )


@pytest.mark.parametrize(
    ("size", "used", "share"),
    [("1Ki", 512, 0.5), ("", 512, None), ("much", 512, None), ("1Ki", None, None), ("0", 1, None)],
)
def test_how_full_a_claim_is(size: str, used: int | None, share: float | None) -> None:
    assert used_share({"size": size, "used_bytes": used}) == share
