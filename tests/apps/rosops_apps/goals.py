# SPDX-License-Identifier: GPL-3.0-or-later
"""What became of goals, from the logs of the action's servers and client. No ROS."""

from __future__ import annotations

from collections import Counter
from typing import Any, Iterable

STARTED = "goal started"
ENDED = "goal ended"
ABANDONED = "abandoned"  # a goal's outcome where the client itself was asked to stop


def next_batch(previous: dict[str, Any] | None) -> int:
    """The one after the log's last; that one again if the client itself gave it up."""
    if previous is None:
        return 0
    return int(previous["batch"]) + (previous.get("outcome") != ABANDONED)


def executed_twice(servers: Iterable[dict[str, Any]]) -> list[str]:
    """The ids of goals that were started more than once, by one server or by two: from all lines of all servers."""
    starts = Counter(record["goal"] for record in servers if record.get("event") == STARTED)
    return sorted(goal for goal, times in starts.items() if times > 1)
