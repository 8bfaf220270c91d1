# SPDX-License-Identifier: GPL-3.0-or-later
"""Which images an archive of the control node holds, under which names and IDs. Nothing is unpacked.

An image's ID is the digest of its configuration, in an archive as on a node, however it got there and however its
layers are compressed. So two IDs answer the question whether 400 MB must travel to a robot.

And an archive without the layers that a node has. What is to cross a radio link for a next version is a few megabytes.
containerd keeps layers by the digest of the file that it got, and takes an image from an OCI archive that lacks the
layers that are there. Where anything is in doubt there is no thin archive, and the whole one travels.
"""

from __future__ import annotations

import contextlib
import functools
import hashlib
import io
import json
import lzma
import posixpath
import tarfile
import zlib
from collections.abc import Collection, Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from itertools import groupby
from pathlib import Path
from typing import IO, Any

from ...module_utils._common.documents import Variables, json_of
from ...module_utils._common.errors import SpecError
from .._model.machines import architecture_of

REF_NAME = "org.opencontainers.image.ref.name"
CONTAINERD_NAME = "io.containerd.image.name"
TYPE = "application/vnd.oci.image"
Descriptor = dict[str, object]  # of OCI: what names a blob
LARGEST_JSON = 4 * 1024 * 1024
LARGEST_COMPRESSED = 100_000_000  # bytes of an archive that is unpacked only to be listed, which takes 1.5 s
# By their first bytes. containerd takes gzip and zstd (archive/compression), Python 3.11 reads no zstd.
_PACKINGS = {b"\x1f\x8b": "gzip", b"BZh": "bzip2", b"\xfd7zXZ": "xz", b"\x28\xb5\x2f\xfd": "zstd"}
_UNREADABLE = (OSError, tarfile.TarError, EOFError, zlib.error, lzma.LZMAError)
_UNSEEN = (OSError, ValueError, RuntimeError)  # no file, no path, nobody's home


@dataclass(frozen=True)
class Image:
    """One name in an archive; `id` is `sha256:` and the digest of the image's configuration.

    `config`, `manifest` (a docker archive has none) and `layers`, from the lowest up, are files of the archive.
    """

    ref: str
    id: str
    architecture: str
    layers: tuple[str, ...] = field(default=(), compare=False)
    config: str = field(default="", compare=False)
    manifest: str = field(default="", compare=False)


def normal_ref(ref: str) -> str:
    """The full name that containerd gives an image: `ros:noetic` is `docker.io/library/ros:noetic`."""
    name, at, digest = ref.partition("@")
    first, slash, rest = name.partition("/")
    if not slash:
        name = f"docker.io/library/{name}"
    elif not ("." in first or ":" in first or first == "localhost"):
        name = f"docker.io/{name}"
    elif first == "docker.io" and "/" not in rest:
        name = f"docker.io/library/{rest}"
    if not at and ":" not in name.rpartition("/")[2]:
        name = f"{name}:latest"
    return f"{name}{at}{digest}"


def local_path(path: Any) -> str:
    """A path on the control node, absolute."""
    return str(Path(str(path)).expanduser().absolute())


def archive_images(path: str, machine: str = "x86_64") -> list[Image]:
    """The named images of a docker or OCI archive; of one for several architectures, that of `machine`."""
    wanted, chosen = architecture_of(machine), list[Image]()
    with opened(path) as archive:
        images = archive.images()
    for _ref, group in groupby(images, lambda image: image.ref):
        offered = list(group)
        fitting = [image for image in offered if image.architecture == wanted][-1:] or offered
        if len(fitting) > 1:
            names = ", ".join(sorted(image.architecture for image in offered))
            raise SpecError(f"{path} has no image for {wanted}, only for {names}")
        chosen += fitting
    return chosen


def unusable(path: str) -> str:
    """Why no node can take the archive, by how it is compressed; nothing where it can, or where that is not seen."""
    try:
        with Path(local_path(path)).open("rb") as file:
            found = _packing(file)
    except _UNSEEN:
        return ""
    return f"{path} is compressed by {found}: unpack it, or compress it by gzip" if found not in ("", "gzip") else ""


