# SPDX-License-Identifier: GPL-3.0-or-later
"""What is worth a line: once, under its cause, since when, and what to do next."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from ansible_collections.rosops.fleet.plugins.plugin_utils._report.attention import RUNBOOKS, attention
from ansible_collections.rosops.fleet.plugins.plugin_utils._report.rows import Status
from ansible_collections.rosops.fleet.plugins.plugin_utils._report.text import since_words, summary_text
from ansible_collections.rosops.fleet.tests.unit.plugins.plugin_utils._report.a_fleet import (
    EDGE_OFF,
    OFF,
    UP,
    app,
    status,
)

DOCS = Path(__file__).resolve().parents[5] / "docs" / "runbooks"
LOST = "2026-11-24T16:00:00Z"
NOW = "2026-11-24T16:12:30Z"
MISSED = {"host": "robot2", "outcome": "deferred-offline", "playbook": "update.yml", "started": "2026-11-24T09:00:00Z"}
SILENT = {"where": "cluster edge", "what": "does not answer", "todo": "look", "cluster": "edge"}
STOPPED = {"name": "robot1", "ready": False, "reason": "KubeletStopped"}
DOWN = {"robot": "robot1", "name": "/sensor", "app": "sensor", "at": "robot1", "reachable": False, "error": "x"}
UNREAD = {"where": "ROS graph of robot1", "what": "no answer", "graph": "robot1"}
UNREAD_TOO = {**UNREAD, "where": "ROS graph of robot2", "graph": "robot2"}
LATER = {**OFF, "name": "robot3"}
ENDED = {"robot": "robot1", "app": "base", "node": "/map", "host": "10.42.0.7"}


def test_what_goes_with_a_robot_that_is_off_stands_with_it() -> None:
    sections = {
        "hosts": [UP, OFF],
        "nodes": [{"name": "robot2", "ready": False, "reason": "NodeStatusUnknown", "since": LOST}],
        "masters": [app("robot2", name="ros-master")],
        "apps": [app("robot1", note="CrashLoopBackOff"), app("robot2"), app("robot2", name="stats", nodes=["edge1"])],
        "claims": [{"name": "logs", "robot": "robot2", "bound": True, "size": "1Gi", "used_bytes": None}],
        "outcomes": [MISSED],
    }
    found = attention(status(**sections))
    assert [(one.level, one.told.where, one.told.what) for one in found] == [
        ("bad", "app sensor of robot1", "0 of 1 ready: CrashLoopBackOff"),
        ("bad", "app stats of robot2", "0 of 1 ready"),  # the one at the edge has no such excuse
        ("warn", "host robot2", "offline: timed out"),
    ]
    off = found[-1]
    assert (off.told.since, off.told.runbook) == (LOST, "RobotOffline")
    assert off.takes == [
        "node robot2", "ROS master of robot2", "app sensor of robot2", "claim logs of robot2",
        "last update.yml on robot2",
    ]  # fmt: skip
    [off] = attention(status(hosts=[OFF], outcomes=[MISSED]))  # its node has said nothing
    assert off.told.since == MISSED["started"]


@pytest.mark.parametrize(
    ("sections", "findings"),
    [
        (
            {"hosts": [EDGE_OFF], "apps": [app("robot1", nodes=["edge1"]), app("robot2", nodes=["edge1"])]},
            {"host edge1": ["app sensor of robot1, app sensor of robot2"]},
        ),
        ({"hosts": [EDGE_OFF], "problems": [SILENT]}, {"host edge1": ["cluster edge"]}),
        (
            {"hosts": [EDGE_OFF, {**EDGE_OFF, "name": "edge2", "reachable": True}], "problems": [SILENT]},
            {"host edge1": [], "cluster edge": []},  # which has a reason of its own
        ),
        (
            {"hosts": [OFF], "ros_nodes": [{**DOWN, "robot": "(shared)", "at": "robot2"}]},
            {"host robot2": ["ROS node /sensor of (shared)"]},
        ),
        (
            {"hosts": [OFF, LATER], "masters": [app("robot2", name="ros-master")], "problems": [UNREAD_TOO]},
            {"host robot2": ["ROS master of robot2", "ROS graph of robot2"], "host robot3": []},
        ),
        ({"hosts": [UP], "nodes": [STOPPED], "apps": [app("robot1")]}, {"node robot1": ["app sensor of robot1"]}),
        (
            {"apps": [app("robot1")], "ros_nodes": [DOWN, {**DOWN, "app": "", "name": "/by-hand"}]},
            {"app sensor of robot1": ["ROS node /sensor of robot1"], "ROS node /by-hand of robot1": []},
        ),
        (
            {"masters": [app("robot1", name="ros-master")], "problems": [UNREAD]},
            {"ROS master of robot1": ["ROS graph of robot1"]},
        ),
    ],
)
def test_a_cause_takes_along_what_depends_on_it(sections: dict[str, Any], findings: dict[str, list[str]]) -> None:
    assert {one.told.where: one.takes for one in attention(status(**sections))} == findings


@pytest.mark.parametrize(
    ("section", "row", "where", "what"),
    [
        (
            "links", {"robot": "robot1", "name": "/scan", "broken": [["/lidar", "/slam"]]}, "topic /scan of robot1",
            "/lidar is not connected to /slam",
        ),
        ("ended", ENDED, "app base of robot1", "/map has ended; its exit code is in the pod's log alone"),
        (
            "ended", {**ENDED, "app": ""}, "launch file at 10.42.0.7 of robot1",
            "/map has ended; its exit code is in the pod's log alone",
        ),
    ],
)  # fmt: skip
def test_what_is_for_a_person_to_judge_is_a_warning(section: str, row: dict[str, Any], where: str, what: str) -> None:
    [one] = attention(status(**{section: [row]}))
    assert (one.level, one.told.where, one.told.what) == ("warn", where, what)


@pytest.mark.parametrize(
    ("section", "row", "todo"),
    [
        ("apps", app("robot1", note="CrashLoopBackOff: 3 restarts", ended="again"), "logs deploy/sensor --previous"),
        ("apps", app("robot1", note="Unschedulable"), "describe pod -l rosops.fleet/app=sensor"),
        ("nodes", {"name": "robot1", "ready": True, "reason": "cordoned"}, "k3s kubectl uncordon robot1"),
        ("nodes", STOPPED, "-a 'systemctl status k3s k3s-agent'"),
        ("ended", ENDED, "k3s kubectl -n robot-robot1 logs deploy/base"),
        ("ended", {**ENDED, "app": ""}, ""),
        ("claims", {"name": "c", "robot": "r", "namespace": "n", "bound": False}, "k3s kubectl -n n describe pvc c"),
        ("claims", {"name": "c", "robot": "r", "bound": True, "size": "1Ki", "used_bytes": 1000}, "get pvc c"),
        ("outcomes", {**MISSED, "outcome": "failed"}, "rosops.fleet.update --limit robot2 --check --diff"),
        ("outcomes", {**MISSED, "playbook": "mine.yml", "outcome": "deferred-busy"}, "mine.yml --limit robot2"),
        ("went_back", {"name": "a", "robot": "r", "before": "2", "after": "1", "reason": "", "at": LOST}, "ros-keeper"),
        ("ros_nodes", {"name": "/a", "robot": "r", "app": "b", "reachable": False}, "logs deploy/b --since 10m"),
    ],
)  # fmt: skip
def test_what_to_do_next(section: str, row: dict[str, Any], todo: str) -> None:
    [one] = attention(status(**{section: [row]}))
    assert one.told.todo.endswith(todo) and "again" not in one.told.what  # a loop says by itself how it ended
    assert not one.told.runbook or (DOCS / f"{one.told.runbook}.md").is_file()


def test_the_screen_says_it_whole() -> None:
    reason = "Data could not be sent to remote host. Make sure this host can be reached over ssh: " + "x" * 200
    found = status(hosts=[UP, {**OFF, "reason": reason}], nodes=[{"name": "robot2", "ready": False, "since": LOST}])
    assert (
        summary_text(found, NOW, "my-fleet")
        == f"""\
