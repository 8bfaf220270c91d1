# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Run the module and measure the host's clock against ours, bounded by the call's own round trip.

Where the host's Python is too old for modules, that is said: no module can, and Ansible's own words name no way out.
"""

from __future__ import annotations

import time
from typing import Any

from ansible.plugins.action import ActionBase
from ansible_collections.rosops.fleet.plugins.plugin_utils._model.pythons import too_old
from ansible_collections.rosops.fleet.plugins.plugin_utils._preflight.findings import clock_offset


class ActionModule(ActionBase):  # type: ignore[misc]
    """A task's own start and end are no measure: they include the slowest host of the play."""

    def run(self, tmp: str | None = None, task_vars: dict[str, Any] | None = None) -> dict[str, Any]:
        result: dict[str, Any] = super().run(tmp, task_vars)
        sent = time.time()
        result.update(self._execute_module(task_vars=task_vars))
        received = time.time()
        clock = result["facts"]["clock"] if isinstance(result.get("facts"), dict) else None
        if clock is not None:
            result["facts"]["clock"] = clock_offset(sent, float(clock["began"]), float(clock["ended"]), received)
        elif old := self._python_too_old(task_vars or {}):
            result["msg"] = old
        return result

    def _python_too_old(self, task_vars: dict[str, Any]) -> str:
        """Asked without a module, by the interpreter that was to run it."""
        program = (self._used_interpreter or "python3").lstrip("#!")
        asked = self._low_level_execute_command(f"{program} -c 'import sys; print(sys.version_info[:2])'")
        wrong = too_old(asked["stdout"]) if asked["rc"] == 0 else ""
        return f"{task_vars.get('inventory_hostname')} {wrong}" if wrong else ""