def _packing(file: IO[bytes]) -> str:
    begin = file.read(6)
    return next((name for magic, name in _PACKINGS.items() if begin.startswith(magic)), "")


@contextlib.contextmanager
def opened(path: str) -> Iterator[Archive]:
    """The archive, for as long as it is read; SpecError for what is none."""
    try:
        if wrong := unusable(path):
            raise SpecError(wrong)
        with tarfile.open(path) as archive:
            yield Archive(archive, path)
    except FileNotFoundError as error:
        raise SpecError(f"there is no image archive {path} on the control node") from error
    except _UNREADABLE as error:
        raise SpecError(f"{path} is no tar archive, plain or compressed by gzip: {error}") from error
    except (ValueError, KeyError, TypeError, AttributeError) as error:
        raise SpecError(f"{path} is no docker or OCI image archive ({type(error).__name__}: {error})") from error


class Archive:
    """The small JSON files of one archive; layers are skipped."""

    def __init__(self, archive: tarfile.TarFile, path: str) -> None:
        self.path = path
        self.archive = archive
        self.members = {str(Path(member.name)): member for member in archive.getmembers()}

    def images(self) -> list[Image]:
        """Those with names, by these; of one for several architectures as many as are there."""
        if "manifest.json" in self.members:
            found = [
                self._image(ref, entry["Config"], entry.get("Layers") or [])
                for entry in json_of(self.read("manifest.json"))
                for ref in entry.get("RepoTags") or []
            ]
        elif "index.json" in self.members:
            found = [*self._oci(json_of(self.read("index.json")))]
        else:
            raise SpecError(f"{self.path} holds neither manifest.json nor index.json: it is no image archive")
        if not found:
            raise SpecError(f"{self.path} names no image: save it with its name and tag")
        return sorted(found, key=lambda image: image.ref)

    def _oci(self, index: Any, ref: str = "") -> Iterator[Image]:
        """Those that an index names, or one within it, all of whose images have its name."""
        for entry in index["manifests"]:
            notes, place = entry.get("annotations") or {}, _blob(entry["digest"])
            name = ref or notes.get(CONTAINERD_NAME) or notes.get(REF_NAME)
            # what is made for another architecture may have been left out, and how it was made is no image
            if not name or (ref and (place not in self.members or entry["platform"]["architecture"] == "unknown")):
                continue
            document = json_of(self.read(place))
            if "config" in document:
                layers = [_blob(layer["digest"]) for layer in document.get("layers") or []]
                yield self._image(name, _blob(document["config"]["digest"]), layers, place)
            else:
                yield from self._oci(document, name)

    def _image(self, ref: str, config: str, layers: Sequence[str], manifest: str = "") -> Image:
        content = self.read(config)
        digest, architecture = hashlib.sha256(content).hexdigest(), str(json_of(content).get("architecture", ""))
        return Image(normal_ref(ref), f"sha256:{digest}", architecture, tuple(layers), config, manifest)

    def manifest(self, image: Image, config: Descriptor) -> bytes:
        """The one that it has, or that containerd makes of a docker archive: a layer's digest is that of the file.

        A layer that is compressed, or not there, is left out: which digest it gets is not sure.
        """
        if image.manifest:
            return self.read(image.manifest)
        digests = (json_of(self.read(image.config)).get("rootfs") or {}).get("diff_ids") or ()
        layers = [
            {"mediaType": f"{TYPE}.layer.v1.tar", "digest": digest, "size": member.size}
            for digest, member in zip(digests, map(self.member, image.layers))
            if member and not _packing(self.content(member))
        ]
        document = {"schemaVersion": 2, "mediaType": f"{TYPE}.manifest.v1+json", "config": config, "layers": layers}
        return json.dumps(document).encode()

    def member(self, name: str) -> tarfile.TarInfo | None:
        """A file by its name, over the links by which archives share layers."""
        path = str(Path(name))
        found = self.members.get(path)
        if found is None or not (found.issym() or found.islnk()):
            return found
        above = posixpath.dirname(path) if found.issym() else ""
        target = self.members.get(posixpath.normpath(posixpath.join(above, found.linkname)))
        return target if target and target.isfile() else None

    def content(self, member: tarfile.TarInfo) -> IO[bytes]:
        """Of a file."""
        file = self.archive.extractfile(member)
        if file is None:
            raise SpecError(f"{self.path}: {member.name} is no file")
        return file

    def read(self, name: str) -> bytes:
        """A small file, whole."""
        member = self.members[str(Path(name))]
        if member.size > LARGEST_JSON:
            raise SpecError(f"{self.path}: {name} has {member.size} bytes, too many for a manifest")
        return self.content(member).read()


