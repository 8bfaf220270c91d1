# SPDX-License-Identifier: GPL-3.0-or-later
"""A service client's log -> requests failed and how long they took. Pure."""

from __future__ import annotations

from dataclasses import dataclass

from .jsonlog import Lines
from .numbers import percentile
from .windows import Span

SHARES = (50, 95, 99)


@dataclass(frozen=True)
class Requests:
    """What became of the requests of a span."""

    sent: int
    failed: int
    wrong: int  # answered, but neither with the sum nor with the difference
    operations: tuple[str, ...]  # in the order in which they were first seen


def requests(lines: Lines, span: Span) -> Requests | None:
    """The account of the requests that began in the span; None where the log does not cover it."""
    made = [line for line in lines if "request" in line]
    if not made or min(line["time"] for line in made) > span.start or max(line["time"] for line in made) < span.end - 1:
        return None
    within = [line for line in made if span.holds(line["time"])]
    return Requests(
        sent=len(within),
        failed=sum(not line.get("ok") for line in within),
        wrong=sum(line.get("operation") == "wrong" for line in within),
        operations=tuple(dict.fromkeys(str(line["operation"]) for line in within if "operation" in line)),
    )


def latency_ms(lines: Lines, span: Span) -> dict[int, float | None]:
    """Percentiles of the answered requests that began in the span, in ms."""
    times = [
        float(line["latency_ms"]) for line in lines if "request" in line and line.get("ok") and span.holds(line["time"])
    ]
    return {share: percentile(times, share) for share in SHARES}
