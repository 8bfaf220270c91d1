# SPDX-License-Identifier: GPL-3.0-or-later
"""Names and texts of others on their way to a terminal."""

from __future__ import annotations

import pytest
from ansible_collections.rosops.fleet.plugins.module_utils._common.errors import RosError, printable


@pytest.mark.parametrize(
    ("text", "shown"),
    [
        ("/talker\x1b[2J", "/talker\\x1b[2J"),
        ("/talker\x9b31m", "/talker\\x9b31m"),  # CSI in one character
        ("a\rb\x07\x7f", "a\\rb\\x07\\x7f"),
        ("/abc\u202ecba", "/abc\\u202ecba"),
        ("Grüße\n\t-> 20 °C", "Grüße\n\t-> 20 °C"),
    ],
)
def test_what_moves_the_cursor_is_shown_and_not_done(text: str, shown: str) -> None:
    assert printable(text) == shown
    assert str(RosError(f"node {text} does not answer")) == f"node {shown} does not answer"
