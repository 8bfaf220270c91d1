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
ROOMS = ("_common", "_ros", "_step", "_pod", "_exporter", "_robot")  # of module_utils, what has to run in pods
ENTRY, LAUNCHER = "_pod.run", "_pod.launch"  # the latter runs by itself, on the image's own interpreter
SMALLEST = 9  # of zlib's levels
# Parsing all files costs every run a quarter of a second. Our own code has no other strings than these: a docstring by
# itself, a comment but for the licence, or a string that may look like these.
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
    paths = (path for room in ROOMS for path in MODULE_UTILS.joinpath(room).glob("*.py"))
    sources = {f"{path.parent.name}.{path.stem}": bare(path.read_text("utf-8")) for path in paths}
    plain: Files = {"run.py": sources.pop(ENTRY), f"{LAUNCHER}.py": sources.pop(LAUNCHER)}
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


def code_maps(robot: Robot, code: Files) -> list[Object]:
    """The ConfigMaps `rosops-code`, one per namespace that has pods with our code; `code` is file name -> content."""
    scopes = {app.scope for app in robot.apps if app.hooks in IN_POD}
    shared, objects = robot.master.mode == "shared", []
    if "robot" in scopes or (context.has_keeper_pod(robot) and not shared):
        objects.append(config_map(names.CODE_NAME, robot.namespace, owner_labels(robot.name), code))
    if "fleet" in scopes or shared:
        objects.append(config_map(names.CODE_NAME, names.FLEET_NAMESPACE, owner_labels(None), code))
    return objects
