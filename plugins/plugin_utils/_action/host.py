# SPDX-License-Identifier: GPL-3.0-or-later
"""The host of an action plugin's task, for code that gets its world handed in."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from ansible.errors import AnsibleConnectionFailure, AnsibleError

from ...module_utils._common.documents import Arguments, Result, Variables
from ...module_utils._common.errors import FleetError
from .._update.world import AwayError, ticking
from .._upstream import ansible_core
from . import voice

TICK = 10.0  # seconds without a word, below the idle time-outs of the tools that run playbooks

SUDO_ASKS = (
    "a limited rate is rsync's, and rsync cannot hand over the password for sudo: allow sudo without one for rsync on "
    "this host, or leave out images_rate_limit"
)


@dataclass
class ActionHost:
    """The host of an action plugin's task.

    Modules and copies run there with the task's connection and privileges. They run in check mode only where that is
    asked for: mostly who calls decides what check mode leaves out. Results are Ansible's own; a host that cannot be
    reached raises AnsibleConnectionFailure.
    """

    plugin: Any
    task_vars: Variables
    check_mode: bool = False

    def module(self, name: str, args: Arguments, secret: bool = False) -> Result:
        """Run a module by its full name. The host's log does not get the arguments of a `secret` one."""
        task = self._task(name, args)
        task.no_log = secret or ansible_core.task_of(self.plugin).no_log
        return ansible_core.run_module(self.plugin, task, self.task_vars)

    def job(self, name: str, arguments: Arguments, secrets: Arguments | None = None) -> Result:
        """Have a job done by the module that is private. No log gets the `secrets` among its arguments."""
        given = {"job": name, "arguments": dict(arguments), "secrets": dict(secrets or {})}
        return self.module("rosops.fleet._host", given)

    def copy(self, src: str, dest: str, rate_limit: str = "") -> Result:
        """Copy a file of the control node, mode 0600; with rsync and its --bwlimit where there is a `rate_limit`."""
        if rate_limit:
            if ansible_core.asks_for_a_password(self.plugin):
                return {"failed": True, "msg": SUDO_ASKS}
            ssh, checked = ansible_core.connection_of(self.plugin), "host_key_checking"
            options = {
                "archive": False,
                "partial": True,
                "rsync_opts": [f"--bwlimit={rate_limit}", "--chmod=F600"],
                # by itself it takes any host's key, and leaves out the arguments that SSH gets elsewhere
                "use_ssh_args": True,
                "verify_host": ssh.has_option(checked) and ssh.get_option(checked),
            }
            return self.action("ansible.posix.synchronize", {"src": src, "dest": dest, **options})
        return self.action("ansible.builtin.copy", {"src": src, "dest": dest, "mode": "0600"})

    def write(self, path: str, content: str, mode: str, diff: bool) -> Result:
        """Write a file."""
        return self.action("ansible.builtin.copy", {"dest": path, "content": content, "mode": mode}, diff)

    def action(self, name: str, args: Arguments, diff: bool = False) -> Result:
        """Run another action plugin; it gets copies of what it may change for itself, as synchronize does."""
        found = ansible_core.run_action(self.plugin, self._task(name, args, diff), self.task_vars)
        return found or {"failed": True, "msg": f"{name} is not installed on the control node"}

    def _task(self, name: str, args: Arguments, diff: bool = False) -> Any:
        task = ansible_core.task_of(self.plugin).copy()
        task.action, task.args, task.check_mode, task.diff = name, dict(args), self.check_mode, diff
        return task


class RobotHost(ActionHost):
    """That of a robot, as the engine and guarded changes want it: whatever goes wrong there is this robot's outcome.

    AwayError where it cannot be reached, FleetError where Ansible cannot work there; what takes long says so.
    """

    def there(self) -> None:
        """Whether it can be reached: the cheapest answer that a host can give."""
        with self._told("reaching it"):
            ansible_core.run_command(self.plugin, "true")

    def module(self, name: str, args: Arguments, secret: bool = False) -> Result:
        with self._told(args.get("job", name)):
            return super().module(name, args, secret)

    def copy(self, src: str, dest: str, rate_limit: str = "") -> Result:
        with self._told(f"copying {src}"):
            return super().copy(src, dest, rate_limit)

    @contextlib.contextmanager
    def _told(self, what: str) -> Iterator[None]:
        robot, began = self.task_vars["inventory_hostname"], time.monotonic()
        with ticking(TICK, lambda: voice.say(robot, f"{what} for {time.monotonic() - began:.0f} s now")):
            try:
                yield
            except AnsibleConnectionFailure as error:
                raise AwayError(str(error)) from error
            except AnsibleError as error:  # a wrong password for sudo, say: all of a wave would end with this task
                raise FleetError(f"{what} did not run on {robot}: {error}") from error
