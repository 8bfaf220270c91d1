# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""What archives show of their images, as podman, docker and buildkit write them."""

from __future__ import annotations

import bz2
import gzip
import lzma
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from ansible_collections.rosops.fleet.plugins.plugin_utils._images import archive as archive_module
from ansible_collections.rosops.fleet.plugins.plugin_utils._images import contents
from ansible_collections.rosops.fleet.plugins.plugin_utils._images.archive import opened
from ansible_collections.rosops.fleet.plugins.plugin_utils._images.contents import ArchivedImage, Archives
from ansible_collections.rosops.fleet.tests.unit.plugins.plugin_utils._images.archives import (
    ARM,
    ID,
    archive,
    digest,
    docker_image,
    encoded,
    layer,
    oci,
    oci_image,
)

BASE = layer({"./usr/bin": None, "./usr/bin/python3": "python3.8", "./usr/bin/python3.8": ""})
WITHOUT = layer({"usr/bin/.wh.python3": ""})
HARD = layer({"usr/local/bin/python3.9": "", "usr/local/bin/python3": "=usr/local/bin/python3.9"})
ZSTD = b"\x28\xb5\x2f\xfd" + b"\x00" * 60  # by its first bytes; what unpacks it is not in Python 3.11
ROS = {"Entrypoint": ["/ros_entrypoint.sh"], "Cmd": ["bash"], "Env": ["PATH=/opt/bin:/usr/bin", "HOME=/"]}


def plain(one: bytes) -> bytes:
    return one


def found(path: str, ref: str = "a:1") -> ArchivedImage:
    image = Archives().find([path], ref)
    assert image is not None
    assert image.archive == path
    return image


@pytest.mark.parametrize("make", [docker_image, oci_image])
@pytest.mark.parametrize("pack", [plain, gzip.compress, bz2.compress, lzma.compress])
@pytest.mark.parametrize(
    ("layers", "version"),
    [([BASE], "3.8"), ([BASE, WITHOUT], ""), ([WITHOUT, BASE], "3.8"), ([BASE, WITHOUT, BASE], "3.8"), ([HARD], "3.9")],
)
def test_the_layers_of_an_archive_are_read_in_their_order(
    make: Callable[..., str],
    pack: Callable[[bytes], bytes],
    layers: list[bytes],
    version: str,
    tmp_path: Path,
) -> None:
    assert found(make(tmp_path / "a.tar", "a:1", [pack(one) for one in layers])).python == version


@pytest.mark.parametrize("make", [docker_image, oci_image])
def test_an_archive_that_is_packed_itself(make: Callable[..., str], tmp_path: Path) -> None:
    packed = tmp_path / "a.tar.gz"
    packed.write_bytes(gzip.compress(Path(make(tmp_path / "a.tar", "a:1", [BASE, WITHOUT])).read_bytes()))
    assert found(str(packed)).python == ""


@pytest.mark.parametrize("bad", [ZSTD, gzip.compress(BASE)[:40], b"x" * 9999], ids=["zstd", "cut", "text"])
@pytest.mark.parametrize("make", [docker_image, oci_image])
def test_layers_that_cannot_be_read_show_nothing(make: Callable[..., str], bad: bytes, tmp_path: Path) -> None:
    assert found(make(tmp_path / "a.tar", "a:1", [BASE, bad, WITHOUT])).python is None


def test_an_update_without_the_layers_that_nodes_have_shows_nothing(tmp_path: Path) -> None:
    config = encoded({"architecture": "amd64", "config": ROS})
    layers = [f"blobs/sha256/{digest(one)}" for one in (BASE, WITHOUT)]
    manifest = encoded([{"Config": "c.json", "RepoTags": ["a:1"], "Layers": layers}])
    there = {"c.json": config, "manifest.json": manifest, layers[1]: WITHOUT}
    image = found(archive(tmp_path / "a.tar", there))
    assert image.python is None
    assert image.entrypoint == ("/ros_entrypoint.sh",)


@pytest.mark.parametrize("make", [docker_image, oci_image])
def test_what_an_image_runs_by_itself(make: Callable[..., str], tmp_path: Path) -> None:
    image = found(make(tmp_path / "a.tar", "a:1", [], ROS))
    assert (image.entrypoint, image.cmd) == (("/ros_entrypoint.sh",), ("bash",))
    for runs in (None, {}, {"Entrypoint": None, "Cmd": None, "Env": None}):
        image = found(make(tmp_path / "b.tar", "a:1", [BASE], runs))
        assert (image.entrypoint, image.cmd, image.python) == ((), (), "3.8")


@pytest.mark.parametrize(("path", "version"), [("/opt/bin:/usr/bin", "3.10"), ("/usr/bin", "3.8"), ("/opt", "")])
def test_python_is_looked_for_where_the_image_says(path: str, version: str, tmp_path: Path) -> None:
    more = layer({"opt/bin/python3": "python3.10", "opt/bin/python3.10": ""})
    runs = {"Env": ["A=b=c", f"PATH={path}", "EMPTY"]}
    assert found(docker_image(tmp_path / "a.tar", "a:1", [BASE, more], runs)).python == version


