# SPDX-License-Identifier: GPL-3.0-or-later
"""For the role k3s: wait until the host's k3s serves, or say why it does not."""

from __future__ import annotations

from typing import ClassVar

from ..module_utils._common.documents import Arguments, Result, Variables
from ..plugin_utils._action.base import FleetAction
from ..plugin_utils._action.host import ActionHost


class ActionModule(FleetAction):
    """`member`: the Node's name of a server whose vote in etcd is waited for, too."""

    ARGUMENTS: ClassVar = {"member": {"type": "str", "default": ""}}

    def work(self, params: Arguments, known: Variables) -> Result:
        variables = self.variables(known, "k3s")
        asked = {"role": variables["k3s_role"], "timeout": variables["k3s_start_timeout"], **params}
        return ActionHost(self, known).job("k3s_ready", asked)
