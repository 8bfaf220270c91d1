# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Run the module and measure the host's clock against ours, bounded by the call's own round trip."""

from __future__ import annotations

import time
from typing import Any

from ansible.plugins.action import ActionBase
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
        return result
