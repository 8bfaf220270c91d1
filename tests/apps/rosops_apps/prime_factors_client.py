# SPDX-License-Identifier: GPL-3.0-or-later
"""Sends the action `prime_factors` batch after batch of ten numbers; a line for each in LOG_DIR/prime-factors.jsonl."""

from __future__ import annotations

import threading
import time
from pathlib import Path
from typing import Any

import actionlib  # type: ignore[import-not-found]
import rospy  # type: ignore[import-not-found]
from actionlib_msgs.msg import GoalStatus  # type: ignore[import-not-found]

from . import goals, node, settings
from .factors import batch_numbers, count_right
from .jsonl import JsonLinesLog, last_record
from .metrics import Metrics

LOG_NAME = "prime-factors.jsonl"
ACTION = "prime_factors"
LOOK_SECONDS = 0.1


class Goal:
    """One goal that was sent, and what came back."""

    def __init__(self, client: Any, message: Any) -> None:
        self._client = client
        self._ended = threading.Event()
        self._feedback = 0
        self._ended_at = 0.0
        self._state = GoalStatus.LOST
        self._result: Any = None
        self._sent = time.time()
        self._sent_at = time.monotonic()
        self._message = message
        client.send_goal(message, done_cb=self._done, feedback_cb=self._count)
        self._id = client.gh.comm_state_machine.action_goal.goal_id.id

    def _count(self, _feedback: Any) -> None:
        self._feedback += 1

    def _done(self, state: int, result: Any) -> None:
        self._ended_at = time.monotonic()
        self._state, self._result = state, result
        self._ended.set()

    def wait(self, timeout: float) -> str:
        """The outcome. `lost` is also a goal without a result after `timeout` seconds."""
        deadline = self._sent_at + timeout
        while not self._ended.wait(LOOK_SECONDS):
            if node.stopping():
                self._client.cancel_goal()
                return goals.ABANDONED
            if time.monotonic() >= deadline:
                self._client.stop_tracking_goal()
                return "lost"
        return str(GoalStatus.to_string(self._state)).lower()

    def report(self, outcome: str) -> dict[str, Any]:
        """The goal's line in the log."""
        answers = [(entry.number, entry.factors) for entry in self._result.factors] if self._result else []
        right, wrong = count_right(self._message.numbers, answers)
        ended = self._ended_at or time.monotonic()
        return {
            "time": round(time.time(), 3),
            "node": rospy.get_name(),
            "batch": self._message.batch,
            "goal": self._id,
            "sent": round(self._sent, 3),
            "outcome": outcome,
            "results": len(answers),
            "right": right,
            "wrong": wrong,
            "server": self._result.server if self._result else None,
            "completion_ms": round((ended - self._sent_at) * 1e3, 3),
            "feedback": self._feedback,
        }


def read_settings() -> tuple[Path, float, float]:
    """Where the log goes, the seconds between batches, and those that a goal may take."""
    between, timeout = settings.not_negative("BATCH_PAUSE", 1.0), settings.positive("GOAL_TIMEOUT", 120.0)
    return settings.required_log_dir(), between, timeout


def send_batches(directory: Path, between: float, timeout: float) -> None:
    """Send until asked to stop."""
    from .msg import PrimeFactorsAction, PrimeFactorsGoal  # type: ignore[import-not-found] # noqa: PLC0415

    batch = goals.next_batch(last_record(directory / LOG_NAME, key="batch"))
    log = JsonLinesLog(directory / LOG_NAME)
    metrics = node.measured("action", ACTION)
    client = actionlib.SimpleActionClient(ACTION, PrimeFactorsAction)
    # Once, as most clients do: a goal that is sent while no server is there is not repeated.
    client.wait_for_server()
    is_ready = False
    while not node.stopping():
        goal = Goal(client, PrimeFactorsGoal(batch=batch, numbers=batch_numbers(batch)))
        record = goal.report(goal.wait(timeout))
        count(record, metrics)
        log.write(record)
        log.sync()
        batch += 1
        if not is_ready and record["right"] == len(batch_numbers(batch)):
            is_ready = True
            node.ready()
        pause(between)
    log.close()


def count(record: dict[str, Any], metrics: Metrics) -> None:
    """One goal that is over. One that this client gave up itself has not failed."""
    if record["outcome"] == "succeeded":
        metrics.answered(record["completion_ms"] / 1e3)
    elif record["outcome"] != goals.ABANDONED:
        metrics.failed()


def pause(seconds: float) -> None:
    """Wait, but not when asked to stop."""
    end = time.monotonic() + seconds
    while not node.stopping() and time.monotonic() < end:
        time.sleep(max(0.0, min(LOOK_SECONDS, end - time.monotonic())))


def main() -> None:
    node.run("prime_factors_client", read_settings, send_batches)
