# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Waiting with a deadline that reports the last thing seen."""

from __future__ import annotations

import time
from collections.abc import Callable

from .errors import LabError


def wait_for(
    what: str, look: Callable[[], tuple[bool, str]], *, seconds: float, interval: float = 0.25, todo: str = ""
) -> str:
    """Looks until `look` says (True, observation); a time-out is an error that carries the last observation."""
    deadline = time.monotonic() + seconds
    while True:
        done, observed = look()
        if done:
            return observed
        if time.monotonic() >= deadline:
            raise LabError(f"{what}: not within {seconds:g} s", where=f"last seen: {observed}", todo=todo)
        time.sleep(interval)
