# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Read the code that runs in pods: an entry, and every module that its commands reach by relative imports."""

from __future__ import annotations

import ast
import functools
from pathlib import Path
from typing import Iterable

from ansible_collections.rosops.fleet.plugins.module_utils import _exporter_entry, _hook_run
from ansible_collections.rosops.fleet.plugins.module_utils._errors import SpecError

MODULE_UTILS = Path(_hook_run.__file__).resolve().parent
ENTRY = "run.py"


def hook_files() -> dict[str, str]:
    """File name -> content of the package `hooks`."""
    return dict(_read("_hook_run", tuple(_hook_run.COMMANDS.values())))


def exporter_files() -> dict[str, str]:
    """File name -> content of the package `exporter`."""
    return dict(_read("_exporter_entry", tuple(_exporter_entry.COMMANDS.values())))


@functools.cache
def _read(entry: str, modules: Iterable[str]) -> dict[str, str]:
    files = {"__init__.py": "", ENTRY: _text(entry)}
    todo = list(modules)
    while todo:
        module = todo.pop()
        if f"{module}.py" not in files:
            files[f"{module}.py"] = text = _text(module)
            todo += relative_imports(text)
    return files


def relative_imports(text: str) -> list[str]:
    """Modules of the own package that a module imports anywhere in it, in functions, too."""
    found: list[str] = []
    for item in ast.walk(ast.parse(text)):
        if isinstance(item, ast.ImportFrom) and item.level == 1:
            found += [item.module] if item.module else [alias.name for alias in item.names]
    return found


def _text(module: str) -> str:
    try:
        return (MODULE_UTILS / f"{module}.py").read_text("utf-8")
    except OSError as error:
        raise SpecError(f"the collection is incomplete: {error}") from error
