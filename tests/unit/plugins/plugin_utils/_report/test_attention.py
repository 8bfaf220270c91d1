# SPDX-License-Identifier: GPL-3.0-or-later
"""What is worth a line: once, under its cause, since when, and what to do next."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from ansible_collections.rosops.fleet.plugins.plugin_utils._model.keys import read
from ansible_collections.rosops.fleet.plugins.plugin_utils._report.attention import RUNBOOKS, Finding
from ansible_collections.rosops.fleet.plugins.plugin_utils._report.attention import attention as of_status
from ansible_collections.rosops.fleet.plugins.plugin_utils._report.rows import Status
from ansible_collections.rosops.fleet.plugins.plugin_utils._report.text import since_words
from ansible_collections.rosops.fleet.plugins.plugin_utils._report.text import summary_text as of_fleet

DOCS = Path(__file__).resolve().parents[5] / "docs" / "runbooks"
UP = {"name": "robot1", "group": "robots", "role": "agent", "cluster": "edge", "reachable": True}
OFF = {**UP, "name": "robot2", "reachable": False, "reason": "timed out"}
EDGE_OFF = {"name": "edge1", "group": "edge", "role": "server", "cluster": "edge", "reachable": False}
LOST = "2026-11-24T16:00:00Z"
NOW = "2026-11-24T16:12:30Z"
MISSED = {"host": "robot2", "outcome": "deferred-offline", "playbook": "update.yml", "started": "2026-11-24T09:00:00Z"}


def app(robot: str, ready: int = 0, **more: Any) -> dict[str, Any]:
    row = {"name": "sensor", "namespace": f"robot-{robot}", "robot": robot, "ready": ready, "wanted": 1}
    return {**row, "nodes": [robot], "note": "", **more}


def attention(sections: dict[str, Any]) -> list[Finding]:
    return of_status(read(Status, sections))


def summary_text(sections: dict[str, Any], now: str, name: str = "") -> str:
    return of_fleet(read(Status, sections), now, name)


def lines(found: list[Finding]) -> list[tuple[str, str, str]]:
    return [(one.level, one.told.where, one.told.what) for one in found]


def test_what_goes_with_a_robot_that_is_off_stands_with_it() -> None:
    status = {
        "hosts": [UP, OFF],
        "nodes": [{"name": "robot2", "ready": False, "reason": "NodeStatusUnknown", "since": LOST}],
        "masters": [app("robot2", name="ros-master")],
        "apps": [app("robot1", note="CrashLoopBackOff"), app("robot2"), app("robot2", name="stats", nodes=["edge1"])],
        "claims": [{"name": "logs", "robot": "robot2", "bound": True, "size": "1Gi", "used_bytes": None}],
        "outcomes": [MISSED],
    }
    found = attention(status)
    assert lines(found) == [
        ("bad", "app sensor of robot1", "0 of 1 ready: CrashLoopBackOff"),
        ("bad", "app stats of robot2", "0 of 1 ready"),  # the one at the edge has no such excuse
        ("warn", "host robot2", "offline: timed out"),
    ]
    off = found[-1]
    assert (off.told.since, off.told.runbook) == (LOST, "RobotOffline")
    assert off.takes == [
        "node robot2", "ROS master of robot2", "app sensor", "claim logs", "last run update.yml deferred-offline",
    ]  # fmt: skip


def test_without_a_word_of_its_node_a_host_is_off_since_the_run_that_missed_it() -> None:
    [off] = attention({"hosts": [OFF], "outcomes": [MISSED]})
    assert off.told.since == MISSED["started"]


def test_what_an_edge_host_takes_with_it_stands_with_it() -> None:
    [off] = attention({"hosts": [EDGE_OFF], "apps": [app("robot1", nodes=["edge1"]), app("robot2", nodes=["edge1"])]})
    assert (off.level, off.told.where, off.takes) == ("bad", "host edge1", ["2 apps: sensor, sensor"])


def test_a_cluster_is_silent_because_its_servers_are_off_or_for_a_reason_of_its_own() -> None:
    silent = {"where": "cluster edge", "what": "does not answer", "todo": "look", "cluster": "edge"}
    [off] = attention({"hosts": [EDGE_OFF], "problems": [silent]})
    assert off.takes == ["cluster edge"]
    found = attention({"hosts": [EDGE_OFF, {**EDGE_OFF, "name": "edge2", "reachable": True}], "problems": [silent]})
    assert [one.told.where for one in found] == ["host edge1", "cluster edge"]


def test_a_node_that_is_not_ready_is_the_cause_of_what_runs_there() -> None:
    status = {"hosts": [UP], "nodes": [{"name": "robot1", "ready": False, "reason": "KubeletStopped"}]}
    [node] = attention({**status, "apps": [app("robot1")]})
    assert (node.told.where, node.takes) == ("node robot1", ["app sensor"])
    assert "systemctl status" in node.told.todo


def test_ros_nodes_and_the_graph_are_down_with_what_they_run_in() -> None:
    down = {"robot": "robot1", "name": "/sensor", "app": "sensor", "at": "robot1", "reachable": False, "error": "x"}
    problem = {"where": "ROS graph of robot1", "what": "no answer", "graph": "robot1"}
    found = attention({"apps": [app("robot1")], "ros_nodes": [down, {**down, "app": "", "name": "/by-hand"}]})
    assert [(one.told.where, one.takes) for one in found] == [
        ("app sensor of robot1", ["ROS node /sensor"]),
        ("ROS node /by-hand of robot1", []),
    ]
    [master] = attention({"masters": [app("robot1", name="ros-master")], "problems": [problem]})
    assert master.takes == ["ROS graph of robot1"]


def test_who_is_registered_and_alive_and_not_connected_is_told() -> None:
    link = {"robot": "robot1", "name": "/scan", "broken": [["/lidar", "/slam"]]}
    [one] = attention({"links": [link, {**link, "name": "/odom", "broken": []}]})
    assert lines([one]) == [("warn", "topic /scan of robot1", "/lidar is not connected to /slam")]


def test_who_has_ended_in_a_launch_file_is_for_a_person_to_judge() -> None:
    known = {"robot": "robot1", "app": "base", "node": "/map", "host": "10.42.0.7"}
    found = attention({"hosts": [UP], "ended": [known, {**known, "app": ""}]})
    what = "/map has ended; its exit code is in the pod's log alone"
    assert lines(found) == [("warn", "app base of robot1", what), ("warn", "launch file at 10.42.0.7 of robot1", what)]
    assert [one.told.todo for one in found] == ["k3s kubectl -n robot-robot1 logs deploy/base", ""]


@pytest.mark.parametrize(
    ("section", "row", "todo"),
    [
        ("apps", app("robot1", note="CrashLoopBackOff: 3 restarts", ended="again"), "logs deploy/sensor --previous"),
        ("apps", app("robot1", note="Unschedulable"), "describe pod -l rosops.fleet/app=sensor"),
        ("nodes", {"name": "robot1", "ready": True, "reason": "cordoned"}, "k3s kubectl uncordon robot1"),
        ("claims", {"name": "c", "robot": "r", "namespace": "n", "bound": False}, "k3s kubectl -n n describe pvc c"),
        ("claims", {"name": "c", "robot": "r", "bound": True, "size": "1Ki", "used_bytes": 1000}, "get pvc c"),
        ("outcomes", {**MISSED, "outcome": "failed"}, "rosops.fleet.update --limit robot2 --check --diff"),
        ("outcomes", {**MISSED, "playbook": "mine.yml", "outcome": "deferred-busy"}, "mine.yml --limit robot2"),
        ("went_back", {"name": "a", "robot": "r", "before": "2", "after": "1", "reason": "", "at": LOST}, "ros-keeper"),
        ("ros_nodes", {"name": "/a", "robot": "r", "app": "b", "reachable": False}, "logs deploy/b --since 10m"),
    ],
)  # fmt: skip
def test_what_to_do_next(section: str, row: dict[str, Any], todo: str) -> None:
    [one] = attention({section: [row]})
    assert one.told.todo.endswith(todo) and "again" not in one.told.what  # a loop says by itself how it ended
    assert not one.told.runbook or (DOCS / f"{one.told.runbook}.md").is_file()


def test_the_screen_says_it_whole() -> None:
    reason = "Data could not be sent to remote host. Make sure this host can be reached over ssh: " + "x" * 200
    status = {"hosts": [UP, {**OFF, "reason": reason}], "nodes": [{"name": "robot2", "ready": False, "since": LOST}]}
    assert (
        summary_text(status, NOW)
        == f"""\
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
    assert summary_text({"hosts": [UP]}, NOW) == "NEEDS ATTENTION\n  nothing\n\nSUMMARY\n  hosts  1 of 1 up\n"
    assert summary_text({}, NOW).endswith("SUMMARY\n  nothing was found\n")


def test_the_screen_says_which_fleet() -> None:
    assert summary_text({"hosts": [UP]}, NOW, "my-fleet").startswith("FLEET my-fleet\n\nNEEDS ATTENTION\n")


def test_what_comes_from_elsewhere_moves_no_cursor() -> None:
    text = summary_text({"hosts": [{**OFF, "reason": "a\x1b[2J\nforged: line"}]}, NOW)
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
