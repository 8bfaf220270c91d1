# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""For the playbook record: keep a robot's recording as a file of the control node, its user's alone."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar

from ansible_collections.rosops.fleet.plugins.module_utils._common.errors import SpecError
from ansible_collections.rosops.fleet.plugins.module_utils._ros.recording import Recording
from ansible_collections.rosops.fleet.plugins.plugin_utils._action.base import FleetAction
from ansible_collections.rosops.fleet.plugins.plugin_utils._rehearsal.files import as_text
from ansible_collections.rosops.fleet.plugins.plugin_utils._report import files


class ActionModule(FleetAction):
    _requires_connection = False
    ARGUMENTS: ClassVar = {
        "recording": {"type": "dict", "required": True},
        "path": {"type": "str", "required": True},
    }

    def work(self, params: Mapping[str, Any], known: dict[str, Any]) -> dict[str, Any]:
        found = Recording.from_dict(params["recording"], "what the robot's host returned")
        path = files.placed(params["path"])
        if path is None:
            raise SpecError("record_file is empty: say where the recording goes")
        text = as_text(found.as_dict())
        self.say(known)(
            f"{len(found.apps)} apps, {sum(len(app.nodes) for app in found.apps.values()) + len(found.others)} nodes, "
            f"{len(found.topics)} topics, {len(found.services)} services: {path}"
        )
        try:
            changed = files.text_of(path) != text
            if changed and not self._task.check_mode:
                files.write(path, text)
        except OSError as error:
            raise SpecError(f"the recording cannot be written: {error}") from error
        return {"changed": changed, "path": str(path)}
