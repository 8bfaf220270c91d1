# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""What a node lacks of the images that are to be there. Reads archives on the control node."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

from ...module_utils._common.documents import Arguments
from ...module_utils._common.errors import SpecError
from .._model.machines import architecture_of
from .archive import Image, archive_images, normal_ref
from .look import Present


@dataclass(frozen=True)
class ImagePlan:
    """Archives to bring, names to pull, and what must be there in the end, name to ID.

    A pulled image's ID is not known beforehand and is empty. `lacks` are the images for which an archive is brought.
    """

    bring: tuple[str, ...]
    pull: tuple[str, ...]
    wanted: Mapping[str, str]
    lacks: Mapping[str, tuple[Image, ...]] = field(default_factory=dict)

    @property
    def archived(self) -> list[str]:
        """Names that archives hold."""
        return sorted(ref for ref, digest in self.wanted.items() if digest)


def images_plan(archives: Iterable[Arguments], names: Iterable[str], present: Present) -> ImagePlan:
    """What a node lacks: a whole archive if one of its images is missing, and names that no archive holds.

    An archive is `{path, images}`, where `images` names those that count; none means all.
    """
    wanted: dict[str, str] = {}
    lacks: dict[str, tuple[Image, ...]] = {}
    for archive in archives:
        path = str(archive["path"])
        images = _chosen(archive, archive_images(path, present.machine))
        wrong = sorted({image.architecture for image in images} - {architecture_of(present.machine), ""})
        if wrong:
            raise SpecError(f"{path} holds images for {', '.join(wrong)}, but the host is {present.machine}")
        wanted.update({image.ref: image.id for image in images})
        missing = tuple(image for image in images if present.images.get(image.ref) != image.id)
        if missing:
            lacks[path] = missing
    refs = list(dict.fromkeys(normal_ref(name) for name in names))
    pull = [ref for ref in refs if ref not in present.images and ref not in wanted]
    return ImagePlan(tuple(lacks), tuple(pull), {**dict.fromkeys(refs, ""), **wanted}, lacks)


def _chosen(archive: Arguments, images: list[Image]) -> list[Image]:
    """All of the archive's images, or those that are named."""
    names = [normal_ref(ref) for ref in archive.get("images") or []]
    missing = sorted(set(names) - {image.ref for image in images})
    if missing:
        held = ", ".join(image.ref for image in images)
        raise SpecError(f"{archive['path']} does not hold {', '.join(missing)}, only {held}")
    return [image for image in images if image.ref in names] if names else images


def images_problems(wanted: Mapping[str, str], present: Mapping[str, str]) -> list[str]:
    """What is still wrong on the node once all was brought, a line each; both are name to ID."""
    return [
        f"{ref} is not there" if ref not in present else f"{ref} has the ID {present[ref]}, not {digest}"
        for ref, digest in sorted(wanted.items())
        if ref not in present or (digest and present[ref] != digest)
    ]
