# SPDX-License-Identifier: GPL-3.0-or-later
"""Tests that `make test` does not run can be begun at least: what they import is there."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

TESTS = Path(__file__).resolve().parents[2]


def test_every_case_is_found() -> None:
    words = [sys.executable, "-m", "pytest", "--collect-only", "-q", "-p", "no:cacheprovider", "tests/observability"]
    done = subprocess.run(words, cwd=TESTS.parent, capture_output=True, text=True, check=False, timeout=60)  # noqa: S603 - our own tests
    assert done.returncode == 0, done.stdout + done.stderr
