# SPDX-License-Identifier: GPL-3.0-or-later
"""For the role k3s: fetch the administrator's kubeconfig, of which nothing is shown."""

from __future__ import annotations

import base64
import hashlib
from typing import ClassVar

from ..module_utils._common.documents import Arguments, Result, Variables
from ..module_utils._host.k3s import KUBECONFIG
from ..plugin_utils._action.base import FleetAction
from ..plugin_utils._action.host import ActionHost
from ..plugin_utils._k3s.wanted import wanted
from ..plugin_utils._kube.kubeconfig import is_foreign, keep, local_kubeconfig


class ActionModule(FleetAction):
    """`there`: whether the server has one already, which check mode cannot do without."""

    ARGUMENTS: ClassVar = {"there": {"type": "bool", "default": True}}

    def work(self, params: Arguments, known: Variables) -> Result:
        variables = self.variables(known, "k3s")
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
        config = local_kubeconfig(text.decode(errors="replace"), part.url, variables["k3s_cluster"], digest)
        return {"changed": keep(part.kubeconfig, config, self._task.check_mode), "path": part.kubeconfig}
