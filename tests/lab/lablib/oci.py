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
from pathlib import Path
from typing import Any

from .artifacts import file_sha256
from .errors import LabError

ARCHITECTURES = {"x86_64": "amd64", "aarch64": "arm64", "armv7l": "arm"}
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
            entry = tarfile.TarInfo(name.lstrip("/"))
            entry.size = source.stat().st_size
            entry.mode = 0o755
            with source.open("rb") as handle:
                tar.addfile(entry, handle)
    return Layer.of(target)


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
            entry = tarfile.TarInfo(name)
            entry.size = source.stat().st_size
            with source.open("rb") as handle:
                tar.addfile(entry, handle)
        _add(tar, "manifest.json", _json(manifest))


def _add(tar: tarfile.TarFile, name: str, content: bytes) -> None:
    entry = tarfile.TarInfo(name)
    entry.size = len(content)
    tar.addfile(entry, io.BytesIO(content))
