# SPDX-License-Identifier: GPL-3.0-or-later
"""For the role k3s: take k3s off the host, and with a cluster's last server the kubeconfig that was written for it."""

from __future__ import annotations

from pathlib import Path

from ..module_utils._common.documents import Arguments, Result, Variables
from ..plugin_utils._action.base import FleetAction
from ..plugin_utils._action.host import ActionHost
from ..plugin_utils._k3s.wanted import wanted
from ..plugin_utils._kube.kubeconfig import is_of


class ActionModule(FleetAction):
    def work(self, _params: Arguments, known: Variables) -> Result:
        variables = self.variables(known, "k3s")
        asked = {"volumes": variables["k3s_remove_volumes"], "identity": variables["k3s_remove_identity"]}
        found = ActionHost(self, known, check_mode=self._task.check_mode).job("k3s_remove", asked)
        # other servers may go on with the cluster
        if found.get("failed") or set(variables["k3s_server_hosts"]) - set(known["ansible_play_hosts_all"]):
            return found
        return {**found, **self._forget(variables, known, bool(found["changed"]))}

    def _forget(self, variables: Variables, known: Variables, changed: bool) -> Result:
        """Delete the one of this cluster; another one's stays. `changed`: so was the host."""
        part, cluster = wanted(variables, known["inventory_hostname"], known["hostvars"]), variables["k3s_cluster"]
        path = Path(part.kubeconfig)
        if not (part.kubeconfig and path.exists()):
            return {"changed": changed}
        if not is_of(part.kubeconfig, part.url, cluster):
            return {"changed": changed, "msg": f"{path} was not written for the cluster {cluster} and stays as it is"}
        if not self._task.check_mode:
            path.unlink()
        return {"changed": True, "path": part.kubeconfig}
