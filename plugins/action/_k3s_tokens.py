# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""For the role k3s: keep the tokens on the host, of which nothing is shown."""

from __future__ import annotations

from typing import Any

from ansible.plugins.action import ActionBase
from ansible_collections.rosops.fleet.plugins.module_utils._common.errors import FleetError
from ansible_collections.rosops.fleet.plugins.module_utils._host.k3s import CONFIG_DIR
from ansible_collections.rosops.fleet.plugins.plugin_utils._action.host import ActionHost
from ansible_collections.rosops.fleet.plugins.plugin_utils._action.variables import plain, role_variables
from ansible_collections.rosops.fleet.plugins.plugin_utils._k3s.tokens import tokens_to_keep

ARGUMENTS = {
    "names": {"type": "list", "elements": "str", "required": True},
    "registered": {"type": "str", "required": True},
}


class ActionModule(ActionBase):  # type: ignore[misc] # ansible-core carries no types
    """`registered` names the variable with what slurp read on the first server; on that server it does not exist."""

    TRANSFERS_FILES = True

    def run(self, tmp: str | None = None, task_vars: dict[str, Any] | None = None) -> dict[str, Any]:
        result: dict[str, Any] = super().run(tmp, task_vars)
        params, known = self.validate_argument_spec(argument_spec=ARGUMENTS)[1], task_vars or {}
        host = ActionHost(self, known, check_mode=self._task.check_mode)
        read = plain(self._templar.template(known.get(params["registered"], {}))).get("results", [])
        try:
            texts = tokens_to_keep(params["names"], read, role_variables("k3s", self._templar, known))
        except FleetError as error:
            return {**result, "failed": True, "msg": str(error), **error.details}
        for name, text in texts.items():
            one = host.write(f"{CONFIG_DIR}/{name}", f"{text}\n", "0600", diff=False)
            if one.get("failed"):
                return {**result, "failed": True, "msg": f"{CONFIG_DIR}/{name} could not be written: {one.get('msg')}"}
            result["changed"] = result.get("changed", False) or bool(one.get("changed"))
        return result
