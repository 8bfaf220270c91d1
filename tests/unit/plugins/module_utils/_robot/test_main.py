# SPDX-License-Identifier: GPL-3.0-or-later
"""The files that the keeper was begun from, laid out as the kubelet does it."""

from __future__ import annotations

from pathlib import Path

from ansible_collections.rosops.fleet.plugins.module_utils._robot.main import code_of


def volume(directory: Path, version: str) -> None:
    """A ConfigMap's volume with this version of its files."""
    (directory / version).mkdir()
    (directory / version / "run.py").write_text(version)
    (directory / "..data_tmp").symlink_to(version)
    (directory / "..data_tmp").rename(directory / "..data")
    if not (directory / "run.py").exists():
        (directory / "run.py").symlink_to("..data/run.py")


def test_other_files_than_it_was_begun_from_are_noticed(tmp_path: Path) -> None:
    volume(tmp_path, "..2026_01_01")
    begun = code_of(str(tmp_path / "run.py"))
    volume(tmp_path, "..2026_01_02")
    assert code_of(str(tmp_path / "run.py")) != begun
    assert code_of(str(tmp_path / "by hand" / "run.py")) == ""  # no kubelet brings others there
