# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Archives as docker, podman and buildkit write them, and what a node lacks."""

from __future__ import annotations

import gzip
import hashlib
import io
import json
import tarfile
from pathlib import Path
from typing import Any

import pytest
from ansible_collections.rosops.fleet.plugins.module_utils._common.errors import SpecError
from ansible_collections.rosops.fleet.plugins.plugin_utils._update import images as _images


def encoded(document: Any) -> bytes:
    return json.dumps(document).encode()


def digest(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()


CONFIG = encoded({"architecture": "amd64", "os": "linux"})
ARM = encoded({"architecture": "arm64", "os": "linux"})
ID = f"sha256:{digest(CONFIG)}"


def archive(path: Path, files: dict[str, bytes]) -> str:
    with tarfile.open(path, "w") as tar:
        for name, content in files.items():
            member = tarfile.TarInfo(name)
            member.size = len(content)
            tar.addfile(member, io.BytesIO(content))
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
        for name, config in (("amd64", CONFIG), ("arm64", ARM))
    ]
    entry = {
        "digest": blob(encoded({"manifests": manifests})),
        "annotations": {_images.CONTAINERD_NAME: "docker.io/lab/ros:noetic"},
    }
    files["index.json"] = encoded({"manifests": [entry, {"digest": "sha256:0", "annotations": {}}]})
    return archive(path, {"oci-layout": b"{}", **files})


def listing(**images: str) -> str:
    return json.dumps(
        {"images": [{"id": value, "repoTags": [key.replace("__", "/") + ":1.0"]} for key, value in images.items()]}
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
    assert _images.normal_ref(ref) == full


def test_the_id_is_the_configurations_digest_whatever_its_file_is_called(tmp_path: Path) -> None:
    path = docker(tmp_path / "a.tar", ["lab/apps:1.0", "lab/apps:latest"])
    assert _images.archive_images(path) == [
        {"ref": "docker.io/lab/apps:1.0", "id": ID, "architecture": "amd64"},
        {"ref": "docker.io/lab/apps:latest", "id": ID, "architecture": "amd64"},
    ]


def test_compressed_archives_are_read(tmp_path: Path) -> None:
    path = docker(tmp_path / "a.tar", ["a:1"])
    packed = tmp_path / "a.tar.gz"
    packed.write_bytes(gzip.compress(Path(path).read_bytes()))
    assert _images.archive_images(str(packed)) == _images.archive_images(path)


@pytest.mark.parametrize(("machine", "config"), [("x86_64", CONFIG), ("aarch64", ARM)])
def test_an_oci_archive_gives_the_machines_own_image(tmp_path: Path, machine: str, config: bytes) -> None:
    (image,) = _images.archive_images(oci(tmp_path / "o.tar"), machine)
    assert (image["ref"], image["id"]) == ("docker.io/lab/ros:noetic", f"sha256:{digest(config)}")


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (str, "there is no image archive"),
        (lambda path: path.write_bytes(b"no tar at all" * 99) and str(path), "is no tar archive"),
        (lambda path: archive(path, {"x": b"1"}), "neither manifest.json nor index.json"),
        (lambda path: docker(path, None), "names no image"),
        (lambda path: archive(path, {"manifest.json": b"[{]"}), "is no docker or OCI image archive"),
        (
            lambda path: archive(path, {"manifest.json": b'[{"Config": "gone", "RepoTags": ["a:1"]}]'}),
            "is no docker or OCI",
        ),
    ],
)
def test_bad_archives_are_named(tmp_path: Path, make: Any, message: str) -> None:
    path = tmp_path / "x.tar"
    with pytest.raises(SpecError, match=message):
        _images.archive_images(str(make(path) or path))


def test_an_architecture_that_is_not_in_the_archive(tmp_path: Path) -> None:
    with pytest.raises(SpecError, match="no image for arm, only for amd64, arm64"):
        _images.archive_images(oci(tmp_path / "o.tar"), "armv7l")
    with pytest.raises(SpecError, match="holds images for amd64, but the host is aarch64"):
        _images.images_plan([{"path": docker(tmp_path / "d.tar", ["a:1"])}], [], "", "aarch64")


@pytest.mark.parametrize(
    ("present", "bring", "pull"),
    [
        ("", True, ["docker.io/library/redis:7"]),
        ('{"images": []}', True, ["docker.io/library/redis:7"]),
        (listing(docker__x="1"), True, ["docker.io/library/redis:7"]),
        (
            json.dumps({"images": [{"id": ID, "repoTags": ["docker.io/lab/apps:1.0"]}]}),
            False,
            ["docker.io/library/redis:7"],
        ),
        (
            json.dumps({"images": [{"id": ID[7:], "repoTags": ["docker.io/lab/apps:1.0"]}]}),
            False,
            ["docker.io/library/redis:7"],
        ),
        (
            json.dumps(
                {"images": [{"id": "sha256:old", "repoTags": ["docker.io/lab/apps:1.0", "docker.io/library/redis:7"]}]}
            ),
            True,
            [],
        ),
    ],
)
def test_what_is_there_by_id_does_not_travel(tmp_path: Path, present: str, bring: bool, pull: list[str]) -> None:
    path = docker(tmp_path / "a.tar", ["lab/apps:1.0"])
    plan = _images.images_plan([{"path": path}], ["redis:7"], present)
    assert plan["bring"] == ([path] if bring else [])
    assert plan["pull"] == pull
    assert plan["wanted"] == {"docker.io/lab/apps:1.0": ID, "docker.io/library/redis:7": ""}


def test_only_the_named_images_count(tmp_path: Path) -> None:
    path = docker(tmp_path / "a.tar", ["lab/apps:1.0", "lab/ros:noetic"])
    present = json.dumps({"images": [{"id": ID, "repoTags": ["docker.io/lab/apps:1.0"]}]})
    assert _images.images_plan([{"path": path, "images": ["lab/apps:1.0"]}], [], present)["bring"] == []
    with pytest.raises(SpecError, match=r"does not hold docker.io/lab/apps:2.0, only docker.io/lab/apps:1.0"):
        _images.images_plan([{"path": path, "images": ["lab/apps:2.0"]}], [], present)


def test_problems_after_the_import() -> None:
    wanted = {"docker.io/lab/apps:1.0": ID, "docker.io/library/redis:7": "", "docker.io/lab/ros:1": ID}
    present = {"images": [{"id": "sha256:other", "repoTags": ["docker.io/lab/ros:1", "docker.io/library/redis:7"]}]}
    assert _images.images_problems(wanted, json.dumps(present)) == [
        "docker.io/lab/apps:1.0 is not there",
        f"docker.io/lab/ros:1 has the ID sha256:other, not {ID}",
    ]


def test_a_listing_that_is_no_json() -> None:
    with pytest.raises(SpecError, match="no JSON"):
        _images.node_images("FATA[0000] connect: no such file")
