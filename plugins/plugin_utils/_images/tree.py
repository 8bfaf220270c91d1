# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""The files of an image out of the listings of its layers, and which Python is found among them. Pure."""

from __future__ import annotations

import re
import tarfile
from collections.abc import Iterable, Iterator, Mapping, Sequence

# A path from the image's root, without a slash before it, and what is there: None for a directory, the target of a
# link, and the empty text for anything else.
Entry = tuple[str, str | None]
Listing = Sequence[Entry]
Tree = Mapping[str, str | None]

WHITEOUT, OPAQUE = ".wh.", ".wh..wh..opq"  # image-spec, layer.md: what is gone, and a directory without what was in it
LINKS = 40  # as Linux follows them (path_resolution(7))


def listed(member: tarfile.TarInfo) -> Entry:
    """An entry of a layer's tar. A hard link is one by its whole path."""
    path = member.name.removeprefix("./").strip("/")
    if member.isdir():
        return path, None
    return path, member.linkname if member.issym() else f"/{member.linkname}" if member.islnk() else ""


def merged(layers: Iterable[Listing]) -> Tree:
    """What a container sees of the layers, which are given from the lowest up."""
    tree: dict[str, str | None] = {}
    for layer in layers:
        gone, emptied = set[str](), set[str]()
        for path, _target in layer:
            place, _slash, name = path.rpartition("/")
            if name == OPAQUE:
                emptied.add(place)
            elif name.startswith(WHITEOUT):
                gone.add(f"{place}/{name.removeprefix(WHITEOUT)}".lstrip("/"))
        if gone or emptied:
            tree = {
                path: target
                for path, target in tree.items()
                if path not in gone and not any(above in gone or above in emptied for above in _above(path))
            }
        tree.update((path, target) for path, target in layer if not path.rpartition("/")[2].startswith(WHITEOUT))
    return tree


def _above(path: str) -> Iterator[str]:
    """The directories that it is in, the root as the empty text."""
    while path:
        path = path.rpartition("/")[0]
        yield path


def python_version(tree: Tree, directories: Iterable[str]) -> str | None:
    """`3.8`: the version of the `python3` that is found first in these directories; empty where there is none.

    It is read from the name that the links lead to, as distributions make them (`python3.8`). None: some other name.
    """
    for directory in directories:
        found = _file(tree, f"{directory}/python3")
        if found:
            said = re.fullmatch(r"python(3\.[0-9]+)m?", found.rpartition("/")[2])
            return said[1] if said else None
    return ""


def _file(tree: Tree, path: str) -> str:
    """The path of the file that a path leads to, over links; empty where it leads to none."""
    todo, place, links = path.split("/"), "", 0
    while todo:
        part = todo.pop(0)
        if part in ("", "."):
            continue
        if part == "..":
            place = place.rpartition("/")[0]
            continue
        here = f"{place}/{part}".lstrip("/")
        target = tree.get(here)
        if not target:
            place = here
            continue
        links += 1
        if links > LINKS:
            return ""
        place, todo = "" if target.startswith("/") else place, [*target.split("/"), *todo]
    return place if tree.get(place) == "" else ""
