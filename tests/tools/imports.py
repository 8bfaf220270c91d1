# SPDX-License-Identifier: GPL-3.0-or-later
"""What a Python file of this checkout imports, as paths in it; and one as a module."""

from __future__ import annotations

import ast
import importlib.util
import sys
from collections.abc import Iterator
from pathlib import Path, PurePosixPath
from typing import Any

COLLECTION = "ansible_collections.rosops.fleet."


def imported(file: PurePosixPath, text: str) -> Iterator[str]:
    """Dotted names that a file imports anywhere in it, in functions, too: `from a import b` is `a.b`.

    Relative ones, and those by the collection's full name, begin at the checkout: `plugins.module_utils._ros.gate`.
    """
    for item in ast.walk(ast.parse(text, str(file))):
        if isinstance(item, ast.Import):
            yield from (alias.name.removeprefix(COLLECTION) for alias in item.names)
        elif isinstance(item, ast.ImportFrom):
            package = file.parts[: -item.level] if item.level else ()
            start = ".".join([*package, *filter(None, [item.module])]).removeprefix(COLLECTION)
            yield from (f"{start}.{alias.name}" for alias in item.names)


def absolute(text: str) -> Iterator[str]:
    """Modules that are imported by absolute names, as they are written."""
    for item in ast.walk(ast.parse(text)):
        if isinstance(item, ast.Import):
            yield from (alias.name for alias in item.names)
        elif isinstance(item, ast.ImportFrom) and not item.level:
            yield item.module or ""


def loaded(path: Path, name: str = "") -> Any:
    """A Python file as a module, whatever package it is in; its annotations look their names up by its name."""
    spec = importlib.util.spec_from_file_location(name or path.stem, path)
    assert spec and spec.loader
    module = sys.modules[spec.name] = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def python_files(root: Path) -> Iterator[tuple[PurePosixPath, str]]:
    """Every Python file below a directory of the checkout: its path from `root`'s parent, and its text."""
    for path in sorted(root.rglob("*.py")):
        yield PurePosixPath(path.relative_to(root.parent).as_posix()), path.read_text("utf-8")
