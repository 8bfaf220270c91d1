# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Which Python a host needs, by the ansible-core that is here."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from ansible_collections.rosops.fleet.plugins.plugin_utils._model import pythons

PAGE = Path(__file__).resolve().parents[5] / "docs" / "versions.md"
ROW = re.compile(r"^\| (2\.\d+) \|[^|]*\| (3\.\d+) or newer", re.MULTILINE)


def test_the_page_says_what_this_ansible_core_wants() -> None:
    rows = dict(ROW.findall(PAGE.read_text(encoding="utf-8")))
    oldest = ".".join(str(number) for number in pythons.OLDEST)
    assert rows[pythons.CORE.rpartition(".")[0]] == oldest


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
    monkeypatch.setattr(pythons, "OLDEST", oldest)
    monkeypatch.setattr(pythons, "CORE", "2.21.4")
    found = pythons.too_old(text)
    assert words in found
    assert bool(found) is bool(words)
