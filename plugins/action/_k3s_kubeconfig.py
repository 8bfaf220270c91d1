# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""For the role k3s: fetch the administrator's kubeconfig, of which nothing is shown."""

from __future__ import annotations

import base64
import hashlib
from typing import Any

from ansible.plugins.action import ActionBase
from ansible_collections.rosops.fleet.plugins.module_utils._common.errors import FleetError
from ansible_collections.rosops.fleet.plugins.module_utils._host.k3s import KUBECONFIG
from ansible_collections.rosops.fleet.plugins.plugin_utils._action.host import ActionHost
from ansible_collections.rosops.fleet.plugins.plugin_utils._action.variables import role_variables
from ansible_collections.rosops.fleet.plugins.plugin_utils._k3s.kubeconfig import keep, local_kubeconfig
from ansible_collections.rosops.fleet.plugins.plugin_utils._k3s.wanted import wanted

ARGUMENTS = {"there": {"type": "bool", "required": True}}


class ActionModule(ActionBase):  # type: ignore[misc] # ansible-core carries no types
    """`there`: whether the server has one already, which check mode cannot do without."""

    def run(self, tmp: str | None = None, task_vars: dict[str, Any] | None = None) -> dict[str, Any]:
        result: dict[str, Any] = super().run(tmp, task_vars)
        there, known = self.validate_argument_spec(argument_spec=ARGUMENTS)[1]["there"], task_vars or {}
        try:
            variables = role_variables("k3s", self._templar, known)
            part = wanted(variables, known["inventory_hostname"], known["hostvars"])
            if self._task.check_mode and not there:
                return {**result, "changed": True, "msg": f"{part.kubeconfig} would be written"}
            read = ActionHost(self, known).module("ansible.builtin.slurp", {"src": KUBECONFIG})
            if read.get("failed"):
                return {**result, "failed": True, "msg": read.get("msg", f"{KUBECONFIG} cannot be read")}
            text = base64.b64decode(read["content"])
            digest = hashlib.sha256(text).hexdigest()
            config = local_kubeconfig(text.decode(), part.url, variables["k3s_cluster"], digest)
            changed = keep(part.kubeconfig, config, self._task.check_mode)
        except FleetError as error:
            return {**result, "failed": True, "msg": str(error), **error.details}
        return {**result, "changed": changed, "path": part.kubeconfig}
