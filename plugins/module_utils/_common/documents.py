# SPDX-License-Identifier: GPL-3.0-or-later
"""Mappings that others give a form, of any content. What is ours in them gets a type where it comes in."""

from __future__ import annotations

import json
from typing import Any, Dict, Mapping

Arguments = Mapping[str, Any]  # what a module or an action is given
Result = Dict[str, Any]  # what a module or an action answers
Variables = Mapping[str, Any]  # of a host, a role or a task
Document = Mapping[str, Any]  # JSON of another kind, as it is read, and fields of ROS messages
Data = Dict[str, Any]  # the same, as it is made
DIGITS = 20  # of the least whole number of 64 bits, with its sign


def json_of(text: str | bytes) -> Any:
    """What somebody else wrote as JSON; ValueError where that is none, or is made to do harm.

    The library reads numbers of any length, which takes the square of it before Python 3.11, and breaks off with other
    errors at lists within lists, and at what is no text.
    """
    try:
        return json.loads(text, parse_int=_whole)
    except (RecursionError, TypeError) as error:
        raise ValueError(f"it cannot be read: {error}") from None


def _whole(text: str) -> int:
    if len(text) > DIGITS:
        raise ValueError(f"a number has more than {DIGITS} digits")
    return int(text)
