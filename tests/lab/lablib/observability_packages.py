# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Programs out of Debian's packages, with what they need beside them."""

from __future__ import annotations

import posixpath
import shutil
import tarfile
from collections.abc import Mapping, Sequence
from fnmatch import fnmatchcase
from pathlib import Path

from .errors import LabError

_LINKS = 8


def pick(tree: Path, root: Path, programs: Mapping[str, str], files: Sequence[str]) -> None:
    """Out of a tar: each program (place = path in the tar), and the files, by pattern, to their own places."""
    with tarfile.open(tree) as tar:
        entries = {posixpath.normpath(entry.name): entry for entry in tar}
        wanted = dict(programs)
        for pattern in files:
            found = [name for name, entry in entries.items() if fnmatchcase(name, pattern) and not entry.isdir()]
            if not found:
                raise LabError(f"no file {pattern} in the packages", where=str(tree), todo="see what has it now")
            wanted.update({f"/{name}": name for name in found})
        for place, source in wanted.items():
            target = root / place.lstrip("/")
            target.parent.mkdir(parents=True, exist_ok=True)
            content = tar.extractfile(_file(entries, source, tree))
            assert content is not None
            with target.open("wb") as sink:
                shutil.copyfileobj(content, sink)
            target.chmod(0o755)


def _file(entries: Mapping[str, tarfile.TarInfo], name: str, tree: Path) -> tarfile.TarInfo:
    """The file that a name leads to, by way of links."""
    for _link in range(_LINKS):
        entry = entries.get(name)
        if entry is None:
            raise LabError(f"no file {name} in the packages", where=str(tree), todo="see where it is now")
        if entry.isreg():
            return entry
        name = posixpath.normpath(posixpath.join("/", posixpath.dirname(name), entry.linkname)).lstrip("/")
    raise LabError(f"{name} leads to no file", where=str(tree))
