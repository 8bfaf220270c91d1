# SPDX-License-Identifier: GPL-3.0-or-later
"""For the role k3s: have the host download the binary, through the proxies that its k3s itself goes through.

A password in one of these is on no command line, as it would be with a task's `environment`.
"""

from __future__ import annotations

from typing import ClassVar

from ..module_utils._common.documents import Arguments, Result, Variables
from ..module_utils._host.k3s import BINARY
from ..plugin_utils._action.base import FleetAction
from ..plugin_utils._action.host import ActionHost
from ..plugin_utils._action.variables import plain


class ActionModule(FleetAction):
    """`plan` is what _k3s_plan found."""

    ARGUMENTS: ClassVar = {"plan": {"type": "dict", "required": True}}

    def work(self, params: Arguments, known: Variables) -> Result:
        plan, variables = plain(params["plan"]), self.variables(known, "k3s")
        asked = {name: plan["source"][name] for name in ("url", "sha256", "sums")} | {"dest": BINARY + plan["staged"]}
        host = ActionHost(self, known, check_mode=self._task.check_mode)
        return host.job("k3s_download", asked, {"environment": variables["k3s_environment"]})
