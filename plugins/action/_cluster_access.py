# SPDX-License-Identifier: GPL-3.0-or-later
"""For the playbook status: a host of each cluster gets the access to it, side by side, before one task asks them all.

Why there is none is what that task says of the cluster.
"""

from __future__ import annotations

import contextlib

from ..module_utils._common.documents import Arguments, Result, Variables
from ..module_utils._common.errors import FleetError
from ..plugin_utils._action.cluster import ClusterAction
from ..plugin_utils._model.fleet import home_from_vars


class ActionModule(ClusterAction):
    def options(self) -> Result:
        return {}

    def work(self, _params: Arguments, known: Variables) -> Result:
        home = home_from_vars(known)
        with contextlib.suppress(FleetError):
            if home:
                self.way(home, str(self._templar.template(known.get("k3s_kubeconfig_path")) or ""), known, {})
        return {"changed": False}
