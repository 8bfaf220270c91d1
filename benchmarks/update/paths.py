# SPDX-License-Identifier: GPL-3.0-or-later
"""Where things are in the checkout."""

from __future__ import annotations

import sys

from lab_environment import CHECKOUT

RESULTS = CHECKOUT / "benchmarks" / "results"


def apps_library() -> None:
    """Let the applications' own package be found: what counts as a hole is said there and only there."""
    path = str(CHECKOUT / "tests" / "apps")
    if path not in sys.path:
        sys.path.insert(0, path)
