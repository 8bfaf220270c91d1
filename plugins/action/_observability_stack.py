# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""For the role observability: bring a cluster's stack to what the role's variables say, in the process of this task.

Everything is built before anything is applied, so whatever is wrong with a dashboard or a setting is said first.
"""

from __future__ import annotations

import os
import secrets
from typing import Any

from ansible.plugins.action import ActionBase
from ansible.utils.display import Display
from ansible_collections.rosops.fleet.plugins.module_utils._common.errors import FleetError
from ansible_collections.rosops.fleet.plugins.plugin_utils._action.variables import role_variables
from ansible_collections.rosops.fleet.plugins.plugin_utils._kube.access import AUTH_ARG_SPEC
from ansible_collections.rosops.fleet.plugins.plugin_utils._kube.applied import Applied, diff_of
from ansible_collections.rosops.fleet.plugins.plugin_utils._kube.cache import parse_refs
from ansible_collections.rosops.fleet.plugins.plugin_utils._kube.client import Kube, ref_of
from ansible_collections.rosops.fleet.plugins.plugin_utils._kube.wait import Settings, wait_for_rollout
from ansible_collections.rosops.fleet.plugins.plugin_utils._observability import stack
from ansible_collections.rosops.fleet.plugins.plugin_utils._observability.files import stack_files
from ansible_collections.rosops.fleet.plugins.plugin_utils._observability.spec import spec_of
from ansible_collections.rosops.fleet.plugins.plugin_utils._report.rows import nodes_off

display = Display()


class ActionModule(ActionBase):  # type: ignore[misc] # ansible-core carries no types
    _requires_connection = False
    _supports_check_mode = True

    def run(self, tmp: str | None = None, task_vars: dict[str, Any] | None = None) -> dict[str, Any]:
        result: dict[str, Any] = super().run(tmp, task_vars)
        auth, known = self.validate_argument_spec(argument_spec=AUTH_ARG_SPEC)[1], task_vars or {}
        self._host = known.get("inventory_hostname", "")
        try:
            variables = role_variables("observability", self._templar, known)
            spec = spec_of(variables)
            base = known.get("inventory_dir") or ""
            files = stack_files(variables["observability_dashboards"], base, spec["grafana"]["default_dashboards"])
            stack.stack_objects(spec, files)
            os.environ.update(self._environment())  # this process is of one task alone, as a module's would be
            with Kube(auth) as kube:
                written = self._apply(kube, spec, files, variables["observability_grafana_admin_password"])
                result["changed"] = any(one.changed for one in written)
                if self._task.diff:
                    result["diff"] = diff_of(written)
                if not self._task.check_mode:  # it made nothing that could be waited for
                    self._wait(kube, stack.stack_objects(spec, files), variables["observability_ready_timeout"])
        except FleetError as error:
            result.update(failed=True, msg=str(error), **error.details)
        return result

    def _apply(self, kube: Kube, spec: dict[str, Any], files: dict[str, Any], password: str) -> list[Applied]:
        check, admin = bool(self._task.check_mode), {"password": "", "version": ""}
        if stack.has_grafana(spec):
            there = kube.get(ref_of(stack.ADMIN_SECRET))
            admin = stack.grafana_admin(there, password, secrets.token_hex(20))
        kept = stack.stack_secrets(spec, admin)
        objects = stack.stack_objects(spec, files, admin["version"])
        written = kube.apply([stack.namespace_object(spec), *kept, *objects[1:]], check)
        return written + kube.delete([ref_of(one) for one in stack.leftovers(spec)], check)

    def _wait(self, kube: Kube, objects: list[dict[str, Any]], timeout: float) -> None:
        off = nodes_off(kube.nodes())
        if off:
            self._say(
                f"{', '.join(off)}: off; what every host runs starts there when they are back, and is not waited for"
            )
        # a DaemonSet cannot be rolled out while a host of the cluster is off: that is no fault of the stack
        kinds = ("Deployment", "PersistentVolumeClaim", *(() if off else ("DaemonSet",)))
        refs = parse_refs([one for one in objects if one["kind"] in kinds])
        wait_for_rollout(kube, refs, Settings(timeout, say=self._say))

    def _say(self, text: str) -> None:
        display.display(f"[{self._host}] {text}")

    def _environment(self) -> dict[str, str]:
        """The task's `environment`, which a module would find in its own."""
        found: dict[str, Any] = {}
        self._compute_environment_string(found)
        return {str(key): str(value) for key, value in found.items()}
