# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""For the playbook rehearse: a robot's apps before and after the change, with stand-ins for all that is not changed."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, ClassVar

from ansible_collections.rosops.fleet.plugins.plugin_utils._action.base import FleetAction
from ansible_collections.rosops.fleet.plugins.plugin_utils._model.fleet import Fleet
from ansible_collections.rosops.fleet.plugins.plugin_utils._rehearsal.cast import Stage, cast
from ansible_collections.rosops.fleet.plugins.plugin_utils._rehearsal.files import load
from ansible_collections.rosops.fleet.plugins.plugin_utils._report.files import placed
from ansible_collections.rosops.fleet.plugins.plugin_utils._validate.layers import APPS, LAYERS, layered


class ActionModule(FleetAction):
    """`apps` are the robot's, `model` and `own` the layers over them.

    `image` and `command` are the stand-ins'; without an image they have the ROS master's.
    """

    _requires_connection = False
    ARGUMENTS: ClassVar = {
        "recording": {"type": "str", "required": True},
        "apps": {"type": "list", "elements": "dict", "required": True},
        "model": {"type": "list", "elements": "dict", "default": []},
        "own": {"type": "list", "elements": "dict", "default": []},
        "change": {"type": "dict", "required": True},
        "image": {"type": "str", "default": ""},
        "command": {"type": "list", "elements": "str", "default": ["/ros_entrypoint.sh"]},
    }

    def work(self, params: Mapping[str, Any], known: dict[str, Any]) -> dict[str, Any]:
        robot = Fleet.from_vars(known).robots[known["inventory_hostname"]]
        recording = load(placed(params["recording"]) or Path())
        stage = Stage(params["image"] or robot.master.image, tuple(params["command"]))
        layers = dict(zip((APPS, *LAYERS), (params["apps"], params["model"], params["own"]), strict=True))
        apps = layered(layers, "", [])[APPS]  # what is wrong with them the validation has said
        found = cast(recording, apps, params["change"], stage)
        self.say(known)(f"{recording.robot} is played; changed: {', '.join(params['change'])}")
        return {"changed": False, "before": list(found.before), "after": list(found.after)}