def _blob(digest: str) -> str:
    return f"blobs/{digest.replace(':', '/')}"


def archived_ids(paths: Sequence[str], ref: str) -> frozenset[str]:
    """The IDs that the image of this name has in the last of these archives that holds it, one per architecture."""
    name = normal_ref(ref)
    return next((held[name] for path in reversed(paths) if name in (held := _read(path) or {})), frozenset())


def archived_instead(archives: Sequence[Variables], ref: str) -> list[str]:
    """The images that archives (`{path, images}`) hold where none of them has this one.

    Nothing where one has it, or cannot be looked into: whoever is to bring that to a node says what is wrong.
    """
    held: set[str] = set()
    for archive in archives:
        images = _read(archive["path"])
        if images is None:
            return []
        held |= {*map(normal_ref, archive.get("images") or images)}
    return [] if normal_ref(ref) in held else sorted(held)


@functools.cache  # for a task, which has a process of its own
def _read(path: str) -> dict[str, frozenset[str]] | None:
    """The full names of its images, with their IDs, one per architecture; None where it takes too long, or fails."""
    try:
        place = Path(local_path(path))
        with place.open("rb") as file:
            if _packing(file) and place.stat().st_size > LARGEST_COMPRESSED:
                return None
        with opened(str(place)) as archive:
            groups = groupby(archive.images(), lambda image: image.ref)
            return {ref: frozenset(image.id for image in images) for ref, images in groups}
    except (SpecError, *_UNSEEN):
        return None


# --- without what a node has ------------------------------------------------------------------------------------------


def thin_archive(path: str, images: Iterable[Image], blobs: Collection[str], place: Path) -> frozenset[str] | None:
    """Write it; `blobs` are the digests that the node has. What it has to have afterwards, None for no thin archive."""
    made: dict[str, bytes] = {}  # by digest, as the layers
    layers: dict[str, tarfile.TarInfo] = {}
    index: list[Descriptor] = []

    def put(content: bytes, kind: str) -> Descriptor:
        digest = f"sha256:{hashlib.sha256(content).hexdigest()}"
        made[digest] = content
        return {"mediaType": kind, "digest": digest, "size": len(content)}

    with opened(path) as archive:
        for image in images:
            manifest = archive.manifest(image, put(archive.read(image.config), f"{TYPE}.config.v1+json"))
            document = json_of(manifest)
            members = [member for name in image.layers if (member := archive.member(name))]
            if not len(document["layers"]) == len(members) == len(image.layers):
                return None
            layers.update((str(layer["digest"]), member) for layer, member in zip(document["layers"], members))
            described = put(manifest, document.get("mediaType") or f"{TYPE}.manifest.v1+json")
            index.append({**described, "annotations": {CONTAINERD_NAME: image.ref}})
        # as they lie in the archive: going back in a compressed one means to unpack it anew
        lacking = sorted((one for one in layers.items() if one[0] not in blobs), key=lambda one: one[1].offset)
        size = sum(member.size for _digest, member in lacking)
        if len(lacking) == len(layers) or size >= Path(path).stat().st_size:
            return None
        files = {"oci-layout": json.dumps({"imageLayoutVersion": "1.0.0"}).encode()}
        files["index.json"] = json.dumps({"schemaVersion": 2, "manifests": index}).encode()
        files |= {_blob(digest): content for digest, content in made.items()}
        with tarfile.open(place, "w") as thin:
            for name, content in files.items():
                _add(thin, name, io.BytesIO(content), len(content))
            for digest, member in lacking:
                _add(thin, _blob(digest), archive.content(member), member.size)
    return frozenset([*made, *layers])


def _add(thin: tarfile.TarFile, name: str, content: IO[bytes], size: int) -> None:
    info = tarfile.TarInfo(name)
    info.size = size
    thin.addfile(info, content)
