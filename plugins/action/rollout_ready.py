# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""rollout_ready on the control node itself, where it can say what is still open while it waits.

A module's output reaches the screen only when it has ended; a plugin's does at once.
"""

from __future__ import annotations

import os
from typing import Any

from ansible.plugins.action import ActionBase
from ansible.utils.display import Display
from ansible_collections.rosops.fleet.plugins.module_utils._common.errors import FleetError
from ansible_collections.rosops.fleet.plugins.plugin_utils._kube.client import Kube
from ansible_collections.rosops.fleet.plugins.plugin_utils._kube.wait import ROLLOUT_ARGS, run, settings_from

display = Display()


class ActionModule(ActionBase):  # type: ignore[misc] # ansible-core carries no types
    TRANSFERS_FILES = False
    _requires_connection = False
    _supports_check_mode = True

    def run(self, tmp: str | None = None, task_vars: dict[str, Any] | None = None) -> dict[str, Any]:
        result: dict[str, Any] = super().run(tmp, task_vars)
        params = self.validate_argument_spec(argument_spec=ROLLOUT_ARGS)[1]
        host = (task_vars or {}).get("inventory_hostname", "")
        try:
            os.environ.update(self._environment())  # this process is of one task alone, as a module's would be
            with Kube(params, patience=0) as kube:  # the wait has a patience of its own
                settings = settings_from(params, lambda text: display.display(f"[{host}] {text}"))
                result.update(changed=False, **run(params, kube, settings, self._task.check_mode))
        except FleetError as exc:
            result.update(failed=True, msg=str(exc), **exc.details)
        return result

    def _environment(self) -> dict[str, str]:
        """The task's `environment`, which a module would find in its own."""
        found: dict[str, Any] = {}
        self._compute_environment_string(found)
        return {str(key): str(value) for key, value in found.items()}
