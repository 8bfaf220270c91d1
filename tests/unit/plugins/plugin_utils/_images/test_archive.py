# SPDX-License-Identifier: GPL-3.0-or-later
"""Archives as docker, podman and buildkit write them, and what they show of their images."""

from __future__ import annotations

import bz2
import gzip
import json
import lzma
import tarfile
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import pytest
from ansible_collections.rosops.fleet.plugins.module_utils._common.errors import SpecError
from ansible_collections.rosops.fleet.plugins.plugin_utils._images import archive as _archive
from ansible_collections.rosops.fleet.plugins.plugin_utils._images.archive import (
    archive_images,
    archived_ids,
    archived_instead,
    normal_ref,
    opened,
    thin_archive,
    unusable,
)
from ansible_collections.rosops.fleet.tests.unit.plugins.plugin_utils._images.archives import (
    ARM,
    CONFIG,
    ID,
    archive,
    digest,
    docker,
    docker_image,
    encoded,
    oci,
    oci_image,
    sha,
    tar_of,
)


@pytest.mark.parametrize(("ref", "full"), [
    ("ros", "docker.io/library/ros:latest"), ("ros:noetic", "docker.io/library/ros:noetic"),
    ("lab/ros:noetic", "docker.io/lab/ros:noetic"), ("docker.io/ros:noetic", "docker.io/library/ros:noetic"),
    ("localhost/lab/ros", "localhost/lab/ros:latest"), ("edge1:5000/ros", "edge1:5000/ros:latest"),
    ("ghcr.io/a/b@sha256:12", "ghcr.io/a/b@sha256:12"),
])  # fmt: skip
def test_names_are_containerds(ref: str, full: str) -> None:
    assert normal_ref(ref) == full


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
    assert (image.ref, image.id) == ("docker.io/lab/ros:noetic", sha(config))


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (str, "there is no image archive"),
        (lambda path: path.write_bytes(b"no tar at all" * 99) and str(path), "is no tar archive"),
        (lambda path: archive(path, {"x": b"1"}), "neither manifest.json nor index.json"),
        (lambda path: docker(path, None), "names no image"),
        (lambda path: archive(path, {"manifest.json": b"[{]"}), "is no docker or OCI image archive"),
        (lambda path: docker(path, ["a:1"], b"[]"), "is no docker or OCI image archive"),
        (lambda path: archive(path, {"manifest.json": b'[{"Config": "x", "RepoTags": ["a"]}]'}), "is no docker or OCI"),
    ],
)
def test_bad_archives_are_named(tmp_path: Path, make: Any, message: str) -> None:
    path = tmp_path / "x.tar"
    with pytest.raises(SpecError, match=message):
        archive_images(str(make(path) or path))


def test_an_architecture_that_is_not_in_the_archive(tmp_path: Path) -> None:
    with pytest.raises(SpecError, match="no image for arm, only for amd64, arm64"):
        archive_images(oci(tmp_path / "o.tar"), "armv7l")


# --- several of them --------------------------------------------------------------------------------------------------

LAYER = b"layer" * 99


