# SPDX-License-Identifier: GPL-3.0-or-later
"""The action: modules and copies on the task's host, and the result that Ansible gets."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any
from unittest.mock import Mock

import pytest
from ansible.playbook.task import Task
from ansible_collections.rosops.fleet.plugins.action import _node_images
from ansible_collections.rosops.fleet.plugins.plugin_utils._action.host import ActionHost
from ansible_collections.rosops.fleet.plugins.plugin_utils._images.node import NodeImages

REDIS = "docker.io/library/redis:7"


def action(check_mode: bool = False, missing: str = "ansible.posix.synchronize") -> Any:
    """`others` makes another action plugin, as the loader does."""

    def work(task_vars: dict[str, Any]) -> dict[str, Any]:
        task_vars["ansible_connection"] = "changed by synchronize"
        return {"changed": True}

    task = Task()
    task.args, task.diff, task.check_mode = {"names": ["redis:7"]}, True, check_mode
    options = {"host_key_checking": True}
    connection = SimpleNamespace(
        _shell=SimpleNamespace(tmpdir="/unused"), has_option=options.__contains__, get_option=options.__getitem__
    )
    context = SimpleNamespace(copy=str, become=True, become_pass="")
    templar = SimpleNamespace(template=lambda value: value)
    made = _node_images.ActionModule(task, connection, context, None, templar)
    made.others = Mock(side_effect=lambda name, **_given: None if name == missing else SimpleNamespace(run=work))
    made._shared_loader_obj = SimpleNamespace(action_loader=SimpleNamespace(get=made.others))
    made.ran = []

    def execute(name: str, args: dict[str, Any], task_vars: dict[str, Any]) -> dict[str, Any]:
        made.ran.append((name, args, made._task.check_mode, task_vars["inventory_hostname"]))
        return {"rc": 0, "stdout": "x86_64\n"}

    made._execute_module = execute
    return made


@pytest.mark.parametrize("check_mode", [False, True])
def test_the_node_is_looked_at_in_check_mode_too(check_mode: bool) -> None:
    made = action(check_mode)
    result = made.run(task_vars={"inventory_hostname": "robot1"})
    looks = [(name, check, host) for name, _args, check, host in made.ran]
    assert set(looks) == {("ansible.builtin.command", False, "robot1")}
    assert made._task.check_mode is check_mode
    if check_mode:
        assert (result["changed"], "failed" in result) == (True, False)
        assert result["diff"] == {"before": "", "after": f"{REDIS} as the registry has it\n"}
    else:
        assert (result["failed"], result["msg"]) == (True, f"{REDIS} is not there")


def test_what_was_brought_is_the_result(monkeypatch: pytest.MonkeyPatch) -> None:
    bring = Mock(return_value={"changed": True, "present": {REDIS: "sha256:1"}})
    monkeypatch.setattr(NodeImages, "bring", bring)
    assert action().run(task_vars={"inventory_hostname": "robot1"}) == bring.return_value
    bring.assert_called_once_with([], ["redis:7"], False, [])


def test_a_copy_gets_a_task_of_its_own_and_no_diff_of_megabytes() -> None:
    made, task_vars = action(), {"inventory_hostname": "robot1"}
    assert ActionHost(made, task_vars).copy("/a.tar", "/room/a.tar", "") == {"changed": True}
    [((name,), given)] = made.others.call_args_list
    assert name == "ansible.builtin.copy"
    assert (given["task"].args, given["task"].diff) == ({"src": "/a.tar", "dest": "/room/a.tar", "mode": "0600"}, False)
    assert (made._task.args, made._task.diff) == ({"names": ["redis:7"]}, True)
    assert task_vars == {"inventory_hostname": "robot1"}


def test_a_limited_copy_checks_the_host_s_key_as_every_other_task_does() -> None:
    made = action(missing="")
    assert ActionHost(made, {}).copy("/a.tar", "/room/a.tar", "2m") == {"changed": True}
    [(_name, given)] = made.others.call_args_list
    assert (given["task"].args["verify_host"], given["task"].args["use_ssh_args"]) == (True, True)
    assert given["task"].args["rsync_opts"] == ["--bwlimit=2m", "--chmod=F600"]  # nobody else's to read


def test_a_rate_limit_needs_a_collection_and_sudo_without_a_password() -> None:
    result = ActionHost(action(), {}).copy("/a.tar", "/room/a.tar", "2m")
    assert result == {"failed": True, "msg": "ansible.posix.synchronize is not installed on the control node"}
    made = action()
    made._play_context.become_pass = "secret"  # noqa: S105 - an invented one
    result = ActionHost(made, {}).copy("/a.tar", "/room/a.tar", "2m")
    assert result["failed"] and "leave out images_rate_limit" in result["msg"]
    assert "secret" not in result["msg"]
    made.others.assert_not_called()
