# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""What action plugins on a cluster share: access, check mode without a cluster, the result of writes."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from typing import Any

from ansible_collections.rosops.fleet.plugins.plugin_utils._action.base import FleetAction
from ansible_collections.rosops.fleet.plugins.plugin_utils._kube.access import AUTH_ARG_SPEC, NoClusterError
from ansible_collections.rosops.fleet.plugins.plugin_utils._kube.applied import Applied, diff_of
from ansible_collections.rosops.fleet.plugins.plugin_utils._kube.client import ref_of


class ClusterAction(FleetAction):
    """An action on the cluster's API, from the control node, in the process of the task.

    Options are kubernetes.core's for the access and those in ARGUMENTS. Where check mode has no cluster
    to compare with, because the run would make it first, `foresee` says what would be done.
    """

    _requires_connection = False

    def options(self) -> dict[str, Any]:
        return {**AUTH_ARG_SPEC, **self.ARGUMENTS}

    def perform(self, params: Mapping[str, Any], known: dict[str, Any]) -> dict[str, Any]:
        # The task's `environment`, which a module would find in its own. This process, too, is of one task alone.
        os.environ.update(self._environment())
        try:
            return self.work(params, known)
        except NoClusterError:
            if not self._task.check_mode:
                raise
            return self.foresee(params, known)

    def foresee(self, _params: Mapping[str, Any], _known: dict[str, Any]) -> dict[str, Any]:
        """The task's result in check mode, where there is no cluster yet."""
        return {"changed": False, "skipped": True, "msg": "there is no cluster yet"}

    def _environment(self) -> dict[str, str]:
        found: dict[str, Any] = {}
        self._compute_environment_string(found)
        return {str(key): str(value) for key, value in found.items()}


def written(done: Sequence[Applied]) -> dict[str, Any]:
    """The result of a task that wrote objects: `changed`, `diff`, and in `results` what became of each."""
    return {
        "changed": any(one.changed for one in done),
        "diff": diff_of(done),
        "results": [
            {"kind": one.ref.kind, "name": one.ref.name, "namespace": one.ref.namespace, "changed": one.changed}
            for one in done
        ],
    }


def foreseen(objects: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """The same where there is no cluster yet: all of it would be new. The diff names it."""
    names = [str(ref_of(obj)) for obj in objects]
    return {
        "changed": bool(names),
        "diff": {"before": "", "after": "".join(f"{name}\n" for name in names)},
        "msg": f"there is no cluster yet; would create {', '.join(names) or 'nothing'}",
    }
