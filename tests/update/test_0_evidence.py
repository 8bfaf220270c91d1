# SPDX-License-Identifier: GPL-3.0-or-later
"""The account itself: a loss that it did not see would make every other case worthless. Needs no lab."""

from __future__ import annotations

from typing import Any

import evidence
import pytest
from evidence import losses
from runs import Run


def stats(at: float, *ranges: list[int], node: str = "/a") -> dict[str, Any]:
    times = {"longest_gap_ms": 2.0, "oldest_age_ms": 5.0}
    return {"time": at, "node": node, "ranges": list(ranges), "duplicates": 0, **times}


def published(at: float, skipped: int, *ranges: list[int]) -> dict[str, Any]:
    return {"time": at, "node": "/p", "ranges": list(ranges), "skipped": skipped}


def goal(at: float, outcome: str, wrong: int = 0) -> dict[str, Any]:
    return {"time": at, "goal": f"g{at}", "outcome": outcome, "wrong": wrong, "completion_ms": 1500.0}


def request(at: float, latency: float = 10.0) -> dict[str, Any]:
    return {"time": at, "ok": True, "latency_ms": latency}


def started(at: float, name: str) -> dict[str, Any]:
    return {"time": at, "event": "goal started", "goal": name}


WHOLE = [stats(1, [1, 10]), stats(2, [8, 30], node="/b"), stats(2.5, [11, 12])]  # what two received together
HOLE = [stats(1, [1, 10]), stats(2, [14, 20])]
GAVE_UP = [published(1, 0, [1, 10]), published(2, 2, [13, 20])]
TWO = [published(1, 0, [1, 10]), {**published(2, 0, [13, 20]), "node": "/q"}]


@pytest.mark.parametrize(
    ("received", "sent", "since", "counts"),
    [
        (WHOLE, [], 0, (30, 0, 0)),
        (HOLE, [], 0, (17, 3, 0)),
        (HOLE, GAVE_UP, 0, (17, 1, 2)),  # what the sensor itself gave up is told apart
        (HOLE, TWO, 0, (17, 3, 0)),  # what two sensors left out between them is lost
        ([*HOLE, stats(3, [21, 30])], [], 1.5, (17, 0, 0)),  # what is outside of the time does not count
    ],
)
def test_messages(received: evidence.Records, sent: evidence.Records, since: float, counts: tuple[int, ...]) -> None:
    found = losses({evidence.STATS: received, evidence.PUBLISHED: sent}, since, 9)
    assert (found.messages, found.lost, found.given_up) == counts
    assert found.nothing is (found.lost == 0)


def test_failed_requests_and_goals() -> None:
    logs: evidence.Logs = {
        evidence.REQUESTS: [request(1), {**request(2), "ok": False, "error": "gone"}],
        evidence.GOALS: [goal(1, "succeeded"), goal(2, "lost"), goal(3, "abandoned"), goal(4, "succeeded", wrong=1)],
    }
    found = losses(logs, 0, 9)
    assert (found.requests, found.failed) == (2, ["gone after 10 ms, asked 2.0 s in"])
    assert (found.goals, len(found.unsuccessful), found.abandoned) == (4, 2, 1)
    assert not found.nothing


def test_a_goal_that_was_started_before_and_again_now_is_executed_twice() -> None:
    logs = {evidence.SERVER + "old.jsonl": [started(1, "g")], evidence.SERVER + "new.jsonl": [started(5, "g")]}
    assert losses(logs, 4, 9).twice == ["goal g executed twice"]
    assert losses(logs, 6, 9).twice == []


def test_torn_lines_are_passed_over() -> None:
    assert evidence.parse('me":1}\n{"time": 2}\n\n{"ti') == [{"time": 2}]


def test_a_run_that_ended_otherwise_is_told() -> None:
    host = {"host": "robot1", "groups": ["robots"], "outcome": "rolled-back", "reason": "rate"}
    run = Run("update", 2, "", {"hosts": [host]}, 0, 9)
    assert run.must(2) is run.must(2, robot1="rolled-back") is run
    for status, outcomes in ((0, {}), (2, {"robot1": "updated"}), (2, {"robot1": "rolled-back", "robot2": "updated"})):
        with pytest.raises(
            AssertionError, match=r"wanted .*: update: exit status 2 after 9 s\nrobot1: rolled-back: rate"
        ):
            run.must(status, **outcomes)
