# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""What images have, read from their archives on the control node: nothing is unpacked, and each is read once."""

from __future__ import annotations

import contextlib
import functools
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ansible_collections.rosops.fleet.plugins.module_utils._common.errors import SpecError
from ansible_collections.rosops.fleet.plugins.plugin_utils._images.archive import (
    LARGEST_COMPRESSED,
    Image,
    is_plain,
    normal_ref,
    opened,
    unusable,
)
from ansible_collections.rosops.fleet.plugins.plugin_utils._images.node import local_path
from ansible_collections.rosops.fleet.plugins.plugin_utils._images.tree import merged, python_version
from ansible_collections.rosops.fleet.plugins.plugin_utils._model.machines import MACHINES

# Where containerd looks for a program, unless the image says it (containerd, oci/spec.go).
PATH = "/usr/local/sbin:/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin"


_UNSEEN = (OSError, ValueError, RuntimeError)  # no file, no path, nobody's home


@dataclass(frozen=True)
class ArchivedImage:
    """An image of an archive, as `_model.contents.Contents`."""

    archive: str
    image: Image

    @property
    def entrypoint(self) -> tuple[str, ...]:
        return tuple(self.image.runs.get("Entrypoint") or ())

    @property
    def cmd(self) -> tuple[str, ...]:
        return tuple(self.image.runs.get("Cmd") or ())

    @functools.cached_property
    def python(self) -> str | None:
        with opened(self.archive) as archive:
            layers = archive.listings(self.image.layers)
        said = dict(item.partition("=")[::2] for item in self.image.runs.get("Env") or ())
        return None if layers is None else python_version(merged(layers), (said.get("PATH") or PATH).split(":"))


class Archives:
    """Archives of the control node.

    What cannot be read, or only in a long time, shows nothing: whoever is to bring it to a node says what is wrong.
    """

    def __init__(self) -> None:
        self._read = functools.cache(_read)

    def find(self, paths: Iterable[str], ref: str) -> ArchivedImage | None:
        """The image of this name in the archives at these paths; the last one has it, as on a node."""
        name, found = normal_ref(ref), [self._read(path) or {} for path in paths]
        return next((images[name] for images in reversed(found) if name in images), None)

    def ids(self, paths: Iterable[str], ref: str) -> frozenset[str]:
        """The IDs that the image of this name has in the last of these archives that holds it, one per architecture."""
        found = self.find(paths, ref)
        return frozenset() if found is None else _ids(found)

    def unusable(self, path: str) -> str:
        """Why no node can take the archive, as far as that is seen."""
        try:
            return unusable(local_path(path))
        except _UNSEEN:
            return ""

    def instead(self, archives: Sequence[Mapping[str, Any]], ref: str) -> list[str]:
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


def _ids(archived: ArchivedImage) -> frozenset[str]:
    found = set[str]()
    with opened(archived.archive) as archive:
        for machine in MACHINES.values():
            with contextlib.suppress(SpecError):  # an image for several of them need not be for all
                found |= {image.id for image in archive.images(machine.architecture) if image.ref == archived.image.ref}
    return frozenset(found)


def _read(path: str) -> Mapping[str, ArchivedImage] | None:
    """Its images by their full names; None where they are not seen."""
    try:
        place = local_path(path)
        with Path(place).open("rb") as file:
            if not is_plain(file) and Path(place).stat().st_size > LARGEST_COMPRESSED:
                return None
        with opened(place) as archive:
            return {image.ref: ArchivedImage(place, image) for image in archive.images()}
    except (SpecError, *_UNSEEN):
        return None
