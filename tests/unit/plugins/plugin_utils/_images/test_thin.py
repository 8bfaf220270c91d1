# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Archives that leave out what a node has."""

from __future__ import annotations

import gzip
import io
import json
import tarfile
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import pytest
from ansible_collections.rosops.fleet.plugins.plugin_utils._images.archive import archive_images
from ansible_collections.rosops.fleet.plugins.plugin_utils._images.thin import thin_archive
from ansible_collections.rosops.fleet.tests.unit.plugins.plugin_utils._images.archives import (
    archive,
    digest,
    docker_image,
    encoded,
    oci_image,
    tar_of,
)

BASE = tar_of({f"usr/share/file{number}": b"" for number in range(99)})
OWN, NEXT = tar_of({"app/one": b""}), tar_of({"app/two": b""})
Make = Callable[[Path, str, Sequence[bytes]], str]


def linked(path: Path, tag: str, layers: Sequence[bytes]) -> str:
    """As `docker save` did before version 25 and podman does: a layer that stands there already is a link."""
    config = encoded({"architecture": "amd64", "rootfs": {"diff_ids": [f"sha256:{digest(one)}" for one in layers]}})
    names = [f"{number}/layer.tar" for number in range(len(layers))]
    manifest = [{"Config": "config.json", "RepoTags": [tag], "Layers": names}]
    with tarfile.open(path, "w") as tar:
        for name, content in zip(names, layers, strict=True):
            kept, link = tarfile.TarInfo(f"{digest(content)}.tar"), tarfile.TarInfo(name)
            kept.size, link.type, link.linkname = len(content), tarfile.SYMTYPE, f"../{digest(content)}.tar"
            tar.addfile(kept, io.BytesIO(content))
            tar.addfile(link)
        for name, content in (("config.json", config), ("manifest.json", encoded(manifest))):
            info = tarfile.TarInfo(name)
            info.size = len(content)
            tar.addfile(info, io.BytesIO(content))
    return str(path)


def sha(content: bytes) -> str:
    return f"sha256:{digest(content)}"


def thin(path: str, blobs: set[str], place: Path) -> frozenset[str] | None:
    return thin_archive(path, archive_images(path, "aarch64" if "oci" in path else "x86_64"), blobs, place)


def held(place: Path) -> dict[str, bytes]:
    with tarfile.open(place) as tar:
        return {member.name: tar.extractfile(member).read() for member in tar.getmembers()}  # type: ignore[union-attr]


@pytest.mark.parametrize("make", [docker_image, oci_image, linked])
def test_only_what_the_node_lacks_is_in_it(make: Make, tmp_path: Path) -> None:
    path, place = make(tmp_path / f"{make.__name__}.tar", "lab/apps:1.1", [BASE, NEXT]), tmp_path / "thin.tar"
    needed = thin(path, {sha(BASE), sha(OWN)}, place)
    assert needed is not None
    assert {sha(BASE), sha(NEXT)} < needed
    files = held(place)
    assert f"blobs/sha256/{digest(NEXT)}" in files and f"blobs/sha256/{digest(BASE)}" not in files
    assert all(digest(content) == name.rpartition("/")[2] for name, content in files.items() if "blobs/" in name)
    assert {f"sha256:{name.rpartition('/')[2]}" for name in files if "blobs/" in name} == needed - {sha(BASE)}
    # a node that imports it gets the same image
    (image,), (again,) = archive_images(path), archive_images(str(place))
    assert (again.ref, again.id) == (image.ref, image.id) == ("docker.io/lab/apps:1.1", image.id)
    (entry,) = json.loads(files["index.json"])["manifests"]
    manifest = json.loads(files[f"blobs/sha256/{entry['digest'].partition(':')[2]}"])
    assert [one["digest"] for one in manifest["layers"]] == [sha(BASE), sha(NEXT)]
    assert [one["size"] for one in manifest["layers"]] == [len(BASE), len(NEXT)]


def test_it_is_the_same_file_each_time(tmp_path: Path) -> None:
    """An interrupted copy is resumed by the next run."""
    path = docker_image(tmp_path / "a.tar", "a:1", [BASE, NEXT])
    places = [tmp_path / name for name in ("one", "two")]
    for place in places:
        assert thin(path, {sha(BASE)}, place)
    assert places[0].read_bytes() == places[1].read_bytes()


def compressed(path: Path) -> str:
    return docker_image(path, "a:1", [gzip.compress(BASE), NEXT])


def whole_gzip(path: Path) -> str:
    docker_image(path, "a:1", [BASE, NEXT])
    path.write_bytes(gzip.compress(path.read_bytes()))
    return str(path)


def one_layer_gone(path: Path) -> str:
    config = encoded({"architecture": "amd64", "rootfs": {"diff_ids": [sha(BASE), sha(NEXT)]}})
    manifest = [{"Config": "config.json", "RepoTags": ["a:1"], "Layers": ["base.tar", "next.tar"]}]
    return archive(path, {"config.json": config, "manifest.json": encoded(manifest), "next.tar": NEXT})


@pytest.mark.parametrize(
    ("make", "blobs"),
    [
        (lambda path: docker_image(path, "a:1", [BASE, NEXT]), set()),  # nothing to leave out
        (compressed, {sha(BASE), sha(gzip.compress(BASE))}),  # which digest such a layer has there is not sure
        (whole_gzip, {sha(BASE)}),  # what is left is larger than the whole, which is compressed
        (one_layer_gone, {sha(BASE)}),
    ],
)
def test_in_doubt_the_whole_archive_travels(make: Callable[[Path], str], blobs: set[str], tmp_path: Path) -> None:
    assert thin(make(tmp_path / "a.tar"), blobs, tmp_path / "thin.tar") is None


def test_images_of_one_archive_share_their_layers(tmp_path: Path) -> None:
    first, second = (docker_image(tmp_path / f"{name}.tar", f"lab/{name}:1", [BASE, own])
                     for name, own in (("one", OWN), ("two", NEXT)))  # fmt: skip
    both: list[Any] = []
    files: dict[str, bytes] = {}
    for path in (first, second):
        with tarfile.open(path) as tar:
            files.update({one.name: tar.extractfile(one).read() for one in tar.getmembers()})  # type: ignore[union-attr]
        both += json.loads(files["manifest.json"])
    path = archive(tmp_path / "both.tar", {**files, "manifest.json": encoded(both)})
    assert thin(path, {sha(OWN)}, tmp_path / "thin.tar")
    with tarfile.open(tmp_path / "thin.tar") as tar:
        names = tar.getnames()
    assert names.count(f"blobs/sha256/{digest(BASE)}") == 1 and f"blobs/sha256/{digest(OWN)}" not in names
