# SPDX-License-Identifier: GPL-3.0-or-later
"""A host leaves the run for its outcome: who was off is unreachable, others fail, and check mode ends well."""

from __future__ import annotations

import pytest
from ansible_collections.rosops.fleet.plugins.action import _leave
from ansible_collections.rosops.fleet.tests.unit.plugins.action.actions import run


@pytest.mark.parametrize(("word", "left", "in_check_mode"), [
    ("updated", "", ""), ("unchanged", "", ""), ("deferred-offline", "unreachable", "unreachable"),
    ("deferred-busy", "failed", ""), ("rolled-back", "failed", ""), ("failed", "failed", ""),
])  # fmt: skip
def test_by_the_word(word: str, left: str, in_check_mode: str) -> None:
    args = {"outcome": {"outcome": word, "reason": "why", "steps": []}}
    for found, way in (
        (run(_leave, args, {}), left),
        (run(_leave, args, {}, check_mode=True), in_check_mode),
        (run(_leave, {**args, "check": True}, {}, check_mode=True), left),
    ):
        assert {key for key in ("unreachable", "failed") if found.get(key)} == ({way} if way else set())
        assert not way or "why" in found["msg"]


def test_without_an_outcome() -> None:
    assert run(_leave, {"outcome": {}}, {}) == {"changed": False}
