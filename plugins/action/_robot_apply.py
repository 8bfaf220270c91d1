# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""For the roles of a robot's parts: one part is made from the host's variables and applied."""

from __future__ import annotations

from typing import Any, ClassVar, Mapping

from ansible_collections.rosops.fleet.plugins.plugin_utils._action.cluster import (
    ClusterAction,
    Variables,
    foreseen,
    written,
)
from ansible_collections.rosops.fleet.plugins.plugin_utils._kube.client import ref_of
from ansible_collections.rosops.fleet.plugins.plugin_utils._objects.common import Object
from ansible_collections.rosops.fleet.plugins.plugin_utils._objects.namespace import removed_claims
from ansible_collections.rosops.fleet.plugins.plugin_utils._objects.parts import PARTS, part_objects


class ActionModule(ClusterAction):
    """`remove_claims` names volumes whose claims, and with them the data, go; `remove_confirm` has to agree."""

    ARGUMENTS: ClassVar = {
        "part": {"type": "str", "choices": list(PARTS), "required": True},
        "remove_claims": {"type": "list", "elements": "str", "default": []},
        "remove_confirm": {"type": "bool", "default": False},
    }

    def work(self, params: Mapping[str, Any], known: dict[str, Any]) -> dict[str, Any]:
        check = self._task.check_mode
        removed = removed_claims(self.robot(known), params["remove_claims"], params["remove_confirm"])
        with self.cluster(params) as kube:
            return written(
                [*kube.apply(self._objects(params, known), check), *kube.delete(map(ref_of, removed), check)]
            )

    def foresee(self, params: Mapping[str, Any], known: dict[str, Any]) -> dict[str, Any]:
        return foreseen(self._objects(params, known))

    def _objects(self, params: Mapping[str, Any], known: dict[str, Any]) -> list[Object]:
        variables = Variables(self._templar, known)
        secrets = variables.get("robot_namespace_pull_secrets")
        return part_objects(params["part"], self.robot(known), secrets or ())
