# SPDX-License-Identifier: GPL-3.0-or-later
"""What the experiment makes of an action client's and its servers' logs."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from update.goals import Goals, completion_ms, goals, longest_ms
from update.windows import Span

SPAN = Span(100.0, 110.0)


def goal(number: int, sent: float, outcome: str = "succeeded", took: float = 0.2) -> dict[str, Any]:
    return {"time": sent + took, "goal": f"g{number}", "sent": sent, "outcome": outcome, "completion_ms": took * 1e3}


def started(number: int, host: str) -> dict[str, Any]:
    return {"time": 1.0, "host": host, "event": "goal started", "goal": f"g{number}"}


CLIENT = [goal(number, 99.0 + number / 2) for number in range(24)]  # 99.0 to 110.5


def found(client: Sequence[dict[str, Any]], servers: Sequence[dict[str, Any]], span: Span = SPAN) -> Goals:
    account = goals(client, servers, span)
    assert account is not None
    return account


def test_all_goals_of_the_span_succeeded() -> None:
    account = found(CLIENT, [started(number, "a") for number in range(24)])
    assert (account.sent, account.aborted, account.lost, account.twice) == (20, 0, 0, 0)


def test_ends_that_nobody_asked_for() -> None:
    changed = {3: "aborted", 4: "rejected", 5: "lost", 0: "aborted", 6: "abandoned"}  # 0 was sent before the span
    client = [goal(n, 99.0 + n / 2, changed.get(n, "succeeded")) for n in range(24)]
    account = found(client, [])
    assert (account.sent, account.aborted, account.lost) == (19, 2, 1)


def test_a_goal_that_two_servers_started_was_executed_twice() -> None:
    servers = [started(7, "old"), started(7, "new"), started(8, "new"), started(0, "a"), started(0, "b")]
    account = found(CLIENT, servers)
    assert account.twice == 1


def test_a_client_that_fell_silent_waits_for_a_goal_that_is_lost() -> None:
    account = found(CLIENT, [], Span(100.0, 130.0))
    assert account.lost == 1


def test_no_log_is_no_success() -> None:
    assert goals([], [], SPAN) is None
    assert goals(CLIENT[10:], [], SPAN) is None
    assert completion_ms([], SPAN) is None


def test_completion_is_of_the_goals_sent_in_the_span() -> None:
    client = [goal(1, 99.9, took=9.0), goal(2, 100.0), goal(3, 109.0, took=4.0), goal(4, 105.0, "aborted", 0.1)]
    assert completion_ms(client, SPAN) == 2100.0
    assert longest_ms(client, SPAN) == 4000.0
