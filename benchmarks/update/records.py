# SPDX-License-Identifier: GPL-3.0-or-later
"""One record per trial, with exactly these keys. What does not apply or could not be measured is null, never 0."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

KEYS = (
    "app",
    "update",
    "arm",
    "stress",
    "trial",
    "sent",
    "lost",
    "duplicates",
    "ran_back",
    "furthest_back_ms",
    "failed",
    "aborted",
    "twice",
    "gap_ms",
    "gap_control_ms",
    "oldest_ms",
    "oldest_run_ms",
    "oldest_control_ms",
    "p50_before_ms",
    "p95_before_ms",
    "p99_before_ms",
    "p95_step_ms",
    "p50_run_ms",
    "p95_run_ms",
    "p99_run_ms",
    "completion_before_ms",
    "completion_during_ms",
    "completion_longest_ms",
    "step_s",
    "busy_wait_s",
    "run_s",
)
NAMED = KEYS[:5]

Record = dict[str, Any]


def record(values: Mapping[str, Any]) -> Record:
    """A whole record out of the values that are known."""
    if unknown := set(values) - set(KEYS):
        raise ValueError(f"a record has no {', '.join(sorted(unknown))}")
    if missing := [key for key in NAMED if values.get(key) is None]:
        raise ValueError(f"a record without {', '.join(missing)}")
    return {key: _rounded(values.get(key)) for key in KEYS}


def _rounded(value: Any) -> Any:
    return round(value, 3) if isinstance(value, float) else value
