# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Files of persistent claims on their host: what there is, pieces of it, checksums. What apps write is not trusted.

The storage class local-path keeps a claim in a directory <volume of Kubernetes>_<namespace>_<claim>. An app may put
anything into it at any time, while this reads as root: so no link is followed, in no part of a path, and nothing but
plain files is opened.
"""

from __future__ import annotations

import base64
import fnmatch
import hashlib
import os
import re
import stat
import zlib
from contextlib import closing, contextmanager
from pathlib import Path
from typing import Any, BinaryIO, Iterator, NamedTuple
from urllib.parse import quote_from_bytes, unquote_to_bytes

from .._common.errors import FleetError

CHUNK = 1 << 20
_BELOW = os.O_RDONLY | os.O_NOFOLLOW | os.O_CLOEXEC | os.O_NONBLOCK  # a pipe in a file's place makes nobody wait

_LABEL = "[a-z0-9](?:[-a-z0-9]{0,61}[a-z0-9])?"  # RFC 1123, as Kubernetes names namespaces
_CLAIM = re.compile(rf"pvc-{_LABEL}_(?P<namespace>{_LABEL})_(?P<claim>{_LABEL})")


class Claim(NamedTuple):
    """A claim's directory: its name, and whose claim it is."""

    directory: str
    namespace: str
    claim: str


def claims(storage: str) -> list[Claim]:
    """The claims below the storage's directory; none where there is no such directory."""
    try:
        names = sorted(path.name for path in Path(storage).iterdir())
    except FileNotFoundError:
        return []
    found = [claim for claim in map(claim_of, names) if claim]
    return [claim for claim in found if stat.S_ISDIR((Path(storage) / claim.directory).lstat().st_mode)]


def claim_of(directory: str) -> Claim | None:
    """Whose claim a directory of that name is; None where it is no claim's."""
    found = _CLAIM.fullmatch(directory)
    return Claim(directory, found["namespace"], found["claim"]) if found else None


def wire(path: bytes) -> str:
    """A path, whatever bytes it has, as a text that JSON carries."""
    return quote_from_bytes(path, safe="/ ")


def unwire(text: str) -> bytes:
    """The path again. FleetError for one that leads out of its directory: the other side is not trusted either."""
    path = unquote_to_bytes(text)
    parts = path.split(b"/")
    if not path or b"\0" in path or any(part in (b"", b".", b"..") for part in parts):
        raise FleetError(f"{text!r} is no path below a claim")
    return path


class Found(NamedTuple):
    """What a claim holds: its files by path, and the paths of what is no plain file."""

    files: dict[str, dict[str, int]]
    passed: list[str]


def listing(root: str, match: list[str]) -> Found:
    """All plain files below a directory whose path from there matches one of the patterns; `*` matches slashes, too."""
    files: dict[str, dict[str, int]] = {}
    passed: list[str] = []

    def failed(error: OSError) -> None:
        if not isinstance(error, FileNotFoundError):  # it went meanwhile
            raise error

    for place, directories, names in os.walk(root, onerror=failed):
        for name in sorted([*names, *directories]):
            full = Path(place) / name
            path = str(full.relative_to(root))
            try:
                seen = full.lstat()
            except FileNotFoundError:
                continue
            if stat.S_ISDIR(seen.st_mode) or not any(fnmatch.fnmatchcase(path, pattern) for pattern in match):
                continue
            if stat.S_ISREG(seen.st_mode):
                files[wire(os.fsencode(path))] = state(seen)
            else:
                passed.append(wire(os.fsencode(path)))
    return Found(files, passed)


def state(seen: os.stat_result) -> dict[str, int]:
    """What tells one content of a file from another without reading it."""
    return {"size": seen.st_size, "mtime_ns": seen.st_mtime_ns, "inode": seen.st_ino}


@contextmanager
def opened(root: str, path: bytes) -> Iterator[BinaryIO]:
    """The plain file at a path below the directory, reached through directories alone."""
    at = os.open(root, _BELOW | os.O_DIRECTORY)
    try:
        *parents, name = path.split(b"/")
        for parent in parents:
            below = os.open(parent, _BELOW | os.O_DIRECTORY, dir_fd=at)
            os.close(at)
            at = below
        with closing(os.fdopen(os.open(name, _BELOW, dir_fd=at), "rb")) as file:
            if not stat.S_ISREG(os.fstat(file.fileno()).st_mode):
                raise FileNotFoundError("no plain file")
            yield file
    finally:
        os.close(at)


def piece(root: str, wanted: dict[str, Any]) -> dict[str, Any]:
    """One piece of a file: `length` bytes from `offset` on, compressed. What is gone by now is `gone`.

    With `check` also the sum of the first `check` bytes of the whole file, and its state: asked with its last piece.
    """
    try:
        with opened(root, unwire(wanted["path"])) as file:
            file.seek(wanted["offset"])
            data = file.read(wanted["length"])
            found = {"data": base64.b64encode(zlib.compress(data, 1)).decode("ascii")}
            if wanted["check"] is None:
                return found
            return {**found, "sha256": sha256(file, wanted["check"]), **state(os.fstat(file.fileno()))}
    except OSError as error:
        return {"gone": error.strerror or str(error)}


def sha256(file: BinaryIO, length: int) -> str | None:
    """The sum of so many bytes from the beginning; None where there are not so many."""
    file.seek(0)
    total = hashlib.sha256()
    while length:
        data = file.read(min(CHUNK, length))
        if not data:
            return None
        total.update(data)
        length -= len(data)
    return total.hexdigest()


def pieces(root: str, wanted: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Several pieces, in the order in which they are asked for."""
    return [piece(root, one) for one in wanted]


def opened_data(found: dict[str, Any], length: int) -> bytes:
    """The bytes of a piece; never more than were asked for, however little they were compressed into."""
    return zlib.decompressobj().decompress(base64.b64decode(found["data"]), length) if length else b""
