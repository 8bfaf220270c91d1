# SPDX-License-Identifier: GPL-3.0-or-later
"""The code that runs in pods, and the ConfigMaps that they mount it from.

The code is no part of a pod template: a newer collection restarts nothing.
"""

from __future__ import annotations

import functools
import re
from collections.abc import Mapping
from pathlib import Path

from ...module_utils._pod import run
from ...module_utils._step.objects import Object
from .._model import context, names
from .._model.context import Robot
from .common import config_map, owner_labels

MODULE_UTILS = Path(run.__file__).resolve().parents[1]
ENTRY = "run.py"
LAUNCHER = "_pod.launch"  # runs by itself, on the image's own interpreter
# A keeper of a collection before 1.0 loads it by this name when it first needs it, and it may run on with these files.
FORMER = {"_pod.latched_topics.py": "from .._robot.latched_topics import LatchedTopics as LatchedTopics\n"}
# Parsing all files costs every run a quarter of a second; our own code imports in no other form.
_IMPORT = re.compile(r"^[ \t]*from (\.+)([\w.]*) import (\([^)]*\)|[^\n]*)", re.MULTILINE)
_NAME = re.compile(r"(?:^|[(,])\s*(\w+)")


def app_files() -> dict[str, str]:
    """File name -> content of what app pods and the keeper run: `run.py`, and `<package>.<module>.py`."""
    return {**_read(), **FORMER}


@functools.cache
def _read() -> dict[str, str]:
    """The entry, and every module that it reaches: each byte is held in etcd for every robot, and in its pods."""
    files, todo = {ENTRY: Path(run.__file__).read_text("utf-8")}, [*run.COMMANDS.values(), LAUNCHER]
    while todo:
        module = todo.pop()
        if f"{module}.py" not in files:
            text = MODULE_UTILS.joinpath(*module.split(".")).with_suffix(".py").read_text("utf-8")
            files[f"{module}.py"] = text
            todo += relative_imports(module, text)
    return files


def relative_imports(module: str, text: str) -> list[str]:
    """Modules (`<package>.<module>`) that a module imports anywhere in it, in functions, too."""
    package = module.split(".")[:-1]
    found: list[str] = []
    for dots, name, listed in _IMPORT.findall(text):
        where = ".".join([*package[: len(package) - len(dots) + 1], *([name] if name else [])])
        whole = name and "." in where  # else it names a package, and modules of it
        found += [where] if whole else [f"{where}.{one}" for one in _NAME.findall(listed)]
    return found


def code_maps(robot: Robot, code: Mapping[str, str]) -> list[Object]:
    """The ConfigMaps `rosops-code`, one per namespace that has pods with our code; `code` is file name -> content."""
    scopes = {app.scope for app in robot.apps if app.hooks != "none"}
    shared, objects = robot.master.mode == "shared", []
    if "robot" in scopes or (context.has_keeper_pod(robot) and not shared):
        objects.append(config_map(names.CODE_NAME, robot.namespace, owner_labels(robot.name), code))
    if "fleet" in scopes or shared:
        objects.append(config_map(names.CODE_NAME, names.FLEET_NAMESPACE, owner_labels(None), code))
    return objects
