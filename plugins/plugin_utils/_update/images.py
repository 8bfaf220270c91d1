# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Which images an archive holds, and which of them a node lacks.

An image's ID is the digest of its configuration, in an archive as on a node, however it got there and however its
layers are compressed. So two IDs answer the question whether 400 MB must travel to a robot. Runs on the control node.
"""

from __future__ import annotations

import hashlib
import json
import re
import tarfile
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, TypedDict

from ansible_collections.rosops.fleet.plugins.module_utils._common.errors import SpecError

REF_NAME = "org.opencontainers.image.ref.name"
CONTAINERD_NAME = "io.containerd.image.name"
MACHINES = {"x86_64": "amd64", "aarch64": "arm64", "armv7l": "arm"}
LARGEST_JSON = 4 * 1024 * 1024


class Image(TypedDict):
    """One name in an archive."""

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
            return _Archive(archive, path).images(MACHINES.get(machine, machine))
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
        return sorted(found, key=lambda image: image["ref"])

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
        return {"ref": normal_ref(ref), "id": f"sha256:{digest}", "architecture": architecture}

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


def node_images(listing: str | Mapping[str, Any]) -> dict[str, str]:
    """Name -> ID of a node's images, out of what `crictl images -o json` prints. Names by digest are in it, too."""
    try:
        document = json.loads(listing or "{}") if isinstance(listing, str) else listing
    except ValueError as error:
        raise SpecError(f"crictl's list of images is no JSON: {error}") from error
    return {
        normal_ref(ref): image["id"] if re.match(r"^\w+:", image["id"]) else f"sha256:{image['id']}"
        for image in document.get("images") or []
        for ref in [*(image.get("repoTags") or []), *(image.get("repoDigests") or [])]
    }


def images_plan(
    archives: Iterable[Mapping[str, Any]], refs: Iterable[str], listing: str, machine: str = "x86_64"
) -> dict[str, Any]:
    """What a node lacks: archives to bring (a whole archive if one of its images is missing) and names to pull.

    A name that one of the archives holds is never pulled.

    `wanted` is what must be there in the end, name -> ID; a pulled image's ID is not known beforehand (empty).
    """
    present = node_images(listing)
    wanted: dict[str, str] = {}
    bring: list[str] = []
    for archive in archives:
        path = str(archive["path"])
        images = _chosen(archive, archive_images(path, machine))
        wrong = sorted({image["architecture"] for image in images} - {MACHINES.get(machine, machine), ""})
        if wrong:
            raise SpecError(f"{path} holds images for {', '.join(wrong)}, but the host is {machine}")
        wanted.update({image["ref"]: image["id"] for image in images})
        if any(present.get(image["ref"]) != image["id"] for image in images):
            bring.append(path)
    names = [normal_ref(ref) for ref in refs]
    pull = [name for name in names if name not in present and name not in wanted]
    wanted.update({name: "" for name in names if name not in wanted})
    return {"bring": bring, "pull": pull, "wanted": wanted}


def _chosen(archive: Mapping[str, Any], images: list[Image]) -> list[Image]:
    """All of the archive's images, or those that are named."""
    names = [normal_ref(ref) for ref in archive.get("images") or []]
    missing = sorted(set(names) - {image["ref"] for image in images})
    if missing:
        held = ", ".join(image["ref"] for image in images)
        raise SpecError(f"{archive['path']} does not hold {', '.join(missing)}, only {held}")
    return [image for image in images if image["ref"] in names] if names else images


def images_problems(wanted: Mapping[str, str], listing: str) -> list[str]:
    """What is still wrong on the node once all was brought; empty if nothing is."""
    present = node_images(listing)
    return [
        f"{ref} is not there" if ref not in present else f"{ref} has the ID {present[ref]}, not {digest}"
        for ref, digest in sorted(wanted.items())
        if ref not in present or (digest and present[ref] != digest)
    ]
