# SPDX-License-Identifier: GPL-3.0-or-later
"""Archives as docker and buildkit write them, with configurations in place of layers."""

from __future__ import annotations

import hashlib
import io
import json
import tarfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from ansible_collections.rosops.fleet.plugins.plugin_utils._images.archive import CONTAINERD_NAME


def encoded(document: Any) -> bytes:
    return json.dumps(document).encode()


def digest(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()


CONFIG = encoded({"architecture": "amd64", "os": "linux"})
ARM = encoded({"architecture": "arm64", "os": "linux"})
ID = f"sha256:{digest(CONFIG)}"


def tar_of(files: Mapping[str, bytes]) -> bytes:
    """An archive, or a layer, with these files."""
    packed = io.BytesIO()
    with tarfile.open(fileobj=packed, mode="w") as tar:
        for name, content in files.items():
            member = tarfile.TarInfo(name)
            member.size = len(content)
            tar.addfile(member, io.BytesIO(content))
    return packed.getvalue()


def archive(path: Path, files: Mapping[str, bytes]) -> str:
    path.write_bytes(tar_of(files))
    return str(path)


def docker(path: Path, tags: list[str] | None, config: bytes = CONFIG) -> str:
    manifest = [{"Config": "odd-name.json", "RepoTags": tags, "Layers": ["a/layer.tar"]}]
    files = {"a/layer.tar": b"x" * 9999, "odd-name.json": config, "manifest.json": encoded(manifest)}
    return archive(path, files)


def oci(path: Path) -> str:
    """An index in an index, as buildkit makes for several architectures."""
    files: dict[str, bytes] = {}

    def blob(content: bytes) -> str:
        files[f"blobs/sha256/{digest(content)}"] = content
        return f"sha256:{digest(content)}"

    manifests = [
        {"digest": blob(encoded({"config": {"digest": blob(config)}})), "platform": {"architecture": name}}
        for name, config in (("amd64", CONFIG), ("arm64", ARM), ("unknown", b"{}"))  # the last is buildkit's word on it
    ]
    manifests.append({"digest": "sha256:1", "platform": {"architecture": "arm"}})  # left out
    entry = {
        "digest": blob(encoded({"manifests": manifests})),
        "annotations": {CONTAINERD_NAME: "docker.io/lab/ros:noetic"},
    }
    files["index.json"] = encoded({"manifests": [entry, {"digest": "sha256:0", "annotations": {}}]})
    return archive(path, {"oci-layout": b"{}", **files})


def docker_image(path: Path, tag: str, layers: Sequence[bytes]) -> str:
    """As `podman save` makes it."""
    listed = [f"{digest(one)}.tar" for one in layers]
    files = dict(zip(listed, layers, strict=True))
    rootfs = {"type": "layers", "diff_ids": [f"sha256:{digest(one)}" for one in layers]}
    config = encoded({"architecture": "amd64", "os": "linux", "rootfs": rootfs})
    manifest = [{"Config": f"{digest(config)}.json", "RepoTags": [tag], "Layers": listed}]
    return archive(path, {**files, f"{digest(config)}.json": config, "manifest.json": encoded(manifest)})


def oci_image(path: Path, tag: str, layers: Sequence[bytes]) -> str:
    """An OCI layout in a tar; the layers stand in it the wrong way around, which it may do."""
    config = encoded({"architecture": "arm64", "os": "linux"})
    said = [{"digest": f"sha256:{digest(one)}", "size": len(one)} for one in layers]
    manifest = encoded({"config": {"digest": f"sha256:{digest(config)}"}, "layers": said})
    entry = {"digest": f"sha256:{digest(manifest)}", "annotations": {CONTAINERD_NAME: tag}}
    blobs = {f"blobs/sha256/{digest(blob)}": blob for blob in (*reversed(layers), config, manifest)}
    return archive(path, {"oci-layout": b"{}", **blobs, "index.json": encoded({"manifests": [entry]})})
