# SPDX-License-Identifier: GPL-3.0-or-later
"""Container images written by hand: archives of the docker format, byte for byte the same for the same content.

A builder would do, but it would need a registry or a base image; a lab image is a Debian tree or one static binary.
"""

from __future__ import annotations

import hashlib
import io
import json
import platform
import tarfile
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from fnmatch import fnmatchcase
from pathlib import Path, PurePosixPath
from typing import Any

from .artifacts import file_sha256
from .errors import LabError

ARCHITECTURES = {"x86_64": "amd64", "aarch64": "arm64", "armv7l": "arm"}
_MANIFEST = "application/vnd.oci.image.manifest.v1+json"
CREATED = "2026-01-01T00:00:00Z"


def architecture() -> str:
    machine = platform.machine()
    if machine not in ARCHITECTURES:
        raise LabError(
            f"no k3s for the machine architecture {machine}", todo=f"use one of {', '.join(sorted(ARCHITECTURES))}"
        )
    return ARCHITECTURES[machine]


@dataclass(frozen=True)
class Layer:
    """An uncompressed tar; its digest is both its file name and its identity."""

    tar: Path
    digest: str

    @classmethod
    def of(cls, tar: Path) -> Layer:
        return cls(tar, file_sha256(tar))


@dataclass(frozen=True)
class Image:
    """A tag, the layers from the lowest up, and the `config` part of an image configuration."""

    tag: str
    layers: Sequence[Layer]
    config: dict[str, Any] = field(default_factory=dict)

    def configuration(self) -> bytes:
        return _json(
            {
                "architecture": architecture(),
                "os": "linux",
                "created": CREATED,
                "config": self.config,
                "rootfs": {"type": "layers", "diff_ids": [f"sha256:{layer.digest}" for layer in self.layers]},
                "history": [{"created": CREATED, "created_by": "rosops.fleet lab"} for _layer in self.layers],
            }
        )


def _json(value: object) -> bytes:
    return json.dumps(value, sort_keys=True, separators=(",", ":")).encode()


