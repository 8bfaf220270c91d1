# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Archives as docker, podman and buildkit write them."""

from __future__ import annotations

import bz2
import lzma
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from ansible_collections.rosops.fleet.plugins.module_utils._common.errors import SpecError
from ansible_collections.rosops.fleet.plugins.plugin_utils._images.archive import (
    Image,
    archive_images,
    normal_ref,
    unusable,
)
from ansible_collections.rosops.fleet.tests.unit.plugins.plugin_utils._images.archives import (
    ARM,
    CONFIG,
    ID,
    archive,
    digest,
    docker,
    oci,
)


@pytest.mark.parametrize(
    ("ref", "full"),
    [
        ("ros", "docker.io/library/ros:latest"),
        ("ros:noetic", "docker.io/library/ros:noetic"),
        ("lab/ros:noetic", "docker.io/lab/ros:noetic"),
        ("docker.io/ros:noetic", "docker.io/library/ros:noetic"),
        ("localhost/lab/ros", "localhost/lab/ros:latest"),
        ("edge1:5000/ros", "edge1:5000/ros:latest"),
        ("ghcr.io/a/b@sha256:12", "ghcr.io/a/b@sha256:12"),
    ],
)
def test_names_are_containerds(ref: str, full: str) -> None:
    assert normal_ref(ref) == full


def test_the_id_is_the_configurations_digest_whatever_its_file_is_called(tmp_path: Path) -> None:
    path = docker(tmp_path / "a.tar", ["lab/apps:1.0", "lab/apps:latest"])
    assert archive_images(path) == [
        Image("docker.io/lab/apps:1.0", ID, "amd64"),
        Image("docker.io/lab/apps:latest", ID, "amd64"),
    ]


@pytest.mark.parametrize(
    ("pack", "name"),
    [(bz2.compress, "bzip2"), (lzma.compress, "xz"), (lambda content: b"\x28\xb5\x2f\xfd" + content, "zstd")],
)
def test_what_containerd_or_the_control_node_cannot_unpack_is_refused(
    tmp_path: Path, pack: Callable[[bytes], bytes], name: str
) -> None:
    """By its content: it would be copied whole, and refused on the robot."""
    packed = tmp_path / "a.tar.gz"
    packed.write_bytes(pack(Path(docker(tmp_path / "a.tar", ["a:1"])).read_bytes()))
    told = f"{packed} is compressed by {name}: unpack it, or compress it by gzip"
    assert unusable(str(packed)) == told
    with pytest.raises(SpecError, match=told):
        archive_images(str(packed))


@pytest.mark.parametrize(("machine", "config"), [("x86_64", CONFIG), ("aarch64", ARM)])
def test_an_oci_archive_gives_the_machines_own_image(tmp_path: Path, machine: str, config: bytes) -> None:
    (image,) = archive_images(oci(tmp_path / "o.tar"), machine)
    assert (image.ref, image.id) == ("docker.io/lab/ros:noetic", f"sha256:{digest(config)}")


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (str, "there is no image archive"),
        (lambda path: path.write_bytes(b"no tar at all" * 99) and str(path), "is no tar archive"),
        (lambda path: archive(path, {"x": b"1"}), "neither manifest.json nor index.json"),
        (lambda path: docker(path, None), "names no image"),
        (lambda path: archive(path, {"manifest.json": b"[{]"}), "is no docker or OCI image archive"),
        (lambda path: docker(path, ["a:1"], b"[]"), "is no docker or OCI image archive"),
        (
            lambda path: archive(path, {"manifest.json": b'[{"Config": "gone", "RepoTags": ["a:1"]}]'}),
            "is no docker or OCI",
        ),
    ],
)
def test_bad_archives_are_named(tmp_path: Path, make: Any, message: str) -> None:
    path = tmp_path / "x.tar"
    with pytest.raises(SpecError, match=message):
        archive_images(str(make(path) or path))


def test_an_architecture_that_is_not_in_the_archive(tmp_path: Path) -> None:
    with pytest.raises(SpecError, match="no image for arm, only for amd64, arm64"):
        archive_images(oci(tmp_path / "o.tar"), "armv7l")
