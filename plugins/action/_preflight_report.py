# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""For the role preflight: all findings about this host at once, measured against the other hosts of the play."""

from __future__ import annotations

from typing import Any

from ansible.plugins.action import ActionBase
from ansible_collections.rosops.fleet.plugins.module_utils._common.errors import FleetError
from ansible_collections.rosops.fleet.plugins.plugin_utils._action.variables import role_variables
from ansible_collections.rosops.fleet.plugins.plugin_utils._preflight.findings import judge
from ansible_collections.rosops.fleet.plugins.plugin_utils._preflight.requirements import (
    requirements,
    server_addresses,
)

ARGUMENTS = {"registered": {"type": "str", "required": True}}


class ActionModule(ActionBase):  # type: ignore[misc] # ansible-core carries no types
    """`registered` names the variable in which every host keeps its own facts."""

    _requires_connection = False

    def run(self, tmp: str | None = None, task_vars: dict[str, Any] | None = None) -> dict[str, Any]:
        result: dict[str, Any] = super().run(tmp, task_vars)
        known, name = task_vars or {}, self.validate_argument_spec(argument_spec=ARGUMENTS)[1]["registered"]
        host, hostvars = known["inventory_hostname"], known["hostvars"]
        try:
            variables = role_variables("preflight", self._templar, known)
            wanted = requirements(variables, server_addresses(variables, host, hostvars))
        except FleetError as error:
            return {**result, "failed": True, "msg": str(error), **error.details}
        # every host of the play that answered: names and MTUs are compared across them
        fleet = {other: hostvars[other][name]["facts"] for other in known["ansible_play_hosts"]}
        report = judge(fleet, host, wanted)
        return {
            **result,
            "changed": False,
            "failed": report["errors"] > 0,
            "msg": report["text"].splitlines(),
            "_ansible_verbose_always": True,
        }
