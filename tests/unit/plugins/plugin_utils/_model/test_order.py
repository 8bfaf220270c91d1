# SPDX-License-Identifier: GPL-3.0-or-later
"""Orders that needs ask for, and circles that leave none."""

from __future__ import annotations

import pytest
from ansible_collections.rosops.fleet.plugins.plugin_utils._model.order import circle, in_order


@pytest.mark.parametrize(
    ("needs", "order"),
    [
        ({}, []),
        ({"c": [], "a": [], "b": []}, ["c", "a", "b"]),
        ({"a": ["c"], "b": [], "c": []}, ["b", "c", "a"]),
        ({"a": ["b", "c"], "b": ["c"], "c": [], "d": []}, ["c", "b", "a", "d"]),
    ],
)
def test_after_what_it_needs_and_else_as_given(needs: dict[str, list[str]], order: list[str]) -> None:
    assert circle(needs) == []
    assert in_order(needs) == order


@pytest.mark.parametrize(
    ("needs", "members"),
    [
        ({"a": ["a"]}, ["a"]),
        ({"x": [], "b": ["c"], "c": ["a"], "a": ["b"]}, ["b", "c", "a"]),
        ({"x": ["b"], "b": ["c"], "c": ["b"]}, ["b", "c"]),
    ],
)
def test_a_circle_is_told_from_its_first_on(needs: dict[str, list[str]], members: list[str]) -> None:
    assert circle(needs) == members
