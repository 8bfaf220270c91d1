# SPDX-License-Identifier: GPL-3.0-or-later
from __future__ import annotations

from typing import Any

import pytest
from ansible_collections.rosops.fleet.plugins.plugin_utils._report.text import rate_words, size_words, table, words


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (None, "-"),
        ("", "-"),
        ("a\n b", "a b"),
        (0, "0"),
        (True, "yes"),
        (False, "no"),
        (499.96, "500.0"),
        (["a", "b"], "a, b"),
        ([], "-"),
        ({"a": 1, "b": True}, "a=1, b=yes"),
        ("/a\x1b[31m\u009b2J\nforged line", "/a\\x1b[31m\\x9b2J forged line"),
        (["/\x9b1m"], "/\\x9b1m"),
    ],
)
def test_cells(value: Any, text: str) -> None:
    assert words(value) == text


@pytest.mark.parametrize(
    ("rate", "said"),
    [(499.83, "500 Hz"), (99.95, "100 Hz"), (99.94, "99.9 Hz"), (9.995, "10.0 Hz"), (0.999, "0.999 Hz"), (0, "0 Hz")],
)
def test_rates(rate: float, said: str) -> None:
    assert rate_words(rate) == said


@pytest.mark.parametrize(
    ("width", "last"),
    [
        (20, "aaaa..  bbbb..  ccccc"),  # no column is cut below 6
        (22, "aaaa..  bbbbb..  ccccc"),
        (40, "aaaaaaaaaaaaa..  bbbbbbbbbbbbbb..  ccccc"),
        (80, "a" * 30 + "  " + "b" * 39 + "..  ccccc"),
    ],
)
def test_it_fits_and_the_widest_column_is_cut_first(width: int, last: str) -> None:
    rows = [["a" * size, "b" * 3 * size, "c" * 5] for size in (1, 9, 30)]
    assert table(["one", "two", "three"], rows, width)[-1] == last


@pytest.mark.parametrize(
    ("count", "said"), [(None, ""), (0, "0 B"), (1023, "1023 B"), (1536, "1.5 KiB"), (3 * 2**40, "3072.0 GiB")]
)
def test_sizes(count: int | None, said: str) -> None:
    assert size_words(count) == said
