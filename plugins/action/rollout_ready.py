# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""rollout_ready on the control node itself, where it can say what is still open while it waits.

A module's output reaches the screen only when it has ended; a plugin's does at once.
"""

from __future__ import annotations

from typing import ClassVar

from ..module_utils._common.documents import Arguments, Result, Variables
from ..plugin_utils._action.cluster import ClusterAction
from ..plugin_utils._kube.cache import parse_refs
from ..plugin_utils._kube.wait import WaitOptions, look_once, wait_for_rollout


class ActionModule(ClusterAction):
    ARGUMENTS: ClassVar = {
        "objects": {"type": "list", "elements": "dict", "required": True, "aliases": ["definitions"]},
        "timeout": {"type": "float", "default": 300},
        "unschedulable_grace": {"type": "float", "default": 10},
        "fail_on_restart": {"type": "bool", "default": False},
    }
    of_users = True

    def work(self, params: Arguments, known: Variables) -> Result:
        refs = parse_refs(params["objects"])
        options = WaitOptions(
            timeout=params["timeout"],
            grace=params["unschedulable_grace"],
            fail_on_restart=params["fail_on_restart"],
            say=self.say(known),
        )
        with self.cluster(params, known, patience=0) as kube:  # the wait has a patience of its own
            found = look_once(kube, refs) if self._task.check_mode else wait_for_rollout(kube, refs, options)
        return {"changed": False, **found}
