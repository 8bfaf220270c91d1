# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""rollout_ready on the control node itself, where it can say what is still open while it waits.

A module's output reaches the screen only when it has ended; a plugin's does at once.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar

from ansible_collections.rosops.fleet.plugins.plugin_utils._action.cluster import ClusterAction
from ansible_collections.rosops.fleet.plugins.plugin_utils._kube.wait import ROLLOUT_ARGS, run, settings_from


class ActionModule(ClusterAction):
    ARGUMENTS: ClassVar = ROLLOUT_ARGS
    of_users = True

    def work(self, params: Mapping[str, Any], known: dict[str, Any]) -> dict[str, Any]:
        with self.cluster(params, known, patience=0) as kube:  # the wait has a patience of its own
            settings = settings_from(params, self.say(known))
            return {"changed": False, **run(params, kube, settings, self._task.check_mode)}
