# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""A directory of collected files on the control node. A file is there wholly and as it was, or not at all.

What is not whole yet lies beside, so that the next run goes on with it.
"""

from __future__ import annotations

import contextlib
import hashlib
import os
import shutil
from collections.abc import Mapping
from pathlib import Path

from ansible_collections.rosops.fleet.plugins.module_utils._host.claims import CHUNK, unwire

SUMS = ".sha256"


class Store:
    """The files of one claim, by their paths as they go over the wire."""

    def __init__(self, dest: Path, target: str) -> None:
        self.folder = dest / target
        self.sums = dest / f"{target}{SUMS}"
        self._begun = dest / ".partial" / target

    def path(self, name: str) -> Path:
        """Where a file belongs."""
        return self.folder / os.fsdecode(unwire(name))

    def begun(self, name: str) -> Path:
        """Where it is as long as it is not whole."""
        return self._begun / hashlib.sha256(name.encode()).hexdigest()

    def same(self, name: str, state: Mapping[str, int]) -> bool:
        """Whether the file is there, by size and time, as rsync looks at it."""
        try:
            seen = self.path(name).lstat()
        except (FileNotFoundError, NotADirectoryError):
            return False
        return (seen.st_size, seen.st_mtime_ns) == (state["size"], state["mtime_ns"])

    def start(self, name: str, most: int) -> int:
        """How much of a file there may be already: what was begun, else what was collected before it grew."""
        begun, path = self.begun(name), self.path(name)
        begun.parent.mkdir(parents=True, exist_ok=True)
        if not begun.exists() and path.is_file():
            shutil.copyfile(path, begun)
        size = begun.stat().st_size if begun.exists() else 0
        return size if size <= most else 0

    def append(self, name: str, offset: int, data: bytes) -> None:
        """Write a piece; whatever was behind its beginning goes."""
        path = self.begun(name)
        path.touch()
        with path.open("r+b") as file:
            file.truncate(offset)
            file.seek(offset)
            file.write(data)

    def sum_of(self, path: Path, length: int) -> str:
        """The sum of so many bytes of a file of this side."""
        total = hashlib.sha256()
        with path.open("rb") as file:
            while length > 0 and (data := file.read(min(CHUNK, length))):
                total.update(data)
                length -= len(data)
        return total.hexdigest()

    def finish(self, name: str, mtime_ns: int) -> None:
        """The file is whole: it takes its place in one step, with the robot's time."""
        begun, path = self.begun(name), self.path(name)
        path.parent.mkdir(parents=True, exist_ok=True)
        with begun.open("rb") as file:
            os.fsync(file.fileno())
        os.utime(begun, ns=(mtime_ns, mtime_ns))
        begun.replace(path)

    def drop(self, name: str) -> None:
        """Forget what was begun."""
        self.begun(name).unlink(missing_ok=True)

    def tidy(self) -> None:
        """Leave no empty directory of what was begun."""
        for folder in (self._begun, *self._begun.parents[:2]):
            with contextlib.suppress(OSError):
                folder.rmdir()

    def write_sums(self, known: Mapping[str, str]) -> None:
        """The sums of all files that are here, as `sha256sum --check` reads them from within the directory."""
        before = self._known_sums()
        lines = {}
        for full in self.folder.rglob("*"):
            if full.is_file():
                name = str(full.relative_to(self.folder))
                path = os.fsencode(name)
                found = known.get(name) or before.get(path) or self.sum_of(full, full.stat().st_size)
                lines[path] = _line(path, found)
        self.sums.parent.mkdir(parents=True, exist_ok=True)
        unfinished = self.sums.with_name(f".{self.sums.name}.{os.getpid()}")
        unfinished.write_bytes(b"".join(lines[path] for path in sorted(lines)))
        unfinished.replace(self.sums)

    def _known_sums(self) -> dict[bytes, str]:
        if not self.sums.exists():
            return {}
        lines = self.sums.read_bytes().splitlines()
        return {line[66:]: line[:64].decode("ascii") for line in lines if line[:1] != b"\\"}


def _line(path: bytes, found: str) -> bytes:
    """GNU's form: a name with a backslash or a line's end in it is escaped, and the line begins with a backslash."""
    escaped = path.replace(b"\\", b"\\\\").replace(b"\n", b"\\n").replace(b"\r", b"\\r")
    return (b"\\" if escaped != path else b"") + found.encode() + b"  " + escaped + b"\n"
