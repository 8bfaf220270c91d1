# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""For the playbook rehearse: what became of the update, and what stand-ins got meanwhile, on screen and as a file."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, ClassVar

from ansible_collections.rosops.fleet.plugins.module_utils._common.errors import SpecError
from ansible_collections.rosops.fleet.plugins.module_utils._ros.recording import Recording
from ansible_collections.rosops.fleet.plugins.plugin_utils._action.base import FleetAction
from ansible_collections.rosops.fleet.plugins.plugin_utils._rehearsal.files import as_text, load
from ansible_collections.rosops.fleet.plugins.plugin_utils._rehearsal.review import accounts, review
from ansible_collections.rosops.fleet.plugins.plugin_utils._report.files import placed, write


class ActionModule(FleetAction):
    """`before` and `after` are recordings of the stage, `outcome` is what _robot_update returned."""

    _requires_connection = False
    ARGUMENTS: ClassVar = {
        "recording": {"type": "str", "required": True},
        "change": {"type": "dict", "required": True},
        "outcome": {"type": "dict", "required": True},
        "before": {"type": "dict", "required": True},
        "after": {"type": "dict", "required": True},
        "report": {"type": "str", "required": True},
    }

    def work(self, params: Mapping[str, Any], known: dict[str, Any]) -> dict[str, Any]:
        looks = [Recording.from_dict(params[key], f"the graph {key} the update") for key in ("before", "after")]
        told = [accounts(look.values) for look in looks]
        found = review(
            known["inventory_hostname"],
            load(placed(params["recording"]) or Path()),
            params["change"],
            params["outcome"],
            *told,
        )
        self.say(known)("\n".join(found.lines()))
        path = placed(params["report"])
        try:
            if path is not None and not self._task.check_mode:
                write(path, as_text(found.as_dict()))
        except OSError as error:
            raise SpecError(f"the report cannot be written: {error}") from error
        return {"changed": False, "rehearsal": found.as_dict()}
