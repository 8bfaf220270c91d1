# SPDX-License-Identifier: GPL-3.0-or-later
"""An action client's and its servers' logs -> what became of the goals, and how long they took. Pure.

The client writes a line when a goal is over, with when it was `sent`; every server when it starts and ends one.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass

from .jsonlog import Lines
from .paths import apps_library
from .windows import Span

apps_library()

from rosops_apps.goals import executed_twice  # noqa: E402 - found through the line above

SUCCEEDED, LOST, ABANDONED = "succeeded", "lost", "abandoned"
SILENT_SECONDS = 10.0  # the client sends a goal twice a second: silent for so long, it waits for one in vain


@dataclass(frozen=True)
class Goals:
    """What became of the goals of a span."""

    sent: int
    aborted: int  # ended without success though nobody asked for that: aborted, rejected, preempted, recalled
    lost: int  # the client's library lost it, or it never came to an end
    twice: int  # started more than once, by one server or by two


def goals(client: Lines, servers: Lines, span: Span) -> Goals | None:
    """The account of the goals that were sent in the span; None where the log does not cover it."""
    ended = [line for line in client if "outcome" in line and line["outcome"] != ABANDONED]
    if not ended or min(line["sent"] for line in ended) > span.start:
        return None
    within = [line for line in ended if span.holds(line["sent"])]
    outcomes = Counter(line["outcome"] for line in within)
    waiting = 1 if span.end - max(line["time"] for line in ended) > SILENT_SECONDS else 0
    own = {line["goal"] for line in within}
    return Goals(
        sent=len(within) + waiting,
        aborted=len(within) - outcomes[SUCCEEDED] - outcomes[LOST],
        lost=outcomes[LOST] + waiting,
        twice=len(own & set(executed_twice(servers))),
    )


def _times(client: Lines, span: Span) -> list[float]:
    return [
        float(line["completion_ms"])
        for line in client
        if line.get("outcome") == SUCCEEDED and span.holds(line["sent"]) and line.get("completion_ms") is not None
    ]


def completion_ms(client: Lines, span: Span) -> float | None:
    """Mean time from sending to result of the goals that were sent in the span and succeeded."""
    times = _times(client, span)
    return sum(times) / len(times) if times else None


def longest_ms(client: Lines, span: Span) -> float | None:
    """The longest of them."""
    return max(_times(client, span), default=None)
