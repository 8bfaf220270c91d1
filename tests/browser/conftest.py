# SPDX-License-Identifier: GPL-3.0-or-later
"""Tests in a headless browser: on machines that have one."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

CHECKOUT = Path(__file__).resolve().parents[2]
TREE = CHECKOUT / ".ansible" / "collections"
if (TREE / "ansible_collections" / "rosops" / "fleet").exists():
    sys.path.insert(0, str(TREE))
sys.path.insert(0, str(Path(__file__).resolve().parent))

import chromium  # noqa: E402 - beside this file, whose directory the line above names


@pytest.fixture(scope="session")
def browser(tmp_path_factory: pytest.TempPathFactory) -> Iterator[chromium.Chromium]:
    program = chromium.found()
    if program is None:
        pytest.skip(chromium.HOW_TO_INSTALL)
    made = chromium.Chromium(program, tmp_path_factory.mktemp("chromium") / "profile")
    try:
        yield made
    finally:
        made.close()
