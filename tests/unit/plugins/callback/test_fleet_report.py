# SPDX-License-Identifier: GPL-3.0-or-later
"""The callback's own part: what it takes from Ansible's objects, the file, and that it never ends a run."""

from __future__ import annotations

import json
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from ansible import constants, context
from ansible.executor.stats import AggregateStats
from ansible.executor.task_queue_manager import TaskQueueManager
from ansible.playbook.role_include import IncludeRole
from ansible.playbook.task import Task
from ansible.utils.context_objects import CLIArgs
from ansible.utils.display import Display
from ansible_collections.rosops.fleet.plugins.callback import fleet_report


class FakeDisplay:
    def __init__(self) -> None:
        self.lines, self.warnings = list[str](), list[str]()
        self.banner, self.warning = self.lines.append, self.warnings.append

    def display(self, text: str, **_style: Any) -> None:
        self.lines.append(text)


def play(*hosts: str) -> Any:
    manager = SimpleNamespace(get_vars=lambda **_: {"ansible_play_hosts_all": list(hosts)})
    return SimpleNamespace(_uuid="p1", get_name=lambda: "Robots", get_variable_manager=lambda: manager)


def task(**more: Any) -> Any:
    role = SimpleNamespace(get_name=lambda: "rosops.fleet.k3s")
    given = {"run_once": False, "any_errors_fatal": None, "no_log": None, "_role": role, **more}
    return SimpleNamespace(_uuid="t1", action="command", get_name=lambda **_: "Apply", **given)


def result(the_task: Any, data: dict[str, Any], host: str = "robot1") -> Any:
    groups = [SimpleNamespace(get_name=lambda name=name: name) for name in ("all", "robots")]
    return SimpleNamespace(
        task=the_task, result=data, host=SimpleNamespace(get_name=lambda: host, get_groups=lambda: groups)
    )


@pytest.fixture
def callback(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Any:
    made = fleet_report.CallbackModule()
    made._display = FakeDisplay()
    monkeypatch.setattr(made, "get_option", lambda _name: str(tmp_path / "deep" / "report.json"))
    monkeypatch.setattr(context, "CLIARGS", CLIArgs({"check": False}))
    plays = [play("robot1")]
    made.v2_playbook_on_start(SimpleNamespace(_file_name="/x/playbooks/site.yml", get_plays=lambda: plays))
    made.v2_playbook_on_play_start(play("robot1", "robot2"))
    return made


def stats(**counts: str) -> AggregateStats:
    made = AggregateStats()
    for host, what in counts.items():
        made.increment(what, host)
    return made


def written(tmp_path: Path) -> Any:
    return json.loads((tmp_path / "deep" / "report.json").read_text())


def test_a_run(callback: Any, tmp_path: Path) -> None:
    """A later look at the fleet does not hide what an update did: the last report of each playbook stays."""
    callback.v2_playbook_on_task_start(task(), False)
    callback.v2_runner_on_ok(result(task(), {"changed": True}))
    callback.v2_runner_on_unreachable(result(task(), {"msg": "no route"}, "robot2"))
    callback.v2_playbook_on_stats(stats(robot1="changed", robot2="dark"))
    report = written(tmp_path)
    assert (report["playbook"], report["check_mode"]) == ("site.yml", False)
    assert [(host["host"], host["outcome"], host["groups"]) for host in report["hosts"]] == [
        ("robot1", "updated", ["robots"]),
        ("robot2", "deferred-offline", ["robots"]),
    ]
    assert report["stages"][0]["name"] == "k3s"
    assert callback._display.lines[0] == "FLEET REPORT"
    assert callback._display.lines[-1] == f"report: {tmp_path / 'deep' / 'report.json'}"
    assert callback._display.warnings == []
    assert sorted(path.name for path in (tmp_path / "deep").iterdir()) == ["report-site.json", "report.json"]


def test_check_mode_says_so(callback: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(context, "CLIARGS", CLIArgs({"check": True}))
    callback.v2_playbook_on_handler_task_start(task())
    callback.v2_playbook_on_stats(stats(robot1="changed"))
    assert written(tmp_path)["tasks"] == 1
    assert callback._display.lines[0] == "FLEET REPORT (check mode: nothing was changed)"
    assert "would change" in callback._display.lines[2]
    assert written(tmp_path)["check_mode"] is True
    assert [path.name for path in (tmp_path / "deep").iterdir()] == ["report.json"]


@pytest.mark.parametrize("no_log", [True, None])
def test_secrets_stay_out(callback: Any, tmp_path: Path, no_log: bool | None) -> None:
    data = {"msg": "token K10abc", "cmd": "K10abc", **({} if no_log else {"censored": "hidden"})}
    callback.v2_playbook_on_task_start(task(no_log=no_log), False)
    callback.v2_runner_on_failed(result(task(no_log=no_log), data))
    callback.v2_playbook_on_stats(stats(robot1="failures"))
    assert "K10abc" not in json.dumps(written(tmp_path)) + "".join(callback._display.lines)
    assert written(tmp_path)["hosts"][0]["reason"] == "hidden by no_log"


def test_nothing_that_goes_wrong_ends_the_run(callback: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """By ansible-core's own dispatch."""
    (tmp_path / "deep").write_text("in the way")
    warned: list[str] = []
    monkeypatch.setattr(Display, "error_as_warning", lambda _self, exception, **_msg: warned.append(str(exception)))
    callback._init_callback_methods()
    manager = TaskQueueManager(None, None, None, {})
    manager._callback_plugins = [callback]
    names = ["v2_playbook_on_play_start", "v2_playbook_on_stats"]
    for name, given in zip(names, (None, stats(robot1="ok"))):
        manager.send_callback(name, given)
    assert [name in told for name, told in zip(names, warned, strict=True)] == [True, True]


def test_a_task_of_any_kind_has_a_name(callback: Any) -> None:
    plain, role = Task(), IncludeRole()
    plain.name, role.name = "Look", "Bring it"
    unnamed = IncludeRole()
    unnamed.action, unnamed._role_name = "include_role", "rosops.fleet.k3s"
    for one in (plain, role, unnamed):
        callback.v2_playbook_on_task_start(one, False)
    assert [fleet_report.name_of(one) for one in (plain, role, unnamed)] == [
        "Look", "Bring it", "include_role : rosops.fleet.k3s"
    ]  # fmt: skip
    assert not callback._display.warnings


@pytest.mark.parametrize("path", ["", "reports/fleet-report.json"])
def test_a_relative_path_starts_at_the_configuration_and_an_empty_one_writes_none(
    callback: Any, monkeypatch: pytest.MonkeyPatch, tmp_path: Path, path: str
) -> None:
    monkeypatch.setattr(callback, "get_option", lambda _name: path)
    monkeypatch.setattr(constants, "CONFIG_FILE", str(tmp_path / "ansible.cfg"), raising=False)
    callback.v2_playbook_on_stats(stats(robot1="ok"))
    assert [one.name for one in tmp_path.iterdir()] == (["reports"] if path else [])
    assert not callback._display.warnings