FLEET my-fleet

NEEDS ATTENTION
  ! host robot2: offline: {reason}
      since    2026-11-24 16:00:00 UTC (12 min)
      with it  node robot2
      do       ansible robot2 -m ansible.builtin.ping
      see      {RUNBOOKS}/RobotOffline.md

SUMMARY
  hosts      1 of 2 up, 1 not
  nodes      0 of 1 ready, 1 unknown (robot2)
  ROS nodes  robot2 unknown
"""
    )


def test_a_fleet_without_a_finding_says_so() -> None:
    assert summary_text(status(hosts=[UP]), NOW) == "NEEDS ATTENTION\n  nothing\n\nSUMMARY\n  hosts  1 of 1 up\n"
    assert summary_text(Status(), NOW).endswith("SUMMARY\n  nothing was found\n")


def test_what_comes_from_elsewhere_moves_no_cursor() -> None:
    text = summary_text(status(hosts=[{**OFF, "reason": "a\x1b[2J\nforged: line"}]), NOW)
    assert "\x1b" not in text and "\nforged" not in text


@pytest.mark.parametrize(
    ("since", "words"),
    [
        ("2026-11-24T16:12:30Z", "2026-11-24 16:12:30 UTC (just now)"),
        ("2026-11-21T16:12:30Z", "2026-11-21 16:12:30 UTC (3 d)"),
        ("whenever", "whenever"),
        ("2026-11-24T16:12:30", "2026-11-24T16:12:30"),  # no zone: nobody knows how long ago
        ("", ""),
    ],
)
def test_since_when(since: str, words: str) -> None:
    assert since_words(since, NOW) == words
