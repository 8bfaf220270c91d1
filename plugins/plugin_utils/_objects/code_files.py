# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""The code that runs in pods, and the ConfigMaps that they mount it from.

The code is no part of a pod template: a newer collection restarts nothing.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from ...module_utils._pod import run
from ...module_utils._step.objects import Object
from .._model import names
from .._model.context import Robot
from .common import config_map, owner_labels

MODULE_UTILS = Path(run.__file__).resolve().parents[1]
# Whole rooms of module_utils; their order is that of the files.
ROOMS = ("_common", "_pod", "_robot", "_ros", "_step")
EXPORTER_ROOMS = ("_common", "_exporter", "_ros")
# A keeper of a collection before 1.0 loads it by this name when it first needs it, and it may run on with these files.
FORMER = {"_pod.latched_topics.py": "from .._robot.latched_topics import LatchedTopics as LatchedTopics\n"}


def app_files() -> dict[str, str]:
    """File name -> content of what app pods and the keeper run: `run.py`, and `<package>.<module>.py`."""
    return {**_read(ROOMS), **FORMER}


def exporter_files() -> dict[str, str]:
    """The same for the exporter's pod."""
    return _read(EXPORTER_ROOMS)


def _read(rooms: Sequence[str]) -> dict[str, str]:
    paths = [path for room in rooms for path in sorted((MODULE_UTILS / room).rglob("*.py"))]
    files = {".".join(path.relative_to(MODULE_UTILS).parts): path.read_text("utf-8") for path in paths}
    files.pop("_pod.run.py", None)  # the entry has a name of its own
    return {"run.py": Path(run.__file__).read_text("utf-8"), **files}


def code_maps(robot: Robot, code: Mapping[str, str]) -> list[Object]:
    """The ConfigMaps `rosops-code`, one per namespace that has pods with our code; `code` is file name -> content."""
    scopes = {app.scope for app in robot.apps if app.hooks != "none"}
    mode, objects = robot.master.mode, []
    if "robot" in scopes or mode == "robot":  # the keeper of a master mounts it, too
        objects.append(config_map(names.CODE_NAME, robot.namespace, owner_labels(robot.name), code))
    if "fleet" in scopes or mode == "shared":
        objects.append(config_map(names.CODE_NAME, names.FLEET_NAMESPACE, owner_labels(None), code))
    return objects
