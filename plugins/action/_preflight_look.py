# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""For the role preflight: the facts of this host, with the ports that its part in the cluster makes it need."""

from __future__ import annotations

from typing import Any

from ansible.plugins.action import ActionBase
from ansible_collections.rosops.fleet.plugins.module_utils._common.errors import FleetError
from ansible_collections.rosops.fleet.plugins.plugin_utils._action.host import ActionHost
from ansible_collections.rosops.fleet.plugins.plugin_utils._action.variables import role_variables
from ansible_collections.rosops.fleet.plugins.plugin_utils._preflight.requirements import look, server_addresses


class ActionModule(ActionBase):  # type: ignore[misc] # ansible-core carries no types
    def run(self, tmp: str | None = None, task_vars: dict[str, Any] | None = None) -> dict[str, Any]:
        result: dict[str, Any] = super().run(tmp, task_vars)
        known = task_vars or {}
        try:
            variables = role_variables("preflight", self._templar, known)
            servers = server_addresses(variables, known["inventory_hostname"], known["hostvars"])
        except FleetError as error:
            return {**result, "failed": True, "msg": str(error), **error.details}
        return {**result, **ActionHost(self, known).action("rosops.fleet.preflight_info", look(variables, servers))}
