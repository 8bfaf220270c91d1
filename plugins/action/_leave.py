# SPDX-License-Identifier: GPL-3.0-or-later
"""For the playbooks: a host leaves the run for what became of it, which is the run's exit status, too.

One that was off is unreachable (4): whether it has come back meanwhile is for the next run. Others fail (2).
"""

from __future__ import annotations

from typing import ClassVar

from ..module_utils._common.documents import Arguments, Result, Variables
from ..plugin_utils._action.base import FleetAction
from ..plugin_utils._model.outcomes import BUSY, FAILED, OFFLINE, ROLLED_BACK


class ActionModule(FleetAction):
    """`outcome` is the host's, as _robot_update has it, or empty. `check`: check mode fails for it, too."""

    _requires_connection = False
    ARGUMENTS: ClassVar = {
        "outcome": {"type": "dict", "default": {}},
        "check": {"type": "bool", "default": False},
    }

    def work(self, params: Arguments, _known: Variables) -> Result:
        word, reason = params["outcome"].get("outcome"), params["outcome"].get("reason")
        if word == OFFLINE:
            return {"changed": False, "unreachable": True, "msg": reason}
        if word in (FAILED, ROLLED_BACK, BUSY) and (params["check"] or not self._task.check_mode):
            return {"changed": False, "failed": True, "msg": f"{word}: {reason}"}
        return {"changed": False}
