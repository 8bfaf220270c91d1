# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""The host of a robot, as the engine and guarded changes want it: whatever goes wrong there is this robot's outcome."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Iterator, Mapping
from typing import Any

from ansible.errors import AnsibleConnectionFailure, AnsibleError

from ...module_utils._common.errors import FleetError
from .._update.world import AwayError, ticking
from .._upstream import ansible_core
from . import voice
from .host import ActionHost

TICK = 10.0  # seconds without a word, below the idle time-outs of the tools that run playbooks


class RobotHost(ActionHost):
    """AwayError where it cannot be reached, FleetError where Ansible cannot work there; what takes long says so."""

    def there(self) -> None:
        """Whether it can be reached: the cheapest answer that a host can give."""
        with self._told("reaching it"):
            ansible_core.run_command(self.plugin, "true")

    def module(self, name: str, args: Mapping[str, Any], secret: bool = False) -> dict[str, Any]:
        with self._told(args.get("job", name)):
            return super().module(name, args, secret)

    def copy(self, src: str, dest: str, rate_limit: str = "") -> dict[str, Any]:
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
