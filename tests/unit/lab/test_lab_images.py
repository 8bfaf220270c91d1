# SPDX-License-Identifier: GPL-3.0-or-later
"""Image archives, checksums and the set-up's stamp."""

from __future__ import annotations

import hashlib
import io
import json
import tarfile
from pathlib import Path

import pytest
from lablib.app_images import Version, versions
from lablib.errors import LabError
from lablib.k3s import parse_sums
from lablib.oci import Image, Layer, write_archive, write_difference, write_layer, write_update


def content(tar: tarfile.TarFile, name: str) -> bytes:
    member = tar.extractfile(name)
    assert member is not None
    return member.read()


def layer(directory: Path, name: str) -> Layer:
    program = directory / name
    program.write_text(name)
    return write_layer(directory / f"{name}.tar", [(f"/bin/{name}", program)])


def test_archives_are_reproducible(tmp_path: Path) -> None:
    image = Image("docker.io/lab/a:1", [layer(tmp_path, "base")], {"Env": ["A=1"]})
    write_archive(tmp_path / "one.tar", [image])
    write_archive(tmp_path / "two.tar", [image])
    assert (tmp_path / "one.tar").read_bytes() == (tmp_path / "two.tar").read_bytes()


def test_an_update_leaves_out_the_layers_that_are_there(tmp_path: Path) -> None:
    base, top, archive = layer(tmp_path, "base"), layer(tmp_path, "top"), tmp_path / "update.tar"
    write_update(archive, Image("docker.io/lab/b:2", [base, top]), present=[base])
    with tarfile.open(archive) as tar:
        names = tar.getnames()
        entry = json.loads(content(tar, "index.json"))["manifests"][0]
        manifest = json.loads(content(tar, "blobs/sha256/" + entry["digest"].removeprefix("sha256:")))
        blobs = [name for name in names if name.startswith("blobs/")]
        assert all(name.endswith(hashlib.sha256(content(tar, name)).hexdigest()) for name in blobs)
    assert f"blobs/sha256/{top.digest}" in names
    assert f"blobs/sha256/{base.digest}" not in names
    assert [part["digest"] for part in manifest["layers"]] == [f"sha256:{base.digest}", f"sha256:{top.digest}"]
    assert entry["annotations"]["io.containerd.image.name"] == "docker.io/lab/b:2"


def tree(target: Path, entries: dict[str, tuple[str, int]]) -> Path:
    """A tree's tar: name -> content and time; a name that ends in / is a directory."""
    with tarfile.open(target, "w") as tar:
        for name, (content, when) in entries.items():
            entry = tarfile.TarInfo(f"./{name}".rstrip("/"))
            entry.mtime, entry.size = when, len(content)
            entry.type = tarfile.DIRTYPE if name.endswith("/") else tarfile.REGTYPE
            tar.addfile(entry, io.BytesIO(content.encode()))
    return target


BELOW = {"etc/": ("", 1), "etc/a": ("a", 1), "etc/b": ("b", 1), "dev/": ("", 1), "dev/null": ("", 1)}


def test_a_layer_is_what_a_tree_has_gained(tmp_path: Path) -> None:
    gained = {"etc/": ("", 9), "etc/b": ("B", 9), "usr/": ("", 9), "usr/c": ("c", 1), "dev/null": ("", 9)}
    below, grown = tree(tmp_path / "below.tar", BELOW), tree(tmp_path / "grown.tar", {**BELOW, **gained})
    write_difference(tmp_path / "layer.tar", below, grown, leave_out=("dev",))
    with tarfile.open(tmp_path / "layer.tar") as tar:
        assert sorted(tar.getnames()) == ["./etc/b", "./usr", "./usr/c"]
        assert content(tar, "./etc/b") == b"B"


def test_a_layer_takes_nothing_away(tmp_path: Path) -> None:
    below = tree(tmp_path / "below.tar", BELOW)
    kept = {name: entry for name, entry in BELOW.items() if name not in ("etc/a", "dev/null")}
    less = tree(tmp_path / "less.tar", kept)
    with pytest.raises(LabError, match=r"a layer cannot take away etc/a\n"):
        write_difference(tmp_path / "layer.tar", below, less, leave_out=("dev",))


def test_versions_of_the_apps() -> None:
    by_name = {version.name: version for version in versions()}
    assert versions()[0] == Version("1.0")  # the whole one comes first: the others are updates of it
    assert by_name["1.1"].packages == ()
    assert by_name["2.0"].packages == ("python3-numpy",)
    assert dict(by_name["broken"].environment) == {"ROSOPS_APPS_BROKEN": "true"}
    with pytest.raises(LabError, match=r"apps version 3\.0: package is none of entrypoint, environment, packages"):
        Version.of("3.0", {"package": []})


def test_checksum_files_are_read() -> None:
    assert parse_sums("aa  k3s\nbb *k3s-images.tar\n\n") == {"k3s": "aa", "k3s-images.tar": "bb"}
