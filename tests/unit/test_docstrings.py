# SPDX-License-Identifier: GPL-3.0-or-later
"""What the examples in docstrings of plugins show is what they give."""

from __future__ import annotations

import doctest
import importlib
from pathlib import Path

import pytest

COLLECTION = Path(__file__).parents[2]
WITH_EXAMPLES = sorted(
    ".".join(path.relative_to(COLLECTION).with_suffix("").parts)
    for path in COLLECTION.glob("plugins/**/*.py")
    if ">>> " in path.read_text("utf-8")
)


@pytest.mark.parametrize("module", WITH_EXAMPLES)
def test_examples_give_what_they_show(module: str) -> None:
    ran = doctest.testmod(importlib.import_module(f"ansible_collections.rosops.fleet.{module}"))
    assert (ran.failed, ran.attempted > 0) == (0, True)
