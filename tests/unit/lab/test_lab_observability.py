# SPDX-License-Identifier: GPL-3.0-or-later
"""The observability images: what the pins say, what they are made of, and the files in them."""

from __future__ import annotations

import os
import re
import tarfile
from pathlib import Path

import pytest
from lablib import go, observability
from lablib.artifacts import Cache, file_sha256
from lablib.errors import LabError
from lablib.observability import built, choose, part_with, recipe
from lablib.observability_build import _configuration, base_files, write_tree
from lablib.run import Job

PARTS = observability.parts()


# --- the pins ------------------------------------------------------------------------------------------------------


def test_other_modules_than_those_of_the_pins_are_not_built(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def build(job: Job) -> None:
        assert [*job.command][-3:] == ["-deps", "-test", "./..."]
        (tmp_path / "made" / "go.sum").write_text((tmp_path / "made" / "go.mod").read_text())

    monkeypatch.setattr(go, "build", build)
    monkeypatch.setattr(go, "go_command", lambda: "go")
    (tmp_path / "go.mod").write_text("module a")
    asked = (tmp_path, ["-test", "./..."])
    with pytest.raises(LabError, match=r"made of other Go modules: SHA-256 of go\.sum \w{64}, pinned f0bf") as told:
        go.complete(*asked, "f0bf", tmp_path / "made", tmp_path / "log")
    (found,) = re.findall(r"go\.sum (\w{64})", str(told.value))
    go.complete(*asked, found, tmp_path / "made", tmp_path / "log")


# --- which are built, and where ------------------------------------------------------------------------------------


def test_none_named_means_all() -> None:
    assert [part.name for part in choose([])] == list(PARTS)
    assert [part.name for part in choose(["vmagent", "loki"])] == ["vmagent", "loki"]
    with pytest.raises(LabError, match=r"grafana: no such part(.|\n)*prometheus, loki"):
        choose(["loki", "grafana"])


def test_an_unknown_program_is_an_error_that_names_the_known_ones() -> None:
    with pytest.raises(LabError, match=r"grafana: no such program(.|\n)*promtool"):
        part_with("grafana")


def test_only_what_is_built_is_offered(tmp_path: Path) -> None:
    cache = Cache(tmp_path)
    assert built(cache) == {}
    part = PARTS["loki"]
    archive = cache.path(recipe(part)) / part.archive
    archive.parent.mkdir(parents=True)
    assert built(cache) == {}
    archive.write_text("")
    assert built(cache) == {
        "observability_archives": [str(archive)],
        "observability_images": {"docker.io/grafana/loki:3.4.6": str(archive)},
    }
    assert archive.name == "loki-3.4.6.tar"


# --- an image's files ----------------------------------------------------------------------------------------------


def test_a_layer_says_nothing_of_when_and_where_it_was_made(tmp_path: Path) -> None:
    digests = set()
    for number in (1, 2):
        root = tmp_path / str(number) / "root"
        (root / "bin").mkdir(parents=True)
        program = root / "bin" / "program"
        program.write_text("x")
        program.chmod(0o755)
        base_files(root, ["/data", "/data/rules"], os.getuid())
        os.utime(program, (number, number))
        layer = write_tree(tmp_path / f"{number}.tar", root)
        assert layer.digest == file_sha256(layer.tar)
        digests.add(layer.digest)
    assert len(digests) == 1
    with tarfile.open(tmp_path / "1.tar") as tar:
        modes = {entry.name: entry.mode for entry in tar}
        owner = tar.getmember("data").uid
    assert list(modes) == ["bin", "bin/program", "data", "data/rules", "etc", "etc/group", "etc/passwd", "tmp"]
    assert (modes["tmp"], modes["bin/program"], owner) == (0o1777, 0o755, os.getuid())


def test_an_image_runs_as_the_real_ones_user_by_number() -> None:
    config = _configuration(PARTS["prometheus"])
    assert (config["User"], config["Entrypoint"]) == ("65534", ["/bin/prometheus"])
    assert config["WorkingDir"] == "/prometheus"
    assert _configuration(PARTS["node-exporter"])["WorkingDir"] == "/"
