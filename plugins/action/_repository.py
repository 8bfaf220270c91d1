# SPDX-License-Identifier: GPL-3.0-or-later
"""For the playbook new: the files of one fleet's own repository, on the control node."""

from __future__ import annotations

from pathlib import Path
from typing import ClassVar

from ..module_utils._common.documents import Arguments, Result, Variables
from ..module_utils._common.errors import FleetError
from ..plugin_utils._action.base import FleetAction
from ..plugin_utils._repository.contents import EXAMPLE_FLEETS, contents, fleet_name, plan, read, write
from ..plugin_utils._upstream.ansible_core import SHOWN

COLLECTION = Path(__file__).resolve().parents[2]


class ActionModule(FleetAction):
    """`dest`, relative to the current directory, gets what it lacks; with `force` what differs is overwritten."""

    _requires_connection = False
    ARGUMENTS: ClassVar = {
        "dest": {"type": "str", "required": True},
        "force": {"type": "bool", "default": False},
        "example": {"type": "str", "choices": list(EXAMPLE_FLEETS), "default": EXAMPLE_FLEETS[0]},
    }

    def work(self, params: Arguments, _known: Variables) -> Result:
        if not params["dest"]:
            raise FleetError("It is not said where the repository shall be. Give a directory: -e dest=my-fleet")
        top = Path(params["dest"]).expanduser().absolute()
        wanted = contents(COLLECTION, fleet_name(top.name), params["example"])
        changes, differ = plan(wanted, read(top, wanted), params["force"])
        if not self._task.check_mode:
            write(top, changes)
        kept = ["They differ and stay as they are (-e force=yes overwrites them):", *differ]
        return {
            "changed": bool(changes),
            "diff": [change.diff for change in changes],
            "msg": [f"{top}:", *(change.path for change in changes), *(kept if differ else [])],
            **SHOWN,
        }
