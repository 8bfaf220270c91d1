# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""For the role k3s: write and delete the files of the configuration that its plan names."""

from __future__ import annotations

from typing import Any

from ansible.plugins.action import ActionBase
from ansible_collections.rosops.fleet.plugins.module_utils._common.errors import FleetError
from ansible_collections.rosops.fleet.plugins.plugin_utils._action.host import ActionHost
from ansible_collections.rosops.fleet.plugins.plugin_utils._action.variables import role_variables
from ansible_collections.rosops.fleet.plugins.plugin_utils._k3s.wanted import wanted

PATHS = {"type": "list", "elements": "path", "required": True}
ARGUMENTS = {"write": PATHS, "remove": PATHS}


class ActionModule(ActionBase):  # type: ignore[misc] # ansible-core carries no types
    """What may hold passwords is written without a diff."""

    TRANSFERS_FILES = True

    def run(self, tmp: str | None = None, task_vars: dict[str, Any] | None = None) -> dict[str, Any]:
        result: dict[str, Any] = super().run(tmp, task_vars)
        params, known = self.validate_argument_spec(argument_spec=ARGUMENTS)[1], task_vars or {}
        host = ActionHost(self, known, check_mode=self._task.check_mode)
        result.update(changed=False, diff=[], written=params["write"], removed=params["remove"])
        try:
            files = wanted(
                role_variables("k3s", self._templar, known), known["inventory_hostname"], known["hostvars"]
            ).files
        except FleetError as error:
            return {**result, "failed": True, "msg": str(error), **error.details}
        done = [
            host.write(file.path, file.content, file.mode, diff=self._task.diff and not file.secret)
            for file in files
            if file.path in params["write"]
        ]
        done += [host.module("ansible.builtin.file", {"path": path, "state": "absent"}) for path in params["remove"]]
        for one in done:
            if one.get("failed"):
                return {**result, "failed": True, "msg": one.get("msg", "a file could not be written")}
            diffs = one.get("diff") or []
            result["diff"] += diffs if isinstance(diffs, list) else [diffs]
            result["changed"] |= bool(one.get("changed"))
        return result
