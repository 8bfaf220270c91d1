# SPDX-License-Identifier: GPL-3.0-or-later
"""The cache: keys by content, whole artifacts or none, old ones removed."""

from __future__ import annotations

import os
from pathlib import Path

import pytest
from lablib.artifacts import KEEP, Cache, Recipe


def recipe(root: Path, *, version: str = "1") -> Recipe:
    return Recipe("thing", "a thing", {"version": version}, (root,))


@pytest.fixture
def sources(tmp_path: Path) -> Path:
    root = tmp_path / "sources"
    (root / "sub").mkdir(parents=True)
    (root / "one.txt").write_text("1")
    (root / "sub" / "two.txt").write_text("2")
    return root


def fill(directory: Path, _log: Path) -> None:
    (directory / "result").write_text("done")


def fail(directory: Path, _log: Path) -> None:
    (directory / "half").write_text("")
    raise KeyboardInterrupt


def test_the_key_follows_values_contents_names_and_modes(sources: Path) -> None:
    seen = {recipe(sources).key(), recipe(sources, version="2").key()}
    (sources / "one.txt").write_text("changed")
    seen.add(recipe(sources).key())
    (sources / "one.txt").rename(sources / "uno.txt")
    seen.add(recipe(sources).key())
    (sources / "uno.txt").chmod(0o755)
    seen.add(recipe(sources).key())
    (sources / "sub" / "three.txt").write_text("")
    seen.add(recipe(sources).key())
    assert len(seen) == 6


def test_the_key_does_not_follow_time_place_or_byte_code(sources: Path, tmp_path: Path) -> None:
    key = recipe(sources).key()
    os.utime(sources / "one.txt", (0, 0))
    (sources / "__pycache__").mkdir()
    (sources / "__pycache__" / "x.pyc").write_text("")
    moved = tmp_path / "elsewhere" / "sources"
    moved.parent.mkdir()
    sources.rename(moved)
    assert recipe(moved).key() == key


def test_it_is_built_once(sources: Path, tmp_path: Path) -> None:
    cache = Cache(tmp_path / "cache")
    first = cache.ensure(recipe(sources), fill)
    assert cache.ensure(recipe(sources), fail) == first
    assert (first / "result").read_text() == "done"


def test_a_failed_build_leaves_nothing(sources: Path, tmp_path: Path) -> None:
    cache = Cache(tmp_path / "cache")
    with pytest.raises(KeyboardInterrupt):
        cache.ensure(recipe(sources), fail)
    assert list(cache.artifacts.iterdir()) == []
    assert (cache.ensure(recipe(sources), fill) / "result").exists()


def test_what_a_killed_build_left_is_removed_a_running_ones_is_not(sources: Path, tmp_path: Path) -> None:
    cache = Cache(tmp_path / "cache")
    cache.artifacts.mkdir(parents=True)
    dead = cache.artifacts / ".part-thing-0123456789abcdef-999999999"
    alive = cache.artifacts / f".part-thing-0123456789abcdef-{os.getpid()}"
    dead.mkdir()
    alive.mkdir()
    cache.ensure(recipe(sources), fill)
    assert not dead.exists()
    assert alive.exists()


def test_old_artifacts_of_the_kind_are_removed_other_kinds_are_not(sources: Path, tmp_path: Path) -> None:
    cache = Cache(tmp_path / "cache")
    other = cache.ensure(Recipe("thing-next", "another"), fill)
    made = []
    for number in range(KEEP + 2):
        path = cache.ensure(recipe(sources, version=str(number)), fill)
        os.utime(path, (number, number))
        made.append(path)
    assert [path.exists() for path in made] == [False, False, True, True]
    assert other.exists()
