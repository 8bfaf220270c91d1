# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""For the roles of a robot's parts: one part is made from the validated fleet and applied."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar

from ansible_collections.rosops.fleet.plugins.plugin_utils._action.cluster import ClusterAction, foreseen, written
from ansible_collections.rosops.fleet.plugins.plugin_utils._kube.client import ref_of
from ansible_collections.rosops.fleet.plugins.plugin_utils._model.fleet import robot_from_vars
from ansible_collections.rosops.fleet.plugins.plugin_utils._objects.common import Object
from ansible_collections.rosops.fleet.plugins.plugin_utils._objects.exporter import Settings
from ansible_collections.rosops.fleet.plugins.plugin_utils._objects.namespace import removed_claims
from ansible_collections.rosops.fleet.plugins.plugin_utils._objects.parts import PARTS, Outside, part_objects


class ActionModule(ClusterAction):
    """`remove_claims` names volumes whose claims, and with them the data, go; `remove_confirm` has to agree.

    `statistics` and `claims_path` are of the exporter.
    """

    ARGUMENTS: ClassVar = {
        "part": {"type": "str", "choices": list(PARTS), "required": True},
        "remove_claims": {"type": "list", "elements": "str", "default": []},
        "remove_confirm": {"type": "bool", "default": False},
        "statistics": {"type": "bool", "default": False},
        "claims_path": {"type": "str", "default": ""},
    }

    def work(self, params: Mapping[str, Any], known: dict[str, Any]) -> dict[str, Any]:
        check, objects = self._task.check_mode, self._objects(params, known)
        removed = removed_claims(robot_from_vars(known), params["remove_claims"], params["remove_confirm"])
        with self.cluster(params, known) as kube:
            return written([*kube.apply(objects, check), *kube.delete(map(ref_of, removed), check)])

    def foresee(self, params: Mapping[str, Any], known: dict[str, Any]) -> dict[str, Any]:
        return foreseen(self._objects(params, known))

    def _objects(self, params: Mapping[str, Any], known: dict[str, Any]) -> list[Object]:
        secrets = self._templar.template(known.get("robot_namespace_pull_secrets")) or ()
        exporter = Settings(statistics=params["statistics"], claims_path=params["claims_path"])
        return part_objects(params["part"], robot_from_vars(known), Outside(secrets, exporter))
