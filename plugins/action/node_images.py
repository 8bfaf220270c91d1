# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""node_images: archives lie on the control node, their images are wanted on the host."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from ansible.plugins.action import ActionBase
from ansible.utils.display import Display
from ansible_collections.rosops.fleet.plugins.module_utils._common.errors import FleetError
from ansible_collections.rosops.fleet.plugins.plugin_utils._action.host import ActionHost
from ansible_collections.rosops.fleet.plugins.plugin_utils._images.node import DIRECTORY, Brought, NodeImages

display = Display()

ARGUMENTS = {
    "archives": {
        "type": "list",
        "elements": "dict",
        "default": [],
        "options": {
            "path": {"type": "path", "required": True},
            "images": {"type": "list", "elements": "str", "default": []},
        },
    },
    "names": {"type": "list", "elements": "str", "default": []},
    "rate_limit": {"type": "str", "default": ""},
    "directory": {"type": "path", "default": DIRECTORY},
}


class ActionModule(ActionBase):  # type: ignore[misc] # ansible-core carries no types
    TRANSFERS_FILES = True
    _supports_check_mode = True

    def run(self, tmp: str | None = None, task_vars: dict[str, Any] | None = None) -> dict[str, Any]:
        result: dict[str, Any] = super().run(tmp, task_vars)
        params = self.validate_argument_spec(argument_spec=ARGUMENTS)[1]
        name = (task_vars or {}).get("inventory_hostname", "")
        images = NodeImages(
            ActionHost(self, task_vars),
            params["directory"],
            params["rate_limit"],
            lambda text: display.display(f"[{name}] {text}"),
        )
        try:
            brought = images.bring(params["archives"], params["names"], self._task.check_mode)
        except FleetError as error:
            return {**result, "failed": True, "msg": str(error), **error.details}
        return {**result, **_outcome(brought)}


def _outcome(brought: Brought) -> dict[str, Any]:
    """The task's result; `failed` where an image is not there after all."""
    found: dict[str, Any] = {
        "changed": brought.changed,
        "imported": list(brought.imported),
        "pulled": list(brought.pulled),
        "images": dict(brought.after),
        "present": list(brought.present),
        "diff": {"before": _lines(brought.before), "after": _lines(brought.after)},
    }
    if brought.problems:
        found.update(failed=True, msg="; ".join(brought.problems))
    return found


def _lines(images: Mapping[str, str]) -> str:
    return "".join(f"{ref} {digest or 'as the registry has it'}\n" for ref, digest in sorted(images.items()))
