# SPDX-License-Identifier: GPL-3.0-or-later
"""Times of targets are those that a run wrote."""

from __future__ import annotations

import pytest
from times import CHECKOUT, PAGE, kept, listed, merged, page, words


@pytest.mark.parametrize(("seconds", "said"), [(0, "1 s"), (89, "89 s"), (374, "6 min"), (5400, "1.5 h")])
def test_a_time_as_a_reader_wants_it(seconds: int, said: str) -> None:
    assert words(seconds) == said


def test_a_run_adds_to_what_is_kept_and_a_red_one_has_no_time_of_the_whole() -> None:
    run = {"stages": {"lint": 60}, "whole": 1200}
    assert merged({"lint": 50, "docs": 20}, run, "test") == {"docs": 20, "lint": 60, "test": 1200}
    assert merged({"test": 1200}, {"stages": {}, "whole": None}, "test") == {"test": 1200}


def test_the_page_has_the_kept_times() -> None:
    text = PAGE.read_text("utf-8")
    assert page(text, kept()) == text


def test_no_target_says_a_time_of_its_own() -> None:
    said = [line for line in listed((CHECKOUT / "Makefile").read_text("utf-8"), {}).splitlines() if " minutes" in line]
    assert said == []
