# SPDX-License-Identifier: GPL-3.0-or-later
"""The private names of ansible-core that this collection uses, each behind a name of ours.

An upgrade that moves one of them is seen by one test (test_upstream.py), which runs with every supported ansible-core.
"""

from __future__ import annotations

from typing import Any

from ansible.executor.task_executor import TaskExecutor
from ansible.playbook.task import Task

from ...module_utils._common.documents import Arguments, Result, Variables

# --- a run ----------------------------------------------------------------------------------------------------------


def loader_of(hostvars: Any) -> Any:
    """The loader of the run's files, which knows where those of the inventory are."""
    return hostvars._loader


def playbook_file(playbook: Any) -> str:
    return str(playbook._file_name)


def identity(item: Any) -> str:
    """Of a play or a task: the same in all events of a run."""
    return str(item._uuid)


# --- a task's result, which callbacks are told ------------------------------------------------------------------------

HIDDEN = {"_ansible_no_log": True}  # nothing of it, at any verbosity
SHOWN = {"_ansible_verbose_always": True}  # all of it
BRIEF = {"_ansible_verbose_override": True}  # no more than its state, at any verbosity


# --- an action plugin's task ----------------------------------------------------------------------------------------


def task_of(plugin: Any) -> Any:
    return plugin._task


def connection_of(plugin: Any) -> Any:
    return plugin._connection


def asks_for_a_password(plugin: Any) -> bool:
    """Whether privileges on the task's host take one."""
    return bool(plugin._play_context.become and plugin._play_context.become_pass)


def run_module(plugin: Any, task: Any, task_vars: Variables) -> Result:
    """Run the module of another task in the place of the plugin's own."""
    own = plugin._task
    plugin._task = task
    try:
        found: Result = plugin._execute_module(task.action, dict(task.args), task_vars=task_vars)
    finally:
        plugin._task = own
    return found


def run_command(plugin: Any, command: str) -> None:
    """A command over the plugin's connection, without privileges; AnsibleConnectionFailure."""
    plugin._low_level_execute_command(command, sudoable=False)


def run_action(plugin: Any, task: Any, task_vars: Variables) -> Result | None:
    """Run another action plugin with the connection of this one; None where there is none of that name."""
    other = plugin._shared_loader_obj.action_loader.get(
        task.action,
        task=task,
        connection=plugin._connection,
        play_context=plugin._play_context.copy(),
        loader=plugin._loader,
        templar=plugin._templar,
        shared_loader_obj=plugin._shared_loader_obj,
    )
    if other is None:
        return None
    found: Result = other.run(task_vars=dict(task_vars))
    return found


def run_task(plugin: Any, known: Variables, definition: Arguments) -> Result:
    """Run a task as a playbook would have it, `delegate_to` and all, in the place of the plugin's own."""
    hostvars, own = known["hostvars"], plugin._task
    manager = hostvars._variable_manager  # the action gets it no other way
    task = Task.load(
        {"name": own.get_name(), **definition}, block=own._parent, variable_manager=manager, loader=plugin._loader
    )
    executor = TaskExecutor(
        hostvars._inventory.get_host(str(known["inventory_hostname"])),
        task,
        dict(known),
        plugin._play_context.copy(),
        plugin._loader,
        plugin._shared_loader_obj,
        None,  # the queue of retries and of asynchronous tasks, and this is neither
        manager,
    )
    found: Result = executor.run()
    return found