def test_the_last_archive_that_has_the_name_counts(tmp_path: Path) -> None:
    old = docker_image(tmp_path / "old.tar", "lab/a:1", [BASE])
    new = docker_image(tmp_path / "new.tar", "lab/a:1", [BASE, WITHOUT])
    other = docker_image(tmp_path / "other.tar", "lab/b:1", [BASE])

    def python(paths: list[str], ref: str = "docker.io/lab/a:1") -> str | None:
        image = Archives().find(paths, ref)
        return image.python if image else None

    assert python([old, new, other]) == ""
    assert python([new, old, other]) == "3.8"
    assert Archives().find([old, new, other], "lab/a:2") is None
    assert Archives().find([], "lab/a:1") is None


@pytest.mark.parametrize(
    "make",
    [
        str,
        lambda path: path.write_bytes(b"no tar at all" * 99),
        lambda path: archive(path, {"x": b"1"}),
        lambda path: docker_image(path, "a:1", [], ["no", "mapping"]),  # type: ignore[arg-type]
    ],
)
def test_what_is_no_archive_shows_nothing(make: Callable[[Path], Any], tmp_path: Path) -> None:
    make(tmp_path / "x.tar")
    assert Archives().find([str(tmp_path / "x.tar")], "a:1") is None
    assert Archives().find(["~nobody-at-all/x.tar"], "a:1") is None


@pytest.mark.parametrize("make", [docker_image, oci_image])
def test_what_would_take_long_to_unpack_is_not_looked_at(
    make: Callable[..., str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    packed = [gzip.compress(BASE), gzip.compress(WITHOUT)]
    limit = sum(map(len, packed))
    path = make(tmp_path / "a.tar", "a:1", packed)
    whole = tmp_path / "a.tar.gz"
    whole.write_bytes(gzip.compress(Path(make(tmp_path / "b.tar", "b:1", [BASE])).read_bytes()))
    for name, size in (("a:1", limit), ("b:1", whole.stat().st_size)):
        for most, seen in ((size, True), (size - 1, False)):
            for module in (archive_module, contents):
                monkeypatch.setattr(module, "LARGEST_COMPRESSED", most)
            image = Archives().find([path, str(whole)], name)
            assert (image is not None and image.python is not None) is seen, (name, most)
    monkeypatch.setattr(archive_module, "LARGEST_COMPRESSED", 0)
    assert found(make(tmp_path / "c.tar", "a:1", [BASE])).python == "3.8"  # nothing to unpack


def test_an_image_for_several_architectures_is_looked_at_as_one(tmp_path: Path) -> None:
    assert found(oci(tmp_path / "a.tar"), "lab/ros:noetic").image.architecture == "amd64"


def test_each_archive_is_listed_once_and_layers_only_when_they_are_asked_for(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = docker_image(tmp_path / "a.tar", "a:1", [BASE], ROS)
    seen: list[str] = []

    def counted(path: str) -> Any:
        seen.append(path)
        return opened(path)

    monkeypatch.setattr(contents, "opened", counted)
    archives = Archives()
    images = [archives.find([path, path], ref) for ref in ("a:1", "b:1", "a:1")]
    assert images[0] is not None
    assert images[0].entrypoint
    assert seen == [path]
    assert [image.python for image in images if image] == ["3.8", "3.8"]
    assert seen == [path, path]


def test_what_archives_hold_where_none_has_an_image(tmp_path: Path) -> None:
    old, other = (docker_image(tmp_path / f"{name}.tar", f"lab/{name}:1", [BASE]) for name in ("scout", "mule"))
    both = [{"path": old}, {"path": other}]
    archives = Archives()
    assert archives.instead(both, "docker.io/lab/scout:1") == []
    assert archives.instead(both, "lab/scout:1.0.1") == ["docker.io/lab/mule:1", "docker.io/lab/scout:1"]
    assert archives.instead([{"path": old, "images": ["lab/none:1"]}], "lab/scout:1") == ["docker.io/lab/none:1"]
    assert archives.instead([*both, {"path": str(tmp_path / "away.tar")}], "lab/scout:2") == []  # it may have it
    assert archives.instead([], "lab/scout:2") == []


def test_what_no_node_can_take_is_seen_as_far_as_it_is_there(tmp_path: Path) -> None:
    packed = tmp_path / "a.tar.xz"
    packed.write_bytes(lzma.compress(BASE))
    assert "compressed by xz" in Archives().unusable(str(packed))
    assert [Archives().unusable(path) for path in (str(tmp_path / "none"), "~nobody-at-all/x.tar")] == ["", ""]


def test_the_ids_of_an_image_for_whatever_machine(tmp_path: Path) -> None:
    """Which machine a host is only a look at it says."""
    old, new = (docker_image(tmp_path / f"{name}.tar", "lab/a:1", [BASE], {"Cmd": [name]}) for name in ("old", "new"))
    archives = Archives()
    (image,) = archives.ids([old, new], "docker.io/lab/a:1")
    assert image == found(new, "lab/a:1").image.id != found(old, "lab/a:1").image.id
    assert archives.ids([old], "lab/b:1") == frozenset()
    assert archives.ids([oci(tmp_path / "o.tar")], "lab/ros:noetic") == {ID, f"sha256:{digest(ARM)}"}
