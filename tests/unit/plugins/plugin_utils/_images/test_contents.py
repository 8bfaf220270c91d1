# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""What archives show of their images, as podman, docker and buildkit write them."""

from __future__ import annotations

import gzip
import lzma
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from ansible_collections.rosops.fleet.plugins.plugin_utils._images import contents
from ansible_collections.rosops.fleet.plugins.plugin_utils._images.archive import opened
from ansible_collections.rosops.fleet.plugins.plugin_utils._images.contents import Archives
from ansible_collections.rosops.fleet.tests.unit.plugins.plugin_utils._images.archives import (
    ARM,
    ID,
    digest,
    docker_image,
    oci,
    oci_image,
)

LAYER = b"layer" * 99


def held(*paths: str) -> list[str]:
    """What is seen in the archives, by what they are said to hold in the place of another image."""
    return Archives().instead([{"path": path} for path in paths], "lab/other:1")


@pytest.mark.parametrize("make", [docker_image, oci_image])
def test_an_archive_that_is_packed_itself(make: Callable[..., str], tmp_path: Path) -> None:
    packed = tmp_path / "a.tar.gz"
    packed.write_bytes(gzip.compress(Path(make(tmp_path / "a.tar", "a:1", [LAYER])).read_bytes()))
    assert held(str(packed)) == ["docker.io/library/a:1"]


@pytest.mark.parametrize("make", [docker_image, oci_image])
def test_what_would_take_long_to_unpack_is_not_looked_at(
    make: Callable[..., str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    plain, whole = make(tmp_path / "a.tar", "a:1", [LAYER]), tmp_path / "a.tar.gz"
    whole.write_bytes(gzip.compress(Path(make(tmp_path / "b.tar", "b:1", [LAYER])).read_bytes()))
    for most, seen in ((whole.stat().st_size, True), (whole.stat().st_size - 1, False)):
        monkeypatch.setattr(contents, "LARGEST_COMPRESSED", most)
        assert bool(Archives().ids([plain, str(whole)], "b:1")) is seen, most
    monkeypatch.setattr(contents, "LARGEST_COMPRESSED", 0)
    assert Archives().ids([plain], "a:1")  # nothing to unpack


def test_each_archive_is_listed_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = docker_image(tmp_path / "a.tar", "a:1", [LAYER])
    seen: list[str] = []

    def counted(path: str) -> Any:
        seen.append(path)
        return opened(path)

    monkeypatch.setattr(contents, "opened", counted)
    archives = Archives()
    assert [archives.ids([path, path], ref) for ref in ("b:1", "c:1")] == [frozenset()] * 2
    assert archives.instead([{"path": path}], "b:1") == ["docker.io/library/a:1"]
    assert seen == [path]


def test_what_archives_hold_where_none_has_an_image(tmp_path: Path) -> None:
    old, other = (docker_image(tmp_path / f"{name}.tar", f"lab/{name}:1", [LAYER]) for name in ("scout", "mule"))
    both = [{"path": old}, {"path": other}]
    archives = Archives()
    assert archives.instead(both, "docker.io/lab/scout:1") == []
    assert archives.instead(both, "lab/scout:1.0.1") == ["docker.io/lab/mule:1", "docker.io/lab/scout:1"]
    assert archives.instead([{"path": old, "images": ["lab/none:1"]}], "lab/scout:1") == ["docker.io/lab/none:1"]
    assert archives.instead([*both, {"path": str(tmp_path / "away.tar")}], "lab/scout:2") == []  # it may have it
    assert archives.instead([], "lab/scout:2") == []


def test_what_no_node_can_take_is_seen_as_far_as_it_is_there(tmp_path: Path) -> None:
    packed = tmp_path / "a.tar.xz"
    packed.write_bytes(lzma.compress(LAYER))
    assert "compressed by xz" in Archives().unusable(str(packed))
    assert [Archives().unusable(path) for path in (str(tmp_path / "none"), "~nobody-at-all/x.tar")] == ["", ""]


def test_the_ids_of_an_image_for_whatever_machine(tmp_path: Path) -> None:
    """Which machine a host is only a look at it says. The last archive that has the name counts, as on a node."""
    old, new = (docker_image(tmp_path / f"{name}.tar", "lab/a:1", [LAYER, name.encode()]) for name in ("old", "new"))
    archives = Archives()
    (image,) = archives.ids([old, new], "docker.io/lab/a:1")
    assert {image} == archives.ids([new], "lab/a:1") != archives.ids([old], "lab/a:1")
    assert archives.ids([old], "lab/b:1") == archives.ids([], "lab/a:1") == frozenset()
    assert archives.ids([str(tmp_path / "none.tar"), "~nobody-at-all/x.tar"], "lab/a:1") == frozenset()
    assert archives.ids([oci(tmp_path / "o.tar")], "lab/ros:noetic") == {ID, f"sha256:{digest(ARM)}"}
