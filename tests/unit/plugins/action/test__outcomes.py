# SPDX-License-Identifier: GPL-3.0-or-later
"""What became of every host: AWX's artifacts, and a key for each host in its cluster."""

from __future__ import annotations

import json
from typing import Any

import pytest
from ansible import context
from ansible.utils.context_objects import CLIArgs
from ansible_collections.rosops.fleet.plugins.action import _outcomes
from ansible_collections.rosops.fleet.plugins.plugin_utils._kube.access import Identity
from ansible_collections.rosops.fleet.plugins.plugin_utils._report.host_run import Noted, note_run
from ansible_collections.rosops.fleet.plugins.plugin_utils._report.run import RunReport, Task
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.outcome import RobotOutcome
from ansible_collections.rosops.fleet.tests.unit.plugins.action.actions import run
from ansible_collections.rosops.fleet.tests.unit.plugins.plugin_utils._kube.kube_server import Server
from ansible_collections.rosops.fleet.tests.unit.robots import fleet

GROUPS = {"edge": ["edge1"], "robots": ["robot1", "robot2", "robot3", "robot4"]}
SYSTEM = "/api/v1/namespaces/kube-system"
KEPT = f"{SYSTEM}/configmaps/rosops-outcomes"
BUSY = {"outcome": "deferred-busy", "reason": "/dock is active", "steps": [{"name": "dock"}]}


@pytest.fixture(autouse=True)
def cluster(server: Server, api: dict[str, Any], monkeypatch: pytest.MonkeyPatch) -> None:
    for name, value in api.items():
        monkeypatch.setenv(f"K8S_AUTH_{name.upper()}", value)
    server.put(SYSTEM, {"metadata": {"name": "kube-system"}})


def known(*here: str, **facts: Any) -> dict[str, Any]:
    hosts = [host for group in GROUPS.values() for host in group]
    old = {"fleet_outcome": {"outcome": "rolled-back", "reason": "a fact of an earlier run"}}
    hostvars = {host: {**old, "update_result": {"outcome": facts.get(host)}} for host in hosts}
    validated = {**fleet(GROUPS, hostvars).as_dict(), "name": "production"}
    return {"fleet": validated, "hostvars": hostvars, "ansible_play_hosts_all": hosts, "ansible_play_hosts": list(here)}


def noted() -> None:
    """What the callback writes down: edge1 was changed, robot1 was busy, 2 failed, 3 went away, 4 was rescued."""
    report = RunReport(started="2026-11-22T06:00:00Z")
    report.playbook = "update.yml"
    report.play("Robots", [host for group in GROUPS.values() for host in group], 0)
    report.task("t", Task("Apply", "rosops.fleet._robot_update"), 0)
    report.ok("t", "edge1", {"changed": True}, 1)
    report.ok("t", "robot1", {"outcome": BUSY}, 1)
    report.failed("t", "robot2", {"msg": "no space"}, 1)
    report.unreachable("t", "robot3", {"msg": "timed out"}, 1)
    report.failed("t", "robot4", {"msg": "once more"}, 1)
    note_run(report.so_far())


def kept(server: Server) -> dict[str, Any]:
    return {host: json.loads(text) for host, text in server.find(KEPT)["data"].items()}


def test_every_host_has_its_word_whatever_became_of_it(server: Server) -> None:
    noted()
    result = run(_outcomes, {}, known("edge1", "robot1", "robot4"))
    assert not result["changed"]
    assert (result["ansible_stats"]["per_host"], result["ansible_stats"]["aggregate"]) == (False, False)
    found = result["ansible_stats"]["data"]["fleet_outcomes"]
    assert {host: (one["outcome"], one["reason"]) for host, one in found.items()} == {
        "edge1": ("updated", ""),
        "robot1": ("deferred-busy", "/dock is active"),
        "robot2": ("failed", "no space"),
        "robot3": ("deferred-offline", "timed out"),
        "robot4": ("unchanged", ""),
    }
    assert [step["name"] for step in found["robot1"]["steps"]] == ["dock"]
    one = kept(server)["robot2"]
    assert (one["outcome"], one["reason"], one["failed_task"]) == ("failed", "no space", "Apply")
    assert (one["playbook"], one["started"]) == ("update.yml", "2026-11-22T06:00:00Z")
    assert len(kept(server)) == 5


def test_a_later_run_on_one_host_keeps_the_others(server: Server) -> None:
    noted()
    run(_outcomes, {}, known("edge1", "robot1", "robot4"))
    later = {**known("robot2", robot2={"outcome": "updated", "reason": ""}), "ansible_play_hosts_all": ["robot2"]}
    note_run(Noted("site.yml", "2026-11-22T07:00:00Z"))
    run(_outcomes, {}, later)
    assert {host: one["outcome"] for host, one in kept(server).items()} == {
        "edge1": "updated", "robot1": "deferred-busy", "robot2": "updated", "robot3": "deferred-offline",
        "robot4": "unchanged",
    }  # fmt: skip


def test_without_the_callback_the_tasks_of_this_run_count() -> None:
    found = run(_outcomes, {}, known("robot1", robot1=BUSY))["ansible_stats"]["data"]["fleet_outcomes"]
    assert found["robot1"] == RobotOutcome.from_dict(BUSY).as_dict()
    assert found["robot2"]["outcome"] == "failed"
    assert "callback fleet_report" in found["robot2"]["reason"]


def test_who_only_looks_or_tries_keeps_nothing(server: Server) -> None:
    noted()
    run(_outcomes, {"keep": False}, known("robot1"))
    run(_outcomes, {}, known("robot1"), check_mode=True)
    assert not server.writes


@pytest.mark.parametrize(
    ("asked", "word"),
    [(["playbooks/site.yml"], "failed"), (["rosops.fleet.validate"], "unchanged"), (["validate.yml"], "unchanged")],
)
def test_a_run_that_ends_early_has_said_so(
    monkeypatch: pytest.MonkeyPatch, server: Server, asked: Any, word: str
) -> None:
    monkeypatch.setattr(context, "CLIARGS", CLIArgs({"args": asked}))
    found = run(_outcomes, {"begin": True}, known())["ansible_stats"]["data"]["fleet_outcomes"]
    assert {one["outcome"] for one in found.values()} == {word}
    assert not server.writes


def test_a_cluster_that_cannot_be_told_is_a_warning(server: Server, monkeypatch: pytest.MonkeyPatch) -> None:
    warnings: list[str] = []
    monkeypatch.setattr(_outcomes.display, "warning", warnings.append)
    server.put(f"{SYSTEM}/configmaps/rosops-fleet", Identity("staging", "edge").as_object())
    assert not run(_outcomes, {}, known("robot1")).get("failed")
    assert "the fleet staging" in warnings[0]
    assert not server.writes
