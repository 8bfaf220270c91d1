# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""For the role observability: the images that the chosen profile needs."""

from __future__ import annotations

from typing import Any

from ansible.plugins.action import ActionBase
from ansible_collections.rosops.fleet.plugins.module_utils._common.errors import FleetError
from ansible_collections.rosops.fleet.plugins.plugin_utils._action.variables import role_variables
from ansible_collections.rosops.fleet.plugins.plugin_utils._observability.spec import images, spec_of


class ActionModule(ActionBase):  # type: ignore[misc] # ansible-core carries no types
    _requires_connection = False

    def run(self, tmp: str | None = None, task_vars: dict[str, Any] | None = None) -> dict[str, Any]:
        result: dict[str, Any] = super().run(tmp, task_vars)
        try:
            spec = spec_of(role_variables("observability", self._templar, task_vars or {}))
        except FleetError as error:
            return {**result, "failed": True, "msg": str(error), **error.details}
        return {**result, "changed": False, "images": images(spec), "_ansible_verbose_always": True}
