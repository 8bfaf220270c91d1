# SPDX-License-Identifier: GPL-3.0-or-later
"""The code that runs in pods, and the ConfigMaps that they mount it from.

The code is no part of a pod template: a newer collection restarts nothing.
"""

from __future__ import annotations

import functools
import json
import re
import zlib
from collections.abc import Mapping
from pathlib import Path

from ...module_utils._pod import run
from ...module_utils._step.objects import Object
from .._model import context, names
from .._model.context import Robot
from .common import Files, config_map, owner_labels
from .pod_code import IN_POD

MODULE_UTILS = Path(run.__file__).resolve().parents[1]
ENTRY = "run"
LAUNCHER = "_pod.launch"  # runs by itself, on the image's own interpreter
SMALLEST = 9  # of zlib's levels
# Parsing all files costs every run a quarter of a second; our own code imports in no other form,
_IMPORT = re.compile(r"^[ \t]*from (\.+)([\w.]*) import (\([^)]*\)|[^\n]*)", re.MULTILINE)
_NAME = re.compile(r"(?:^|[(,])\s*(\w+)")
# and has no other strings: a docstring by itself, a comment but for the licence, or a string that may look like these.
_TEXT = re.compile(
    r"""^([ \t]*)(\"{3}[\s\S]*?\"{3}) | [ \t]*(\#)(?!\ SPDX)[^\n]*
    | \"{3}[\s\S]*?\"{3} | '{3}[\s\S]*?'{3} | "(?:[^"\\\n]|\\.)*" | '(?:[^'\\\n]|\\.)*'""",
    re.MULTILINE | re.VERBOSE,
)


@functools.cache
def pod_files() -> Files:
    """File name -> content of what pods mount: what is started by its path as text, all other modules in one archive.

    Each byte is held in etcd for every robot, and in its pods. Another zlib may make other bytes of the same sources:
    then the ConfigMap changes, and nothing else.

    A process of a collection that had each module in a file of its own finds none of them any more: what it imports
    late fails. An `exec` that still waits ends with an error, and its container begins once more; a probe is asked
    again; a keeper sees that its code has changed, and begins anew.
    """
    sources = {module: bare(text) for module, text in _read().items()}
    plain: Files = {f"{module}.py": sources.pop(module) for module in (ENTRY, LAUNCHER)}
    return {**plain, run.ARCHIVE: packed(sources)}


def packed(sources: Mapping[str, str]) -> bytes:
    """Module -> source, as the file that `run.py` reads."""
    made = zlib.compressobj(SMALLEST, zlib.DEFLATED, run.GZIP)
    return made.compress(json.dumps(sources, sort_keys=True).encode()) + made.flush()


def bare(text: str) -> str:
    """A source without docstrings and comments, a third of what it packs to; each line keeps its number."""

    def kept(found: re.Match[str]) -> str:
        indent, docstring, comment = found.groups()
        return f'{indent}""' + "\n" * docstring.count("\n") if docstring else "" if comment else found[0]

    return _TEXT.sub(kept, text)


def _read() -> dict[str, str]:
    """The entry, and every module that it reaches, with its source."""
    found, todo = {ENTRY: Path(run.__file__).read_text("utf-8")}, [*run.COMMANDS.values(), LAUNCHER]
    while todo:
        module = todo.pop()
        if module not in found:
            found[module] = MODULE_UTILS.joinpath(*module.split(".")).with_suffix(".py").read_text("utf-8")
            todo += relative_imports(module, found[module])
    return found


def relative_imports(module: str, text: str) -> list[str]:
    """Modules (`<package>.<module>`) that a module imports anywhere in it, in functions, too."""
    package = module.split(".")[:-1]
    found: list[str] = []
    for dots, name, listed in _IMPORT.findall(text):
        where = ".".join([*package[: len(package) - len(dots) + 1], *([name] if name else [])])
        whole = name and "." in where  # else it names a package, and modules of it
        found += [where] if whole else [f"{where}.{one}" for one in _NAME.findall(listed)]
    return found


def code_maps(robot: Robot, code: Files) -> list[Object]:
    """The ConfigMaps `rosops-code`, one per namespace that has pods with our code; `code` is file name -> content."""
    scopes = {app.scope for app in robot.apps if app.hooks in IN_POD}
    shared, objects = robot.master.mode == "shared", []
    if "robot" in scopes or (context.has_keeper_pod(robot) and not shared):
        objects.append(config_map(names.CODE_NAME, robot.namespace, owner_labels(robot.name), code))
    if "fleet" in scopes or shared:
        objects.append(config_map(names.CODE_NAME, names.FLEET_NAMESPACE, owner_labels(None), code))
    return objects
