# SPDX-License-Identifier: GPL-3.0-or-later
"""What the experiment makes of an action client's and its servers' logs."""

from __future__ import annotations

from typing import Any

import pytest
from update.goals import completion_ms, goals, longest_ms
from update.windows import Span

SPAN = Span(100.0, 110.0)


def goal(number: int, sent: float, outcome: str = "succeeded", took: float = 0.2) -> dict[str, Any]:
    return {"time": sent + took, "goal": f"g{number}", "sent": sent, "outcome": outcome, "completion_ms": took * 1e3}


def started(number: int, host: str) -> dict[str, Any]:
    return {"time": 1.0, "host": host, "event": "goal started", "goal": f"g{number}"}


CLIENT = [goal(number, 99.0 + number / 2) for number in range(24)]  # 99.0 to 110.5


OUTCOMES = {3: "aborted", 4: "rejected", 5: "lost", 0: "aborted", 6: "abandoned"}  # 0 was sent before the span
ENDED = [goal(number, 99.0 + number / 2, OUTCOMES.get(number, "succeeded")) for number in range(24)]
TWICE = [started(7, "old"), started(7, "new"), started(8, "new"), started(0, "a"), started(0, "b")]


@pytest.mark.parametrize(
    ("client", "servers", "span", "counts"),
    [
        (CLIENT, [started(number, "a") for number in range(24)], SPAN, (20, 0, 0, 0)),
        (ENDED, [], SPAN, (19, 2, 1, 0)),  # what a client abandoned is none of ours
        (CLIENT, TWICE, SPAN, (20, 0, 0, 1)),
        (CLIENT, [], Span(100.0, 130.0), (23, 0, 1, 0)),  # a client that fell silent waits for a goal that is lost
    ],
)
def test_what_became_of_the_goals_of_a_span(client: Any, servers: Any, span: Span, counts: tuple[int, ...]) -> None:
    found = goals(client, servers, span)
    assert found is not None
    assert (found.sent, found.aborted, found.lost, found.twice) == counts


def test_no_log_is_no_success() -> None:
    assert goals([], [], SPAN) is None
    assert goals(CLIENT[10:], [], SPAN) is None
    assert completion_ms([], SPAN) is None


def test_completion_is_of_the_goals_sent_in_the_span() -> None:
    client = [goal(1, 99.9, took=9.0), goal(2, 100.0), goal(3, 109.0, took=4.0), goal(4, 105.0, "aborted", 0.1)]
    assert completion_ms(client, SPAN) == 2100.0
    assert longest_ms(client, SPAN) == 4000.0
