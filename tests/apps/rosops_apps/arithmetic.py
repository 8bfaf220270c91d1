# SPDX-License-Identifier: GPL-3.0-or-later
"""What the service computes, and what its client asks. No ROS."""

from __future__ import annotations

import operator
from typing import Callable

OPERATIONS: dict[str, Callable[[int, int], int]] = {"add": operator.add, "subtract": operator.sub}


def wrap(number: int) -> int:
    """As a signed 64-bit integer, which is what the answer has room for."""
    return (number + 2**63) % 2**64 - 2**63


def operands(request: int) -> tuple[int, int]:
    """Two numbers that differ from request to request; the second is never 0, so sum and difference differ."""
    return request, request % 97 + 1


def operation_of(a: int, b: int, result: int) -> str:
    """Which operation gives this result, or `wrong`."""
    return next((name for name, function in OPERATIONS.items() if wrap(function(a, b)) == result), "wrong")