def test_what_would_take_long_to_unpack_is_not_looked_at(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    plain, whole = docker_image(tmp_path / "a.tar", "a:1", [LAYER]), tmp_path / "a.tar.gz"
    whole.write_bytes(gzip.compress(Path(oci_image(tmp_path / "b.tar", "b:1", [LAYER])).read_bytes()))
    for most, seen in ((whole.stat().st_size, True), (whole.stat().st_size - 1, False)):
        monkeypatch.setattr(_archive, "LARGEST_COMPRESSED", most)
        _archive._read.cache_clear()
        assert bool(archived_ids([plain, str(whole)], "b:1")) is seen, most
    monkeypatch.setattr(_archive, "LARGEST_COMPRESSED", 0)
    _archive._read.cache_clear()
    assert archived_ids([plain], "a:1")  # nothing to unpack


def test_each_archive_is_listed_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path, seen = docker_image(tmp_path / "a.tar", "a:1", [LAYER]), list[str]()
    monkeypatch.setattr(_archive, "opened", lambda path: seen.append(path) or opened(path))
    assert [archived_ids([path, path], ref) for ref in ("b:1", "c:1")] == [frozenset()] * 2
    assert archived_instead([{"path": path}], "b:1") == ["docker.io/library/a:1"]
    assert seen == [path]


def test_what_archives_hold_where_none_has_an_image(tmp_path: Path) -> None:
    old, other = (docker_image(tmp_path / f"{name}.tar", f"lab/{name}:1", [LAYER]) for name in ("scout", "mule"))
    both = [{"path": old}, {"path": other}]
    assert archived_instead(both, "docker.io/lab/scout:1") == []
    assert archived_instead(both, "lab/scout:1.0.1") == ["docker.io/lab/mule:1", "docker.io/lab/scout:1"]
    assert archived_instead([{"path": old, "images": ["lab/none:1"]}], "lab/scout:1") == ["docker.io/lab/none:1"]
    assert archived_instead([*both, {"path": str(tmp_path / "away.tar")}], "lab/scout:2") == []  # it may have it
    assert archived_instead([], "lab/scout:2") == []


def test_the_ids_of_an_image_for_whatever_machine(tmp_path: Path) -> None:
    """Which machine a host is only a look at it says. The last archive that has the name counts, as on a node."""
    old, new = (docker_image(tmp_path / f"{name}.tar", "lab/a:1", [LAYER, name.encode()]) for name in ("old", "new"))
    (image,) = archived_ids([old, new], "docker.io/lab/a:1")
    assert {image} == archived_ids([new], "lab/a:1") != archived_ids([old], "lab/a:1")
    assert archived_ids([old], "lab/b:1") == archived_ids([], "lab/a:1") == frozenset()
    for away in (str(tmp_path / "none.tar"), "~nobody-at-all/x.tar"):
        assert (archived_ids([away], "lab/a:1"), unusable(away)) == (frozenset(), "")
    assert archived_ids([oci(tmp_path / "o.tar")], "lab/ros:noetic") >= {ID, sha(ARM)}


# --- without what a node has ------------------------------------------------------------------------------------------

BASE = tar_of({f"usr/share/file{number}": b"" for number in range(99)})
OWN, NEXT = tar_of({"app/one": b""}), tar_of({"app/two": b""})
Make = Callable[[Path, str, Sequence[bytes]], str]


def held(place: Path | str) -> dict[str, bytes]:
    with opened(str(place)) as found:
        return {name: found.content(member).read() for name, member in found.members.items()}


def linked(path: Path, tag: str, layers: Sequence[bytes]) -> str:
    """As `docker save` did before version 25 and podman does: a layer that stands there already is a link."""
    files = held(docker_image(path, tag, layers))
    manifest = json.loads(files["manifest.json"])
    kept, manifest[0]["Layers"] = manifest[0]["Layers"], [f"{number}/layer.tar" for number in range(len(layers))]
    archive(path, {**files, "manifest.json": encoded(manifest)})
    with tarfile.open(path, "a") as tar:
        for name, target in zip(manifest[0]["Layers"], kept, strict=True):
            link = tarfile.TarInfo(name)
            link.type, link.linkname = tarfile.SYMTYPE, f"../{target}"
            tar.addfile(link)
    return str(path)


def thin(path: str, blobs: set[str], place: Path) -> frozenset[str] | None:
    return thin_archive(path, archive_images(path, "aarch64" if "oci" in path else "x86_64"), blobs, place)


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


PACKED = gzip.compress(BASE, mtime=0)


def whole_gzip(path: Path) -> str:
    path.write_bytes(gzip.compress(Path(docker_image(path, "a:1", [BASE, NEXT])).read_bytes()))
    return str(path)


def one_layer_gone(path: Path) -> str:
    files = held(docker_image(path, "a:1", [BASE, NEXT]))
    del files[f"{digest(BASE)}.tar"]
    return archive(path, files)


@pytest.mark.parametrize(
    ("make", "blobs"),
    [
        (lambda path: docker_image(path, "a:1", [BASE, NEXT]), set()),  # nothing to leave out
        # which digest such a layer has there is not sure
        (lambda path: docker_image(path, "a:1", [PACKED, NEXT]), {sha(BASE), sha(PACKED)}),
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
        files |= held(path)
        both += json.loads(files["manifest.json"])
    path = archive(tmp_path / "both.tar", {**files, "manifest.json": encoded(both)})
    assert thin(path, {sha(OWN)}, tmp_path / "thin.tar")
    with tarfile.open(tmp_path / "thin.tar") as tar:
        names = tar.getnames()
    assert names.count(f"blobs/sha256/{digest(BASE)}") == 1 and f"blobs/sha256/{digest(OWN)}" not in names
