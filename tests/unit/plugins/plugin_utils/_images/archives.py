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


def sha(content: bytes) -> str:
    return f"sha256:{digest(content)}"


CONFIG = encoded({"architecture": "amd64", "os": "linux"})
ARM = encoded({"architecture": "arm64", "os": "linux"})
ID = sha(CONFIG)


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


def layout(path: Path, blobs: Sequence[bytes], manifests: list[dict[str, Any]]) -> str:
    """An OCI layout in a tar."""
    files = {f"blobs/sha256/{digest(blob)}": blob for blob in blobs}
    return archive(path, {"oci-layout": b"{}", **files, "index.json": encoded({"manifests": manifests})})


def oci(path: Path) -> str:
    """An index in an index, as buildkit makes for several architectures."""
    configs = {"amd64": CONFIG, "arm64": ARM, "unknown": b"{}"}  # the last is buildkit's word on it
    made = {name: encoded({"config": {"digest": sha(config)}}) for name, config in configs.items()}
    manifests = [{"digest": sha(one), "platform": {"architecture": name}} for name, one in made.items()]
    left_out = {"digest": "sha256:1", "platform": {"architecture": "arm"}}
    index = encoded({"manifests": [*manifests, left_out]})
    named = {"digest": sha(index), "annotations": {CONTAINERD_NAME: "docker.io/lab/ros:noetic"}}
    return layout(path, [*configs.values(), *made.values(), index], [named, {"digest": "sha256:0", "annotations": {}}])


def docker_image(path: Path, tag: str, layers: Sequence[bytes]) -> str:
    """As `podman save` makes it."""
    listed = [f"{digest(one)}.tar" for one in layers]
    files = dict(zip(listed, layers, strict=True))
    rootfs = {"type": "layers", "diff_ids": [*map(sha, layers)]}
    config = encoded({"architecture": "amd64", "os": "linux", "rootfs": rootfs})
    manifest = [{"Config": f"{digest(config)}.json", "RepoTags": [tag], "Layers": listed}]
    return archive(path, {**files, f"{digest(config)}.json": config, "manifest.json": encoded(manifest)})


def oci_image(path: Path, tag: str, layers: Sequence[bytes]) -> str:
    """The layers stand in it the wrong way around, which they may do."""
    config = encoded({"architecture": "arm64", "os": "linux"})
    said = [{"digest": sha(one), "size": len(one)} for one in layers]
    manifest = encoded({"config": {"digest": sha(config)}, "layers": said})
    named = {"digest": sha(manifest), "annotations": {CONTAINERD_NAME: tag}}
    return layout(path, [*reversed(layers), config, manifest], [named])
