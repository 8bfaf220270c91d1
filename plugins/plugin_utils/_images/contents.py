# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Which images the archives of the control node hold: nothing is unpacked, and each is read once."""

from __future__ import annotations

import contextlib
import functools
from collections.abc import Sequence
from pathlib import Path

from ...module_utils._common.documents import Variables
from ...module_utils._common.errors import SpecError
from .._model.machines import MACHINES
from .archive import is_plain, normal_ref, opened, unusable
from .node import local_path

LARGEST_COMPRESSED = 100_000_000  # bytes of an archive that is unpacked only to be listed, which takes 1.5 s
_UNSEEN = (OSError, ValueError, RuntimeError)  # no file, no path, nobody's home


class Archives:
    """Archives of the control node.

    What cannot be read, or only in a long time, shows nothing: whoever is to bring it to a node says what is wrong.
    """

    def __init__(self) -> None:
        self._read = functools.cache(_read)

    def ids(self, paths: Sequence[str], ref: str) -> frozenset[str]:
        """The IDs that the image of this name has in the last of these archives that holds it, one per architecture."""
        name = normal_ref(ref)
        return next((held[name] for path in reversed(paths) if name in (held := self._read(path) or {})), frozenset())

    def unusable(self, path: str) -> str:
        """Why no node can take the archive, as far as that is seen."""
        try:
            return unusable(local_path(path))
        except _UNSEEN:
            return ""

    def instead(self, archives: Sequence[Variables], ref: str) -> list[str]:
        """The images that archives (`{path, images}`) hold where none of them has this one.

        Nothing where one has it, or cannot be looked into.
        """
        held: set[str] = set()
        for archive in archives:
            images = self._read(archive["path"])
            if images is None:
                return []
            held |= {*map(normal_ref, archive.get("images") or images)}
        return [] if normal_ref(ref) in held else sorted(held)


def _read(path: str) -> dict[str, frozenset[str]] | None:
    """The full names of its images, with their IDs, one per architecture; None where they are not seen."""
    try:
        place = local_path(path)
        with Path(place).open("rb") as file:
            if not is_plain(file) and Path(place).stat().st_size > LARGEST_COMPRESSED:
                return None
        with opened(place) as archive:
            found = {image.ref: {image.id} for image in archive.images()}
            for machine in MACHINES.values():
                with contextlib.suppress(SpecError):  # an image for several of them need not be for all
                    for image in archive.images(machine.architecture):
                        found[image.ref].add(image.id)
        return {ref: frozenset(ids) for ref, ids in found.items()}
    except (SpecError, *_UNSEEN):
        return None
