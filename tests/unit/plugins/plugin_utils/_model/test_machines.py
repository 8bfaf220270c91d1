# SPDX-License-Identifier: GPL-3.0-or-later
"""Versions of k3s in their order, and Pythons that are too old for ansible-core."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from ansible_collections.rosops.fleet.plugins.plugin_utils._model import machines
from ansible_collections.rosops.fleet.plugins.plugin_utils._model.machines import version

# each is newer than the one before it
IN_ORDER = ("v1.9.9+k3s1", "v1.34.2-rc1+k3s1", "v1.34.2-rc10+k3s1", "v1.34.2+k3s1", "v1.34.2+k3s10", "v1.35.0+k3s1")


def test_their_order() -> None:
    known = [found for found in map(version, IN_ORDER) if found]
    assert len(known) == len(IN_ORDER)
    for number, one in enumerate(known):
        assert [one.newer_than(other) for other in known] == [number > place for place in range(len(known))]


def test_builds_of_two_vendors_are_of_one_age() -> None:
    ours, theirs = version("v1.34.2+lab2"), version("v1.34.2+k3s1")
    assert ours
    assert theirs
    assert not (ours.newer_than(theirs) or theirs.newer_than(ours))


@pytest.mark.parametrize("text", ["", "1.34.2", "v1.34", "v1.34.2 ", "v1.34.2+k3s1-dirty"])
def test_a_text_that_is_no_version(text: str) -> None:
    assert version(text) is None


PAGE = Path(__file__).resolve().parents[5] / "docs" / "versions.md"
ROW = re.compile(r"^\| (2\.\d+) \|[^|]*\| (3\.\d+) or newer", re.MULTILINE)


def test_the_page_says_what_this_ansible_core_wants() -> None:
    rows = dict(ROW.findall(PAGE.read_text(encoding="utf-8")))
    oldest = ".".join(str(number) for number in machines.OLDEST)
    assert rows[machines.CORE.rpartition(".")[0]] == oldest


@pytest.mark.parametrize(
    ("text", "oldest", "words"),
    [
        ("(3, 8)\n", (3, 9), "has Python 3.8, and ansible-core 2.21.4 needs 3.9 or newer on hosts"),
        ("3.8", (3, 9), "has Python 3.8"),
        ("(2, 7)\n", (3, 8), "(2.19 takes 3.8, which Ubuntu 20.04 has)"),
        ("(3, 8)\n", (3, 8), ""),
        ("(3, 10)\n", (3, 9), ""),
        ("Welcome to robot1!\n", (3, 9), ""),
    ],
)
def test_a_python_that_is_too_old(
    monkeypatch: pytest.MonkeyPatch, text: str, oldest: tuple[int, int], words: str
) -> None:
    monkeypatch.setattr(machines, "OLDEST", oldest)
    monkeypatch.setattr(machines, "CORE", "2.21.4")
    found = machines.too_old(text)
    assert words in found
    assert bool(found) is bool(words)
