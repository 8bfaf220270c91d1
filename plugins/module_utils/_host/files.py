# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""A host's files. Every one is read below `root`, so that tests can hand in a recorded tree of another machine."""

from __future__ import annotations

import os
import re
from pathlib import Path

UNIT_DIRECTORY = "/etc/systemd/system"
UNIT_CGROUP = re.compile(r"/k3s(-agent)?\.service(/|$)", re.MULTILINE)


class Host:
    """Reads of one machine's files; a file that is missing or unreadable reads as empty."""

    def __init__(self, root: str = "/") -> None:
        self.root = Path(root)

    def path(self, name: str) -> Path:
        return self.root / name.lstrip("/")

    def read(self, name: str) -> str:
        try:
            return self.path(name).read_bytes().decode("utf-8", "replace").replace("\0", "")
        except OSError:
            return ""

    def exists(self, name: str) -> bool:
        try:
            return os.path.lexists(str(self.path(name)))
        except OSError:
            return False

    def names(self, name: str) -> list[str]:
        try:
            return sorted(entry.name for entry in self.path(name).iterdir())
        except OSError:
            return []
