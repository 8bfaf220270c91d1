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
from pathlib import Path
from typing import Any

from ...module_utils._common.documents import Variables
from ...module_utils._common.errors import SpecError
from .._model.machines import MACHINES, architecture_of

REF_NAME = "org.opencontainers.image.ref.name"
CONTAINERD_NAME = "io.containerd.image.name"
TYPE = "application/vnd.oci.image"
BLOBS = "blobs/sha256/"
Descriptor = dict[str, object]  # of OCI: what names a blob
LARGEST_JSON = 4 * 1024 * 1024
LARGEST_COMPRESSED = 100_000_000  # bytes of an archive that is unpacked only to be listed, which takes 1.5 s
# By their first bytes. containerd takes gzip and zstd (archive/compression), Python 3.11 reads no zstd.
_COMPRESSED = {b"BZh": "bzip2", b"\xfd7zXZ": "xz", b"\x28\xb5\x2f\xfd": "zstd"}
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
    with opened(path) as archive:
        return archive.images(architecture_of(machine))


def unusable(path: str) -> str:
    """Why an archive cannot be brought to any node, by how it is compressed; nothing where it can."""
    with Path(path).open("rb") as file:
        begin = file.read(6)
    found = next((name for magic, name in _COMPRESSED.items() if begin.startswith(magic)), "")
    return f"{path} is compressed by {found}: unpack it, or compress it by gzip" if found else ""


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


def is_plain(file: io.BufferedReader) -> bool:
    """Whether a tar is not compressed: only such a one is listed without reading all of it."""
    return file.peek(512)[257:262] == b"ustar"


class Archive:
    """The small JSON files of one archive; layers are skipped."""

    def __init__(self, archive: tarfile.TarFile, path: str) -> None:
        self.path = path
        self.archive = archive
        self.members = {str(Path(member.name)): member for member in archive.getmembers()}

    def images(self, architecture: str = "") -> list[Image]:
        """Those with names; of one for several architectures, without `architecture` the first one that is offered."""
        if "manifest.json" in self.members:
            found = self._docker()
        elif "index.json" in self.members:
            found = self._oci(architecture)
        else:
            raise SpecError(f"{self.path} holds neither manifest.json nor index.json: it is no image archive")
        if not found:
            raise SpecError(f"{self.path} names no image: save it with its name and tag")
        return sorted(found, key=lambda image: image.ref)

    def _docker(self) -> list[Image]:
        return [
            self._image(ref, entry["Config"], entry.get("Layers") or [])
            for entry in json.loads(self.read("manifest.json"))
            for ref in entry.get("RepoTags") or []
        ]

    def _oci(self, architecture: str) -> list[Image]:
        found = []
        for entry in json.loads(self.read("index.json"))["manifests"]:
            notes = entry.get("annotations") or {}
            ref = notes.get(CONTAINERD_NAME) or notes.get(REF_NAME)
            if ref:
                place = self._manifest(entry["digest"], architecture)
                manifest = json.loads(self.read(place))
                layers = [_blob(layer["digest"]) for layer in manifest.get("layers") or []]
                found.append(self._image(ref, _blob(manifest["config"]["digest"]), layers, place))
        return found

    def _manifest(self, digest: str, architecture: str) -> str:
        document = json.loads(self.read(_blob(digest)))
        if "config" in document:
            return _blob(digest)
        offered = {entry["platform"]["architecture"]: entry["digest"] for entry in document["manifests"]}
        chosen = architecture or next(iter(offered), "any machine")
        if chosen not in offered:
            raise SpecError(f"{self.path} has no image for {chosen}, only for {', '.join(sorted(offered))}")
        return self._manifest(offered[chosen], architecture)

    def _image(self, ref: str, config: str, layers: Sequence[str], manifest: str = "") -> Image:
        content = self.read(config)
        digest, architecture = hashlib.sha256(content).hexdigest(), str(json.loads(content).get("architecture", ""))
        return Image(normal_ref(ref), f"sha256:{digest}", architecture, tuple(layers), config, manifest)

    def member(self, name: str) -> tarfile.TarInfo | None:
        """A file by its name, over the links by which archives share layers."""
        path = str(Path(name))
        found = self.members.get(path)
        if found is None or not (found.issym() or found.islnk()):
            return found
        above = posixpath.dirname(path) if found.issym() else ""
        target = self.members.get(posixpath.normpath(posixpath.join(above, found.linkname)))
        return target if target and target.isfile() else None

    def is_plain(self, member: tarfile.TarInfo) -> bool:
        """Whether it is a tar that is not compressed."""
        file = self.archive.extractfile(member)
        return isinstance(file, io.BufferedReader) and is_plain(file)

    def read(self, name: str) -> bytes:
        """A small file, whole."""
        member = self.members[str(Path(name))]
        if member.size > LARGEST_JSON:
            raise SpecError(f"{self.path}: {name} has {member.size} bytes, too many for a manifest")
        file = self.archive.extractfile(member)
        if file is None:
            raise SpecError(f"{self.path}: {name} is no file")
        return file.read()


def _blob(digest: str) -> str:
    return f"blobs/{digest.replace(':', '/')}"


class Archives:
    """Several archives, each of which is read once.

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


# --- without what a node has ------------------------------------------------------------------------------------------


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
