# SPDX-License-Identifier: GPL-3.0-or-later
"""What claims hold."""

from __future__ import annotations

import os
from contextlib import AbstractContextManager, nullcontext
from pathlib import Path

import pytest
from ansible_collections.rosops.fleet.plugins.module_utils._exporter.claims import BLOCK, look, used


def blocks(path: Path) -> int:
    return path.lstat().st_blocks * BLOCK


def test_what_claims_hold(tmp_path: Path) -> None:
    mine = tmp_path / "pvc-1_robot-r1_data-pvc"
    (mine / "deep" / "er").mkdir(parents=True)
    one, other = mine / "a", mine / "deep" / "er" / "b"
    one.write_bytes(b"x" * 50_000)
    other.write_bytes(b"y" * 9_000)
    (mine / "same").hardlink_to(one)
    again = tmp_path / "pvc-6_robot-r1_data-pvc" / "c"  # of an earlier claim of this name
    again.parent.mkdir()
    again.write_bytes(b"z" * 9_000)
    (mine / "out").symlink_to("/etc")
    (mine / "loop").symlink_to(mine)
    for name in ("pvc-2_robot-r2_data-pvc", "pvc-3_robot-r1", "lost+found", "x_robot-r1_y"):
        (tmp_path / name).mkdir()
    (tmp_path / "pvc-4_robot-r1_file").write_text("no directory")
    every = [one, other, again, mine / "deep", mine / "deep" / "er", mine / "out", mine / "loop"]
    (tmp_path / "pvc-5_robot-r1_with_more").mkdir()  # the name is the claim's own
    found = look(str(tmp_path), "robot-r1")
    assert found == {"data-pvc": sum(map(blocks, every)), "with_more": 0}
    assert look(str(tmp_path / "none"), "robot-r1") == {}


def test_a_file_that_goes_meanwhile_takes_no_other_along(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("a", "b"):
        (tmp_path / name).write_bytes(b"x" * 9_000)
    left, scandir = blocks(tmp_path / "b"), os.scandir

    def goes(path: str) -> AbstractContextManager[list[os.DirEntry[str]]]:
        entries = sorted(scandir(path), key=lambda entry: entry.name)
        (tmp_path / "a").unlink()
        return nullcontext(entries)

    monkeypatch.setattr(os, "scandir", goes)
    assert used(str(tmp_path)) == left


@pytest.mark.skipif(os.getuid() == 0, reason="root may read everything")
def test_what_may_not_be_read_is_left_out(tmp_path: Path) -> None:
    (tmp_path / "closed").mkdir(mode=0)
    assert used(str(tmp_path)) >= 0
