# SPDX-License-Identifier: GPL-3.0-or-later
"""Files of the control node, reports and pages: where they lie, reading and writing them."""

from __future__ import annotations

import os
from pathlib import Path

from ansible import constants as C  # noqa: N812 - its customary name


def placed(path: str) -> Path | None:
    """A path as options of reports give it: relative to the ansible.cfg in use, or without one to the current
    directory. None for an empty one."""
    base = Path(C.CONFIG_FILE).parent if C.CONFIG_FILE else Path.cwd()
    return base / Path(path).expanduser() if path else None


def text_of(path: Path) -> str:
    """What a file holds; nothing where it cannot be read."""
    try:
        return path.read_bytes().decode("utf-8", "replace") if path.is_file() else ""
    except OSError:
        return ""


def write(path: Path, text: str, mode: int = 0o600) -> None:
    """In one step: a reader never sees half of it. What hosts said may hold more than everybody is to know."""
    if path.exists() and not path.is_file():  # /dev/null, which root could well exchange for a file
        path.write_bytes(text.encode())
        return
    path.parent.mkdir(mode=0o755, parents=True, exist_ok=True)
    unfinished = path.with_name(f".{path.name}.{os.getpid()}")
    try:
        unfinished.touch(mode=0o600)
        unfinished.write_bytes(text.encode())
        unfinished.chmod(mode)
        unfinished.replace(path)
    finally:
        unfinished.unlink(missing_ok=True)
