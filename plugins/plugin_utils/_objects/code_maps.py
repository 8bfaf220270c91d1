# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""A robot and the in-pod code -> the ConfigMaps that pods mount. Pure.

The code is no part of a pod template: a newer collection restarts nothing.
"""

from __future__ import annotations

from collections.abc import Mapping

from ...module_utils._step.objects import Object
from .._model import names
from .._model.context import Robot
from .common import config_map, owner_labels


def code_maps(robot: Robot, code: Mapping[str, str]) -> list[Object]:
    """The ConfigMaps `rosops-code`, one per namespace that has pods with our code; `code` is file name -> content."""
    scopes = {app.scope for app in robot.apps if app.hooks != "none"}
    mode, objects = robot.master.mode, []
    if "robot" in scopes or mode == "robot":  # the keeper of a master mounts it, too
        objects.append(config_map(names.CODE_NAME, robot.namespace, owner_labels(robot.name), code))
    if "fleet" in scopes or mode == "shared":
        objects.append(config_map(names.CODE_NAME, names.FLEET_NAMESPACE, owner_labels(None), code))
    return objects
