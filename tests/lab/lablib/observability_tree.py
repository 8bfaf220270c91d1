# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""The files of an image made of single programs: what every image has beside them, and the layer."""

from __future__ import annotations

import os
import tarfile
from collections.abc import Iterable
from pathlib import Path

from .oci import Layer

ACCOUNTS = "root:x:0:0:root:/:/sbin/nologin\nnobody:x:65534:65534:nobody:/:/sbin/nologin\n"
GROUPS = "root:x:0:\nnobody:x:65534:\n"


def base_files(root: Path, directories: Iterable[str], user: int) -> None:
    """What a program expects of every system: accounts, a place for temporary files; and the directories of its own."""
    for name, content in (("etc/passwd", ACCOUNTS), ("etc/group", GROUPS)):
        (root / name).parent.mkdir(parents=True, exist_ok=True)
        (root / name).write_text(content)
    (root / "tmp").mkdir()
    (root / "tmp").chmod(0o1777)
    for name in directories:
        own = root / name.lstrip("/")
        own.mkdir(parents=True, exist_ok=True)
        os.chown(own, user, user)


def write_tree(target: Path, root: Path) -> Layer:
    """A layer of all files under a directory, byte for byte the same for the same files: without times and names."""
    with tarfile.open(target, "w", format=tarfile.USTAR_FORMAT) as tar:
        for path in sorted(root.rglob("*")):
            entry = tar.gettarinfo(path, arcname=str(path.relative_to(root)))
            entry.mtime, entry.uname, entry.gname = 0, "", ""
            if entry.isreg():
                with path.open("rb") as handle:
                    tar.addfile(entry, handle)
            else:
                tar.addfile(entry)
    return Layer.of(target)
