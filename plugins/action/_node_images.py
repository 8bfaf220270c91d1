# SPDX-License-Identifier: GPL-3.0-or-later
"""For the role images: archives lie on the control node, their images are wanted on the host."""

from __future__ import annotations

from typing import ClassVar

from ..module_utils._common.documents import Arguments, Result, Variables
from ..plugin_utils._action.base import FleetAction
from ..plugin_utils._action.host import ActionHost
from ..plugin_utils._images.node import NodeImages
from ..plugin_utils._model.fleet import VARIABLE, robot_from_vars
from ..plugin_utils._objects.parts import images


class ActionModule(FleetAction):
    """`names` are images beside those of the role's variables, `logins` items of robot_namespace_pull_secrets."""

    TRANSFERS_FILES = True
    ARGUMENTS: ClassVar = {
        "names": {"type": "list", "elements": "str", "default": []},
        "logins": {"type": "list", "elements": "dict", "default": [], "no_log": True},
    }

    def work(self, params: Arguments, known: Variables) -> Result:
        wanted = self.variables(known, "images")
        node = NodeImages(ActionHost(self, known), wanted["images_rate_limit"], self.say(known), params["logins"])
        names = [*wanted["images_refs"], *params["names"]]
        return node.bring(wanted["images_archives"], names, self._task.check_mode, _kept(known))


def _kept(known: Variables) -> list[str]:
    """What the apps of a robot run on its own host: a step may have brought it, and nobody asks for it here."""
    robots = (known.get(VARIABLE) or {}).get("robots") or {}
    return images(robot_from_vars(known), "local") if known["inventory_hostname"] in robots else []
