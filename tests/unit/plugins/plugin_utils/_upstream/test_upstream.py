# SPDX-License-Identifier: GPL-3.0-or-later
"""What ansible-core and kubernetes.core do behind the private names that this collection uses."""

from __future__ import annotations

import functools
import inspect
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pytest
import yaml
from ansible.executor.task_executor import TaskExecutor
from ansible.executor.task_result import _RawTaskResult
from ansible.inventory.manager import InventoryManager
from ansible.parsing.dataloader import DataLoader
from ansible.playbook import Playbook
from ansible.playbook.play_context import PlayContext
from ansible.playbook.task import Task
from ansible.plugins import loader as plugin_loader
from ansible.plugins.action import ActionBase
from ansible.plugins.callback import CallbackBase
from ansible.template import Templar
from ansible.vars.hostvars import HostVars
from ansible.vars.manager import VariableManager
from ansible_collections.rosops.fleet.plugins.plugin_utils._upstream import ansible_core, kubernetes_core
from kubernetes import config as kube_config


class Plugin(ActionBase):  # type: ignore[misc] # ansible-core carries no types
    def run(self, tmp: Any = None, task_vars: Any = None) -> dict[str, Any]:
        return dict(super().run(tmp, task_vars))


@pytest.fixture(autouse=True)
def nothing_in_the_home_directory(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Modules run on this host, and their directory is in the user's home."""
    monkeypatch.setenv("ANSIBLE_REMOTE_TMP", str(tmp_path))


@functools.cache
def _loaded() -> None:
    plugin_loader.init_plugin_loader()


def made() -> tuple[Plugin, dict[str, Any]]:
    """An action plugin at its task on this host, and the host's variables."""
    _loaded()
    loader = DataLoader()
    inventory = InventoryManager(loader, ["localhost,"])
    manager = VariableManager(loader, inventory)
    task = Task.load({"ansible.builtin.ping": None}, variable_manager=manager, loader=loader)
    context = PlayContext()
    context.connection = "ansible.builtin.local"
    connection = plugin_loader.connection_loader.get("ansible.builtin.local", context)
    host = inventory.get_host("localhost")
    host.set_variable("ansible_connection", "local")
    known = {
        **manager.get_vars(host=host, task=task),
        "inventory_hostname": "localhost",
        "hostvars": HostVars(inventory, manager, loader),
    }
    return Plugin(task, connection, context, loader, Templar(loader, variables=known), plugin_loader), known


def test_another_module_runs_in_the_place_of_the_tasks_own() -> None:
    plugin, known = made()
    own = ansible_core.task_of(plugin)
    task = own.copy()
    task.action, task.args = "ansible.builtin.command", {"argv": ["echo", "here"]}
    assert ansible_core.run_module(plugin, task, known)["stdout"] == "here"
    assert ansible_core.task_of(plugin) is own


def test_another_action_runs_with_the_tasks_connection(tmp_path: Path) -> None:
    plugin, known = made()
    task = ansible_core.task_of(plugin).copy()
    task.action, task.args = "ansible.builtin.copy", {"dest": str(tmp_path / "file"), "content": "here"}
    assert ansible_core.run_action(plugin, task, known)
    assert (tmp_path / "file").read_text() == "here"
    task.action = "nobody.has.it"
    assert ansible_core.run_action(plugin, task, known) is None


def test_a_command_runs_over_the_connection() -> None:
    plugin, _known = made()
    ansible_core.run_command(plugin, "true")
    assert ansible_core.connection_of(plugin).transport == "local"
    assert not ansible_core.asks_for_a_password(plugin)


def test_a_whole_task_is_made_and_executed_as_it_is_made_here() -> None:
    """That it works over SSH is shown by playbooks/test_elsewhere."""
    names = [*inspect.signature(TaskExecutor.__init__).parameters]
    assert names[:9] == [
        "self", "host", "task", "job_vars", "play_context", "loader", "shared_loader_obj", "final_q",
        "variable_manager",
    ]  # fmt: skip
    plugin, known = made()
    assert known["hostvars"]._inventory.get_host("localhost").name == "localhost"
    assert ansible_core.loader_of(known["hostvars"]) is plugin._loader


def test_a_run_names_its_file_its_plays_and_tasks(tmp_path: Path) -> None:
    file = tmp_path / "site.yml"
    file.write_text(yaml.safe_dump([{"hosts": "all", "tasks": [{"ansible.builtin.ping": {}}]}]))
    playbook = Playbook.load(str(file), variable_manager=VariableManager(DataLoader()), loader=DataLoader())
    assert ansible_core.playbook_file(playbook) == str(file)
    (play,) = playbook.get_plays()
    assert len(ansible_core.identity(play)) > 30


def told(result: Mapping[str, Any], verbosity: int) -> str:
    """What callbacks print of a task's result."""
    _plugin, known = made()
    callback = CallbackBase()
    callback._display.verbosity, before = verbosity, callback._display.verbosity
    try:
        seen = _RawTaskResult(
            known["hostvars"]._inventory.get_host("localhost"), ansible_core.task_of(_plugin), dict(result), {}
        ).as_callback_task_result()
        return str(callback._dump_results(seen.result)) if callback._run_is_verbose(seen) else ""
    finally:
        callback._display.verbosity = before


def test_callbacks_are_told_of_a_result_what_it_says_of_itself() -> None:
    result = {"value": "planted"}
    assert "planted" in told(result, 1) and "planted" not in told(result, 0)
    assert "planted" in told({**result, **ansible_core.SHOWN}, 0)
    assert "planted" not in told({**result, **ansible_core.BRIEF}, 4)
    assert "planted" not in told({**result, **ansible_core.HIDDEN}, 4)


def test_options_become_the_clients_configuration() -> None:
    auth = kubernetes_core.create_auth_spec(None, host="https://192.0.2.1:6443", api_key="t", validate_certs=False)
    assert auth["host"] == "https://192.0.2.1:6443"
    assert kubernetes_core.create_configuration(auth).host == "https://192.0.2.1:6443"
    assert kubernetes_core.create_headers(None, no_proxy="x") == {}


def test_the_clients_key_files_go() -> None:
    path = Path(kube_config.kube_config._create_temp_file_with_content("secret"))
    assert path.exists()
    kubernetes_core.remove_key_files(kube_config)
    assert not path.exists()
