# SPDX-License-Identifier: GPL-3.0-or-later
"""Outcomes, durations and the screen of a run that is told step by step."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from ansible_collections.rosops.fleet.plugins.action import _robot_update
from ansible_collections.rosops.fleet.plugins.plugin_utils._report.results import ACTIONS
from ansible_collections.rosops.fleet.plugins.plugin_utils._report.run import RunReport, Task, screen

OK = {"ok": 1, "changed": 0, "failures": 0, "unreachable": 0}
CHANGED = {**OK, "changed": 1}
FAILED = {**OK, "failures": 1}
DARK = {"ok": 0, "unreachable": 1}
HOLDS = {"kind": "node", "name": "/talker", "verdict": "pass", "reason": ""}
SILENT = {"kind": "topic", "name": "/chatter", "verdict": "wait", "reason": "no publisher"}


def started(*hosts: str, **info: Any) -> RunReport:
    report = RunReport(0.0)
    report.play("Robots", hosts or ("robot1",), 1.0)
    report.task("t1", Task("Apply", "rosops.fleet.ros_ready", **info), 1.0)
    return report


def row(report: RunReport, host: str = "robot1", **stats: Any) -> dict[str, Any]:
    rows: list[dict[str, Any]] = report.finish(stats or {host: OK}, 9.0)["hosts"]
    return next(one for one in rows if one["host"] == host)


def outcome(report: RunReport, host: str = "robot1", **stats: Any) -> tuple[str, str]:
    found = row(report, host, **stats)
    return found["outcome"], found["reason"]


def declared(word: Any) -> tuple[str, dict[str, Any]]:
    return "ok", {"ansible_facts": {"fleet_outcome": word}}


CHANGES, LOST = ("ok", {"changed": True}), ("unreachable", {"msg": "no route"})
BUSY = {"outcome": "deferred-busy", "reason": "goal ACTIVE"}


@pytest.mark.parametrize(
    ("events", "counts", "expected"),
    [
        ([("ok", {"changed": False})], OK, ("unchanged", "")),
        ([CHANGES], CHANGED, ("updated", "")),
        ([("failed", {"failed": True, "msg": "Task failed: no such image"})], FAILED, ("failed", "no such image")),
        ([("failed", {"msg": "oh"})], {**OK, "rescued": 1}, ("unchanged", "")),
        ([CHANGES, LOST], {**DARK, "changed": 1}, ("deferred-offline", "no route")),
        ([CHANGES, LOST], OK, ("deferred-offline", "no route")),  # the play goes on without the host
        ([declared(BUSY)], CHANGED, ("deferred-busy", "goal ACTIVE")),
        ([declared(BUSY)], FAILED, ("deferred-busy", "goal ACTIVE")),
        ([declared({**BUSY, "steps": ["of another shape"]})], OK, ("deferred-busy", "goal ACTIVE")),
        ([declared("rolled-back")], FAILED, ("rolled-back", "")),
        ([declared("updated")], FAILED, ("failed", "")),
        ([declared("updated")], OK, ("updated", "")),
        ([declared("unchanged")], OK, ("unchanged", "")),
        ([("ok", {"ansible_facts": {"fleet_k3s_outcome": "rolled-back"}})], FAILED, ("rolled-back", "")),
        ([declared("unchanged")], {**OK, "changed": 2}, ("updated", "")),
        ([declared("splendid")], OK, ("unchanged", "")),
        ([declared({"outcome": "updated"})], DARK, ("deferred-offline", "")),
        ([("ok", {"ansible_facts": "nonsense"})], OK, ("unchanged", "")),
    ],
)
def test_what_becomes_of_a_host(
    events: list[tuple[str, dict[str, Any]]], counts: dict[str, int], expected: tuple[str, str]
) -> None:
    report = started()
    for at, (what, result) in enumerate(events):
        getattr(report, what)("t1", "robot1", result, 2.0 + at)
    assert outcome(report, robot1=counts) == expected


def test_changed_tasks_are_named_once_and_the_one_that_failed() -> None:
    report = started()
    report.ok("t1", "robot1", {"changed": True}, 2.0)
    report.ok("t1", "robot1", {"changed": True}, 3.0)
    report.failed("t1", "robot1", {"msg": "oh"}, 4.0)
    assert (row(report, robot1=FAILED)["changed"], row(report, robot1=FAILED)["failed_task"]) == (["Apply"], "Apply")
    assert row(report, robot1=OK)["failed_task"] is None
    ignored = started()
    ignored.failed("t1", "robot1", {"msg": "oh"}, 2.0, ignored=True)
    assert row(ignored, robot1=FAILED)["reason"] == ""


def test_a_run_once_failure_ends_the_run_for_all() -> None:
    report = started("robot1", "robot2", for_all=True)
    report.failed("t1", "robot1", {"msg": "bad input"}, 2.0)
    why = "not carried on: Apply failed on robot1 for all hosts"
    assert outcome(report, "robot2", robot1=FAILED, robot2=OK) == ("failed", why)
    assert outcome(report, "robot2", robot1={**OK, "rescued": 1}, robot2=OK) == ("unchanged", "")
    report = started("robot1", "robot2", for_all=True)
    report.unreachable("t1", "robot1", {"msg": "no route"}, 2.0)
    why = "not carried on: Apply did not reach robot1 for all hosts"
    assert outcome(report, "robot2", robot1=DARK) == ("failed", why)
    assert report.so_far().lost["robot2"]["reason"] == why


def test_more_failures_than_a_play_allows_end_the_run_for_all() -> None:
    report = started("robot1", "robot2")
    report.failed("t1", "robot1", {"msg": "bad input"}, 2.0)
    report.too_many_failed()
    why = "not carried on: more hosts failed than max_fail_percentage allows, robot1 is one of them"
    assert outcome(report, "robot2", robot1=FAILED, robot2=OK) == ("failed", why)


def test_hosts_of_an_earlier_batch_are_through() -> None:
    hosts = ("robot1", "robot2", "robot3")
    report = RunReport(0.0)
    for at, host in enumerate(hosts[:2]):
        report.play("Robots", hosts, at, [host])
    report.task("t1", Task("Apply", "command", for_all=True), 1.0)
    report.failed("t1", "robot2", {"msg": "bad input"}, 2.0)
    words = [outcome(report, host, robot1=CHANGED, robot2=FAILED)[0] for host in hosts]
    assert words == ["updated", "failed", "failed"]


@pytest.mark.parametrize("how", ["failed", "unreachable"])
def test_what_ended_the_run_is_told_of_those_for_whom_there_was_more_to_do(how: str) -> None:
    """All hosts of a play failed: Ansible begins no further one."""
    report = started("robot1")
    report.play("Images are on the edge hosts", ["edge0", "edge1"], 2.0)
    report.failed("t1", "edge0", {"msg": "rescued"}, 3.0)
    report.failed("t1", "edge1", {"msg": "rescued"}, 3.0)
    getattr(report, how)("t1", "edge1", {"msg": "no such host"}, 3.0)
    counts = {"edge0": OK, "edge1": FAILED if how == "failed" else DARK, "robot1": OK}
    report.cut_short(counts)
    told = "Apply failed" if how == "failed" else "the connection was lost"
    why = f"not carried on: the run ended on edge1: {told}: no such host"
    assert outcome(report, **counts) == ("failed", why)
    assert outcome(report, "edge1", **counts)[1] == "no such host"


def test_a_host_that_nothing_ran_for_is_said_to_be_so() -> None:
    assert outcome(started("robot1", "robot2"), "robot2", robot1=OK) == ("unchanged", "no task ran for it")


@pytest.mark.parametrize("action", ["_robot_update", "_update_soak", "_guarded", "other"])
def test_an_update_says_its_outcome_itself(action: str) -> None:
    said = {"outcome": {**BUSY, "steps": [{"name": "dock"}]}, "ansible_facts": {"fleet_outcome": "splendid"}}
    report = started()
    report.task("t2", Task("Do it", f"rosops.fleet.{action}"), 1.0)
    report.ok("t2", "robot1", said, 2.0)
    assert outcome(report)[0] == ("unchanged" if action == "other" else "deferred-busy")
    assert [step["name"] for step in row(report)["steps"]] == ([] if action == "other" else ["dock"])


def test_actions_that_say_an_outcome_are_there() -> None:
    directory = Path(_robot_update.__file__).parent
    assert [name for name in ACTIONS if not (directory / f"{name}.py").exists()] == []


def test_the_verdict_on_the_graph() -> None:
    report = started()
    report.failed("t1", "robot1", {"verdict": "wait", "elapsed": 60.02, "checks": [HOLDS, SILENT]}, 2.0)
    unmet = ["topic /chatter: no publisher"]
    assert row(report)["ready"] == {"verdict": "wait", "elapsed": 60.02, "checks": 2, "unmet": unmet}


def test_durations_of_tasks_stages_and_plays() -> None:
    report = RunReport(0.0)
    report.play("First", ["a", "b"], 1.0)
    report.task("t1", Task("Install", "k3s", stage="k3s"), 1.0)
    report.ok("t1", "a", {}, 3.0)
    report.ok("t1", "b", {"changed": True}, 4.5)
    report.task("t2", Task("Look", "stat"), 5.0)
    report.ran("t2", "a", 5.5)
    report.play("Second", ["a"], 6.0)
    report.task("t1", Task("Install", "k3s", stage="k3s"), 7.0)  # the same task in a further batch of hosts
    report.ok("t1", "a", {}, 8.0)
    done = report.finish({"a": OK, "b": CHANGED}, 10.0)
    assert done["plays"] == [{"name": "First", "seconds": 5.0}, {"name": "Second", "seconds": 4.0}]
    assert done["stages"] == [{"name": "k3s", "seconds": 4.5}, {"name": "First", "seconds": 0.5}]
    where = {"name": "Install", "action": "k3s", "play": "First", "stage": "k3s"}
    assert done["slowest_tasks"][0] == {**where, "seconds": 4.5, "hosts": 2, "changed": 1}
    assert (done["elapsed"], done["tasks"], done["outcomes"]) == (10.0, 2, {"updated": 1, "unchanged": 1})


def test_ten_slowest_tasks() -> None:
    report = RunReport(0.0)
    for number in range(15):
        report.task(f"t{number}", Task(f"task {number}", "command"), number * 100.0)
        report.ok(f"t{number}", "a", {}, number * 100.0 + number)
    names = [task["name"] for task in report.finish({"a": OK}, 2000.0)["slowest_tasks"]]
    assert names == [f"task {number}" for number in range(14, 4, -1)]


def test_localhost_is_no_robot() -> None:
    report = started("robot1", "localhost")
    report.ok("t1", "localhost", {}, 2.0)
    assert [host["host"] for host in report.finish({"robot1": OK, "localhost": OK}, 3.0)["hosts"]] == ["robot1"]
    alone = started("localhost")
    assert [host["host"] for host in alone.finish({"localhost": OK}, 3.0)["hosts"]] == ["localhost"]


def test_an_unknown_task_does_no_harm() -> None:
    report = RunReport(0.0)
    report.ok("never-started", "robot1", {"changed": True}, 1.0)
    report.failed("never-started", "robot1", {"msg": "x"}, 1.0)
    assert row(report, robot1=FAILED)["outcome"] == "failed"


def test_what_a_host_left_the_run_for_comes_without_the_task() -> None:
    """And whole, however long it is."""
    report = started()
    cause = "bringup: rate /imu/data: 45.4 Hz by /imu_driver_7888acda " + "and so on " * 20 + "of at least 90 Hz"
    report.task("t9", Task("Leave the run", "rosops.fleet._leave"), 2.0)
    report.failed("t9", "robot1", {"msg": cause}, 2.0)
    done = report.finish({"robot1": FAILED}, 9.0)
    assert done["hosts"][0]["failed_task"] is None
    assert screen(done)[1].endswith(f"0        {cause}")


def example(check_mode: bool = False) -> dict[str, Any]:
    report = started("edge1", "robot1", "robot2", "robot3")
    report.ok("t1", "robot1", {"changed": True, "verdict": "pass", "elapsed": 3.21, "checks": []}, 4.0)
    report.failed("t1", "robot2", {"msg": "no\nsuch image"}, 4.0)
    report.unreachable("t1", "robot3", {"msg": "Connection timed out"}, 4.0)
    return report.finish({"edge1": OK, "robot1": CHANGED, "robot2": FAILED, "robot3": DARK}, 9.5, check_mode=check_mode)


@pytest.mark.parametrize(
    ("check", "words"), [(False, ("unchanged", "updated")), (True, ("would not change", "would change"))]
)
def test_the_screen(check: bool, words: tuple[str, str]) -> None:
    """In check mode in the conditional."""
    same, other = (word.ljust(16) for word in words)
    assert screen(example(check)) == [
        "host    outcome           ros graph   changed  note",
        f"edge1   {same}  -           0        -",
        f"robot1  {other}  pass 3.2 s  1        -",
        "robot2  failed            -           0        no such image (task: Apply)",
        "robot3  deferred-offline  -           0        Connection timed out",
        "9.5 s: Robots 3.0 s",
    ]


def test_no_hosts() -> None:
    assert screen(RunReport(0.0).finish({}, 1.0)) == ["no host took part", "1.0 s"]
