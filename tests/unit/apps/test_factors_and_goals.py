# SPDX-License-Identifier: GPL-3.0-or-later
"""Batches, their factors, and what the logs of an action say."""

from __future__ import annotations

from typing import Any

import pytest
from rosops_apps import goals
from rosops_apps.factors import batch_numbers, count_right, prime_factors


def test_batches_go_round() -> None:
    assert batch_numbers(0) == list(range(1000, 1010))
    assert batch_numbers(899) == list(range(9990, 10000))
    assert batch_numbers(900) == batch_numbers(0)
    assert sorted(number for batch in range(900) for number in batch_numbers(batch)) == list(range(1000, 10000))


@pytest.mark.parametrize(
    ("number", "factors"),
    [(1, []), (2, [2]), (1000, [2, 2, 2, 5, 5, 5]), (9409, [97, 97]), (9973, [9973]), (9998, [2, 4999])],
)
def test_factors(number: int, factors: list[int]) -> None:
    assert list(prime_factors(number)) == factors


@pytest.mark.parametrize(
    ("answers", "counted"),
    [
        ([(12, [2, 2, 3]), (13, [13])], (2, 0)),
        ([(12, [4, 3]), (13, [13])], (1, 1)),  # 4 is no prime
        ([(12, [2, 3]), (13, [])], (0, 2)),
        ([(13, [13]), (13, [13])], (1, 1)),  # twice
        ([(14, [2, 7])], (0, 1)),  # nobody asked
        ([], (0, 0)),
    ],
)
def test_answers_are_checked(answers: list[tuple[int, list[int]]], counted: tuple[int, int]) -> None:
    assert count_right([12, 13], answers) == counted


def started(goal: str, node: str) -> dict[str, Any]:
    return {"event": goals.STARTED, "goal": goal, "node": node}


def test_goals_that_two_servers_executed() -> None:
    records = [started("a", "/old"), {"event": goals.ENDED, "goal": "a"}, started("b", "/old"), started("b", "/new")]
    assert goals.executed_twice(records) == ["b"]
    assert goals.executed_twice([]) == []


@pytest.mark.parametrize(
    ("previous", "batch"),
    [
        (None, 0),
        ({"batch": 4, "outcome": "succeeded"}, 5),
        ({"batch": 4, "outcome": "lost"}, 5),
        ({"batch": 4, "outcome": goals.ABANDONED}, 4),
    ],
)
def test_a_client_goes_on_where_it_was(previous: dict[str, Any] | None, batch: int) -> None:
    assert goals.next_batch(previous) == batch
