# SPDX-License-Identifier: GPL-3.0-or-later
"""For the playbook update_test: a robot's apps as they are and as they are to be, with stand-ins for all that stays."""

from __future__ import annotations

import json
from pathlib import Path
from typing import ClassVar

from ..module_utils._common.documents import Arguments, Result, Variables, json_of
from ..module_utils._common.errors import SpecError
from ..plugin_utils._action.base import FleetAction
from ..plugin_utils._model.fleet import Fleet
from ..plugin_utils._model.merge import APPS, layered
from ..plugin_utils._rehearsal.recording import cast, changed, parts
from ..plugin_utils._report.files import write


class ActionModule(FleetAction):
    """`now` and `next` are the layers of ros_apps. `dest` gets the files now.json and next.json: ros_apps, each."""

    _requires_connection = False
    ARGUMENTS: ClassVar = {
        "recording": {"type": "path", "required": True},
        "now": {"type": "dict", "required": True},
        "next": {"type": "dict", "required": True},
        "dest": {"type": "path", "required": True},
    }

    def work(self, params: Arguments, known: Variables) -> Result:
        recorded = Path(params["recording"])
        try:
            played = parts(json_of(recorded.read_text("utf-8")), str(recorded))
        except OSError as error:
            raise SpecError(f"the recording {recorded} cannot be read: {error.strerror}") from error
        except ValueError as error:
            raise SpecError(f"{recorded} is no JSON: {error}") from error
        image = Fleet.from_vars(known).robots[known["inventory_hostname"]].master.image
        apps = {key: layered(params[key], "", [])[APPS] for key in ("now", "next")}  # the validation says what is wrong
        real = changed(apps["now"], apps["next"])
        for key, items in apps.items():
            write(Path(params["dest"]) / f"{key}.json", json.dumps(cast(played, items, real, image)))
        self.say(known)(f"{recorded.name} is played; for real: {', '.join(real)}")
        return {"changed": False}