def _digest(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()


def write_layer(target: Path, files: Iterable[tuple[str, Path]]) -> Layer:
    """A layer of executables: (path in the image, file)."""
    with tarfile.open(target, "w", format=tarfile.USTAR_FORMAT) as tar:
        for name, source in files:
            _add_file(tar, name.lstrip("/"), source, 0o755)
    return Layer.of(target)


def write_removal(target: Path, below: Path, pattern: str) -> Layer:
    """A layer without what the tree `below` it has under names like that (OCI image specification, Whiteouts)."""
    with tarfile.open(below) as tar:
        gone = [PurePosixPath(_name(entry)) for entry in tar if fnmatchcase(_name(entry), pattern)]
    if not gone:
        raise LabError(f"there is no {pattern} to take away", where=str(below))
    with tarfile.open(target, "w", format=tarfile.USTAR_FORMAT) as layer:
        for name in sorted(gone):
            _add(layer, str(name.with_name(f".wh.{name.name}")), b"")
    return Layer.of(target)


def write_difference(target: Path, below: Path, grown: Path, leave_out: Sequence[str] = ()) -> None:
    """A layer's tar: what the tree `grown` has that the tree `below` it has not, or has otherwise.

    A directory that only got another time stamp is no change. Packages that are added take nothing away; where
    something is gone nevertheless, the layer would be wrong, so it is not made.
    """
    with tarfile.open(below) as tar:
        known = {_name(entry): _about(entry) for entry in tar}
    with tarfile.open(grown) as tar, tarfile.open(target, "w", format=tarfile.PAX_FORMAT) as layer:
        for entry in tar:
            same = known.pop(_name(entry), None) == _about(entry)
            if not same and not _within(_name(entry), leave_out):
                layer.addfile(entry, tar.extractfile(entry) if entry.isreg() else None)
    if gone := [name for name in known if not _within(name, leave_out)]:
        raise LabError(f"a layer cannot take away {', '.join(sorted(gone)[:5])}", where=str(grown))


def _name(entry: tarfile.TarInfo) -> str:
    return entry.name.removeprefix("./").rstrip("/")


def _within(name: str, places: Sequence[str]) -> bool:
    return any(f"{name}/".startswith(f"{place}/") for place in places)


def _about(entry: tarfile.TarInfo) -> tuple[object, ...]:
    when = 0 if entry.isdir() else entry.mtime
    return entry.type, entry.mode, entry.uid, entry.gid, entry.size, when, entry.linkname


def write_archive(target: Path, images: Sequence[Image]) -> None:
    """All images in one docker archive; a layer that several have stands in it once."""
    with tarfile.open(target, "w", format=tarfile.GNU_FORMAT) as tar:
        manifest: list[dict[str, object]] = []
        layers: dict[str, Path] = {}
        for image in images:
            configuration = image.configuration()
            name = f"{_digest(configuration)}.json"
            _add(tar, name, configuration)
            manifest.append(
                {
                    "Config": name,
                    "RepoTags": [image.tag],
                    "Layers": [f"{layer.digest}.tar" for layer in image.layers],
                }
            )
            layers.update({f"{layer.digest}.tar": layer.tar for layer in image.layers})
        for name, source in layers.items():
            _add_file(tar, name, source)
        _add(tar, "manifest.json", _json(manifest))


def _add(tar: tarfile.TarFile, name: str, content: bytes) -> None:
    entry = tarfile.TarInfo(name)
    entry.size = len(content)
    tar.addfile(entry, io.BytesIO(content))


def _add_file(tar: tarfile.TarFile, name: str, source: Path, mode: int = 0o644) -> None:
    entry = tarfile.TarInfo(name)
    entry.size = source.stat().st_size
    entry.mode = mode
    with source.open("rb") as handle:
        tar.addfile(entry, handle)


def write_update(target: Path, image: Image, present: Sequence[Layer]) -> None:
    """An OCI archive of an image without the layers that its nodes have already: an update of some kilobytes.

    containerd keeps layers by digest and imports an archive that leaves known ones out. `manifest.json`, the docker
    format's index, stands in it too, for tools that read that one.
    """
    known = {layer.digest for layer in present}
    configuration = image.configuration()
    layers = [
        {
            "mediaType": "application/vnd.oci.image.layer.v1.tar",
            "digest": f"sha256:{layer.digest}",
            "size": layer.tar.stat().st_size,
        }
        for layer in image.layers
    ]
    manifest = _json(
        {
            "schemaVersion": 2,
            "mediaType": _MANIFEST,
            "config": {
                "mediaType": "application/vnd.oci.image.config.v1+json",
                "digest": f"sha256:{_digest(configuration)}",
                "size": len(configuration),
            },
            "layers": layers,
        }
    )
    entry = {
        "mediaType": _MANIFEST,
        "digest": f"sha256:{_digest(manifest)}",
        "size": len(manifest),
        "annotations": {
            "io.containerd.image.name": image.tag,
            "org.opencontainers.image.ref.name": image.tag.rpartition(":")[2],
        },
        "platform": {"architecture": architecture(), "os": "linux"},
    }
    docker = {
        "Config": f"blobs/sha256/{_digest(configuration)}",
        "RepoTags": [image.tag],
        "Layers": [f"blobs/sha256/{layer.digest}" for layer in image.layers],
    }
    with tarfile.open(target, "w", format=tarfile.GNU_FORMAT) as tar:
        _add(tar, "oci-layout", _json({"imageLayoutVersion": "1.0.0"}))
        _add(tar, "index.json", _json({"schemaVersion": 2, "manifests": [entry]}))
        _add(tar, "manifest.json", _json([docker]))
        for content in (configuration, manifest):
            _add(tar, f"blobs/sha256/{_digest(content)}", content)
        for layer in image.layers:
            if layer.digest not in known:
                _add_file(tar, f"blobs/sha256/{layer.digest}", layer.tar)
