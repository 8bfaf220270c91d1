# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""For the role k3s: fetch the administrator's kubeconfig, of which nothing is shown."""

from __future__ import annotations

import base64
import hashlib
from collections.abc import Mapping
from typing import Any, ClassVar

from ansible_collections.rosops.fleet.plugins.module_utils._host.k3s import KUBECONFIG
from ansible_collections.rosops.fleet.plugins.plugin_utils._action.base import FleetAction
from ansible_collections.rosops.fleet.plugins.plugin_utils._action.host import ActionHost
from ansible_collections.rosops.fleet.plugins.plugin_utils._action.variables import role_variables
from ansible_collections.rosops.fleet.plugins.plugin_utils._k3s.wanted import wanted
from ansible_collections.rosops.fleet.plugins.plugin_utils._kube.kubeconfig import is_foreign, keep, local_kubeconfig


class ActionModule(FleetAction):
    """`there`: whether the server has one already, which check mode cannot do without."""

    ARGUMENTS: ClassVar = {"there": {"type": "bool", "required": True}}

    def work(self, params: Mapping[str, Any], known: dict[str, Any]) -> dict[str, Any]:
        variables = role_variables("k3s", self._templar, known)
        part = wanted(variables, known["inventory_hostname"], known["hostvars"])
        if is_foreign(part.kubeconfig):
            return {"changed": False, "msg": f"{part.kubeconfig} was not written by this role and stays as it is"}
        if self._task.check_mode and not params["there"]:
            return {"changed": True, "msg": f"{part.kubeconfig} would be written"}
        read = ActionHost(self, known).module("ansible.builtin.slurp", {"src": KUBECONFIG})
        if read.get("failed"):
            return {"failed": True, "msg": read.get("msg", f"{KUBECONFIG} cannot be read")}
        text = base64.b64decode(read["content"])
        digest = hashlib.sha256(text).hexdigest()
        config = local_kubeconfig(text.decode(), part.url, variables["k3s_cluster"], digest)
        return {"changed": keep(part.kubeconfig, config, self._task.check_mode), "path": part.kubeconfig}
