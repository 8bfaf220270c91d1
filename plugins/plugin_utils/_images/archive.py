# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Which images an archive holds, under which names and IDs.

An image's ID is the digest of its configuration, in an archive as on a node, however it got there and however its
layers are compressed. So two IDs answer the question whether 400 MB must travel to a robot.
"""

from __future__ import annotations

import hashlib
import json
import tarfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ansible_collections.rosops.fleet.plugins.module_utils._common.errors import SpecError
from ansible_collections.rosops.fleet.plugins.plugin_utils._model.machines import architecture_of

REF_NAME = "org.opencontainers.image.ref.name"
CONTAINERD_NAME = "io.containerd.image.name"
LARGEST_JSON = 4 * 1024 * 1024


@dataclass(frozen=True)
class Image:
    """One name in an archive; `id` is `sha256:` and the digest of the image's configuration."""

    ref: str
    id: str
    architecture: str


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


def archive_images(path: str, machine: str = "x86_64") -> list[Image]:
    """The named images of a docker or OCI archive; of one for several architectures, that of `machine`."""
    try:
        with tarfile.open(path) as archive:
            return _Archive(archive, path).images(architecture_of(machine))
    except FileNotFoundError as error:
        raise SpecError(f"there is no image archive {path} on the control node") from error
    except (OSError, tarfile.TarError, EOFError) as error:
        raise SpecError(f"{path} is no tar archive, plain or compressed by gzip, bzip2 or xz: {error}") from error
    except (ValueError, KeyError, TypeError) as error:
        raise SpecError(f"{path} is no docker or OCI image archive ({type(error).__name__}: {error})") from error


class _Archive:
    """The small JSON files of one archive; layers are skipped, not read."""

    def __init__(self, archive: tarfile.TarFile, path: str) -> None:
        self.path = path
        self.archive = archive
        self.members = {str(Path(member.name)): member for member in archive.getmembers()}

    def images(self, architecture: str) -> list[Image]:
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
            self._image(ref, entry["Config"])
            for entry in json.loads(self._bytes("manifest.json"))
            for ref in entry.get("RepoTags") or []
        ]

    def _oci(self, architecture: str) -> list[Image]:
        found = []
        for entry in json.loads(self._bytes("index.json"))["manifests"]:
            notes = entry.get("annotations") or {}
            ref = notes.get(CONTAINERD_NAME) or notes.get(REF_NAME)
            if ref:
                manifest = self._manifest(entry["digest"], architecture)
                found.append(self._image(ref, _blob(manifest["config"]["digest"])))
        return found

    def _manifest(self, digest: str, architecture: str) -> dict[str, Any]:
        document: dict[str, Any] = json.loads(self._bytes(_blob(digest)))
        if "config" in document:
            return document
        offered = {entry["platform"]["architecture"]: entry["digest"] for entry in document["manifests"]}
        if architecture not in offered:
            raise SpecError(f"{self.path} has no image for {architecture}, only for {', '.join(sorted(offered))}")
        return self._manifest(offered[architecture], architecture)

    def _image(self, ref: str, config: str) -> Image:
        content = self._bytes(config)
        digest = hashlib.sha256(content).hexdigest()
        architecture = str(json.loads(content).get("architecture", ""))
        return Image(normal_ref(ref), f"sha256:{digest}", architecture)

    def _bytes(self, name: str) -> bytes:
        member = self.members[str(Path(name))]
        if member.size > LARGEST_JSON:
            raise SpecError(f"{self.path}: {name} has {member.size} bytes, too many for a manifest")
        file = self.archive.extractfile(member)
        if file is None:
            raise SpecError(f"{self.path}: {name} is no file")
        return file.read()


def _blob(digest: str) -> str:
    return f"blobs/{digest.replace(':', '/')}"
