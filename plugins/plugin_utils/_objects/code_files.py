# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Read the code that runs in pods: the entry, and every module that its commands reach by relative imports."""

from __future__ import annotations

import functools
import re
from pathlib import Path

from ...module_utils._common.errors import SpecError
from ...module_utils._pod import run

MODULE_UTILS = Path(run.__file__).resolve().parents[1]
ENTRY = "run.py"
EXPORTER = "exporter"
LAUNCHER = "_pod.launch"  # runs by itself, on the image's own interpreter
# Parsing all files costs every run a quarter of a second; our own code imports in no other form.
# A keeper of a collection before 1.0 loads it by this name when it first needs it, and it may run on with these files.
FORMER = {"_pod.latched_topics.py": "from .._robot.latched_topics import LatchedTopics as LatchedTopics\n"}
_IMPORT = re.compile(r"^[ \t]*from (\.+)([\w.]*) import (\([^)]*\)|[^\n]*)", re.MULTILINE)
_NAME = re.compile(r"(?:^|[(,])\s*(\w+)")


def app_files() -> dict[str, str]:
    """File name -> content of what app pods and the keeper run: `run.py`, and `<package>.<module>.py`."""
    commands = [module for command, module in run.COMMANDS.items() if command != EXPORTER]
    return {**_read((*commands, LAUNCHER)), **FORMER}


def exporter_files() -> dict[str, str]:
    """The same for the exporter's pod."""
    return dict(_read((run.COMMANDS[EXPORTER],)))


@functools.cache
def _read(modules: tuple[str, ...]) -> dict[str, str]:
    files = {ENTRY: _text("_pod.run")}
    todo = list(modules)
    while todo:
        module = todo.pop()
        if f"{module}.py" not in files:
            files[f"{module}.py"] = text = _text(module)
            todo += relative_imports(module, text)
    return files


def relative_imports(module: str, text: str) -> list[str]:
    """Modules (`<package>.<module>`) that a module imports anywhere in it, in functions, too."""
    package = module.split(".")[:-1]
    found: list[str] = []
    for dots, name, names in _IMPORT.findall(text):
        base = package[: len(package) - len(dots) + 1]
        where = ".".join([*base, *([name] if name else [])])
        whole = name and "." in where  # else it names a package, and modules of it
        found += [where] if whole else [f"{where}.{one}" for one in _NAME.findall(names)]
    return found


def _text(module: str) -> str:
    try:
        return (MODULE_UTILS / f"{module.replace('.', '/')}.py").read_text("utf-8")
    except OSError as error:
        raise SpecError(f"the collection is incomplete: {error}") from error
