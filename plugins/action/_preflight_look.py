# SPDX-License-Identifier: GPL-3.0-or-later
"""For the role preflight: the facts of this host, with the ports that its part in the cluster makes it need.

Where the host's Python is too old for modules, that is said: no module can, and Ansible's own words name no way out.
"""

from __future__ import annotations

import time
from typing import ClassVar

from ..module_utils._common.documents import Arguments, Result, Variables
from ..module_utils._common.errors import FleetError
from ..plugin_utils._action.base import FleetAction
from ..plugin_utils._action.host import ActionHost
from ..plugin_utils._model.machines import too_old
from ..plugin_utils._preflight.findings import PART, clock_offset, comparable, look, server_addresses


class ActionModule(FleetAction):
    """The host's clock is measured by the call itself: the task's own start and end have the slowest host between."""

    ARGUMENTS: ClassVar = PART

    def work(self, params: Arguments, known: Variables) -> Result:
        name = known["inventory_hostname"]
        arguments = look(params["role"], server_addresses(params["servers"], name, known["hostvars"]))
        sent = time.time()
        result = ActionHost(self, known).job("facts", arguments)
        received = time.time()
        if "facts" in result:
            if not comparable(result["facts"]):
                raise FleetError(f"{name} tells nonsense of itself")
            clock = result["facts"]["clock"]
            result["facts"]["clock"] = clock_offset(sent, clock["began"], clock["ended"], received)
        elif old := self._python_too_old():
            result["msg"] = f"{name} {old}"
        return result

    def _python_too_old(self) -> str:
        """Asked without a module, by the interpreter that was to run it; empty where it is new enough."""
        program = (self._used_interpreter or "python3").lstrip("#!")
        asked = self._low_level_execute_command(f"{program} -c 'import sys; print(sys.version_info[:2])'")
        return too_old(asked["stdout"]) if asked["rc"] == 0 else ""
