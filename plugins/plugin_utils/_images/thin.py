# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""An archive without the layers that a node has. What is to cross a radio link for a next version is a few megabytes.

containerd keeps layers by the digest of the file that it got, and takes an image from an OCI archive that lacks the
layers that are there. Where anything is in doubt there is no thin archive, and the whole one travels.
"""

from __future__ import annotations

import hashlib
import io
import json
import tarfile
from collections.abc import Collection, Iterable
from dataclasses import dataclass, field
from pathlib import Path

from .archive import CONTAINERD_NAME, Archive, Image, opened

TYPE = "application/vnd.oci.image"
BLOBS = "blobs/sha256/"
Descriptor = dict[str, object]  # of OCI: what names a blob


@dataclass
class _Parts:
    """What makes images whole: content at hand and members of the archive, by digest, and the index that names it."""

    made: dict[str, bytes] = field(default_factory=dict)
    members: dict[str, tarfile.TarInfo] = field(default_factory=dict)
    index: list[Descriptor] = field(default_factory=list)

    def put(self, content: bytes) -> Descriptor:
        """Its descriptor."""
        digest = f"sha256:{hashlib.sha256(content).hexdigest()}"
        self.made[digest] = content
        return {"digest": digest, "size": len(content)}


def thin_archive(path: str, images: Iterable[Image], blobs: Collection[str], place: Path) -> frozenset[str] | None:
    """Write it; `blobs` are the digests that the node has. What it has to have afterwards, None for no thin archive."""
    with opened(path) as archive:
        parts = _Parts()
        if not all(_add(parts, archive, image) for image in images):
            return None
        lacking = {digest: member for digest, member in parts.members.items() if digest not in blobs}
        size = sum(member.size for member in lacking.values())
        if len(lacking) == len(parts.members) or size >= Path(path).stat().st_size:
            return None
        with tarfile.open(place, "w") as thin:
            _put(thin, "oci-layout", json.dumps({"imageLayoutVersion": "1.0.0"}).encode())
            _put(thin, "index.json", json.dumps({"schemaVersion": 2, "manifests": parts.index}).encode())
            for digest, content in parts.made.items():
                _put(thin, _name(digest), content)
            # as they lie in the archive: going back in a compressed one means to unpack it anew
            for digest, member in sorted(lacking.items(), key=lambda item: item[1].offset):
                info = tarfile.TarInfo(_name(digest))
                info.size = member.size
                thin.addfile(info, archive.archive.extractfile(member))
        return frozenset([*parts.made, *parts.members])


def _add(parts: _Parts, archive: Archive, image: Image) -> bool:
    """Whether all that the image is made of is known."""
    config = archive.read(image.config)
    members = [archive.member(name) for name in image.layers]
    if image.manifest:
        manifest = archive.read(image.manifest)
        digests = [str(layer["digest"]) for layer in json.loads(manifest)["layers"]]
        parts.put(config)
    else:  # of a docker archive containerd makes the manifest itself; a layer's digest is that of the file
        digests = [str(digest) for digest in (json.loads(config).get("rootfs") or {}).get("diff_ids") or ()]
        layers = [
            {"mediaType": f"{TYPE}.layer.v1.tar", "digest": digest, "size": member.size}
            for digest, member in zip(digests, members)
            if member is not None and archive.is_plain(member)
        ]
        if len(layers) < max(len(digests), len(members)):
            return False
        described = {"mediaType": f"{TYPE}.config.v1+json", **parts.put(config)}
        document = {"schemaVersion": 2, "mediaType": f"{TYPE}.manifest.v1+json", "config": described, "layers": layers}
        manifest = json.dumps(document).encode()
    kind = json.loads(manifest).get("mediaType") or f"{TYPE}.manifest.v1+json"
    parts.index.append({"mediaType": kind, **parts.put(manifest), "annotations": {CONTAINERD_NAME: image.ref}})
    parts.members.update((digest, member) for digest, member in zip(digests, members) if member is not None)
    return len(digests) == len(members) and None not in members


def _put(thin: tarfile.TarFile, name: str, content: bytes) -> None:
    info = tarfile.TarInfo(name)
    info.size = len(content)
    thin.addfile(info, io.BytesIO(content))


def _name(digest: str) -> str:
    return BLOBS + digest.partition(":")[2]
