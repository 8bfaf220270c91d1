# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""For the collection's roles: a list of Kubernetes objects is applied, in its order, or (state: absent) deleted."""

from __future__ import annotations

from typing import Any, ClassVar, Mapping

from ansible_collections.rosops.fleet.plugins.plugin_utils._action.cluster import ClusterAction, foreseen, written
from ansible_collections.rosops.fleet.plugins.plugin_utils._kube.client import Kube, ref_of


class ActionModule(ClusterAction):
    ARGUMENTS: ClassVar = {
        "objects": {"type": "list", "elements": "dict", "required": True},
        "state": {"type": "str", "choices": ["present", "absent"], "default": "present"},
    }

    def work(self, params: Mapping[str, Any], _known: dict[str, Any]) -> dict[str, Any]:
        with Kube(params) as kube:
            if params["state"] == "absent":
                return written(kube.delete([ref_of(obj) for obj in params["objects"]], self._task.check_mode))
            return written(kube.apply(params["objects"], self._task.check_mode))

    def foresee(self, params: Mapping[str, Any], _known: dict[str, Any]) -> dict[str, Any]:
        return foreseen(params["objects"] if params["state"] == "present" else [])
