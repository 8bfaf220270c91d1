# SPDX-License-Identifier: GPL-3.0-or-later
"""The action `prime_factors`: the factors of a batch of numbers, FACTOR_PAUSE (0.05) seconds of work for each."""

from __future__ import annotations

import math
import queue
import socket
import threading
import time
from pathlib import Path
from typing import Any

import actionlib  # type: ignore[import-not-found]
import rospy  # type: ignore[import-not-found]
from actionlib_msgs.msg import GoalStatus  # type: ignore[import-not-found]

from . import goals, node, settings
from .factors import prime_factors
from .jsonl import JsonLinesLog
from .metrics import Metrics

ACTION = "prime_factors"
SLICE_SECONDS = 0.02  # it notices within this time that it is asked to stop, or that the goal was cancelled
STOP_SECONDS = 0.5


class EndedEarlyError(Exception):
    """The goal ends before its time; the text says why."""


class FactorServer:
    """Executes one goal after the other, in the order in which they come.

    Not actionlib's SimpleActionServer: that one gives up the goal it works on, and the one that waits, for a new one.
    """

    def __init__(self, pause: float, log: JsonLinesLog | None, metrics: Metrics) -> None:
        from . import msg  # noqa: PLC0415 - made when the image is built

        self._msg = msg
        self._pause = pause
        self._log = log
        self._metrics = metrics
        # Not SimpleQueue: its get(timeout) waits for ever where a signal's handler takes longer than the timeout.
        self._waiting: queue.Queue[Any] = queue.Queue()
        self._server = actionlib.ActionServer(
            ACTION, msg.PrimeFactorsAction, goal_cb=self._waiting.put, auto_start=False
        )
        self._server.start()

    def spin(self) -> None:
        """Work until asked to stop; what waits then is refused, so that its client knows."""
        while not node.stopping():
            try:
                self._execute(self._waiting.get(timeout=SLICE_SECONDS))
            except queue.Empty:
                continue
        while not self._waiting.empty():
            self._waiting.get().set_rejected(text="the server stops")
            self._metrics.failed()

    def _execute(self, handle: Any) -> None:
        goal = handle.get_goal()
        result = self._msg.PrimeFactorsResult(batch=goal.batch, server=rospy.get_name())
        if min(goal.numbers, default=1) < 1:
            handle.set_rejected(result, "a number below 1 has no prime factors")
            self._metrics.failed()
            return
        handle.set_accepted()
        self._record(handle, goals.STARTED, batch=goal.batch)
        started = time.monotonic()
        try:
            for number in goal.numbers:
                result.factors.append(self._msg.Factors(number=number, factors=self._factorise(handle, number)))
            handle.set_succeeded(result)
            self._metrics.answered(time.monotonic() - started)
        except EndedEarlyError as reason:
            end = handle.set_canceled if self._cancelled(handle) else handle.set_aborted
            end(result, str(reason))
            self._metrics.failed()
        status = GoalStatus.to_string(handle.get_goal_status().status).lower()
        seconds = round(time.monotonic() - started, 3)
        self._record(handle, goals.ENDED, batch=goal.batch, status=status, seconds=seconds)

    def _factorise(self, handle: Any, number: int) -> list[int]:
        """One number's factors, each told as soon as it is known; a 1 says that the number is done."""
        batch = handle.get_goal().batch
        found: list[int] = []
        for factor in prime_factors(number):
            self._work(handle)
            found.append(factor)
            handle.publish_feedback(self._msg.PrimeFactorsFeedback(batch=batch, number=number, factor=factor))
        handle.publish_feedback(self._msg.PrimeFactorsFeedback(batch=batch, number=number, factor=1))
        return found

    def _work(self, handle: Any) -> None:
        """The work that a factor costs."""
        end = time.monotonic() + self._pause
        while True:
            if node.stopping():
                raise EndedEarlyError("the server stops")
            if self._cancelled(handle):
                raise EndedEarlyError("the client cancelled it")
            left = end - time.monotonic()
            if left <= 0:
                return
            time.sleep(min(left, SLICE_SECONDS))

    @staticmethod
    def _cancelled(handle: Any) -> bool:
        return bool(handle.get_goal_status().status == GoalStatus.PREEMPTING)

    def _record(self, handle: Any, event: str, **fields: Any) -> None:
        if self._log:
            who = {"time": round(time.time(), 3), "node": rospy.get_name(), "host": socket.gethostname()}
            self._log.write({**who, "event": event, "goal": handle.get_goal_id().id, **fields})


def read_settings() -> tuple[float, Path | None]:
    """The work a factor costs, and where the log of goals goes (LOG_DIR, optional)."""
    return settings.not_negative("FACTOR_PAUSE", 0.05), settings.log_dir()


def serve(pause: float, directory: Path | None) -> None:
    """Work until asked to stop."""
    # A file for each pod (its host name): two servers that share a volume do not write into one file.
    log = JsonLinesLog(directory / f"prime-factors-server-{socket.gethostname()}.jsonl") if directory else None
    # A signal's handler runs in the main thread: the work is done in another, which can then still tell its clients.
    worker = threading.Thread(target=FactorServer(pause, log, node.measured("action", ACTION)).spin, daemon=True)
    worker.start()
    rospy.on_shutdown(lambda: wait_for(worker, STOP_SECONDS))
    node.ready()
    wait_for(worker)
    if log:
        log.close()


def wait_for(worker: threading.Thread, seconds: float = math.inf) -> None:
    """Until it has ended and its last words are out. Not `join`: a signal could interrupt that with its lock held."""
    deadline = time.monotonic() + seconds
    while worker.is_alive() and time.monotonic() < deadline:
        time.sleep(SLICE_SECONDS)
    time.sleep(node.LINGER_SECONDS)


def main() -> None:
    node.run("prime_factors_server", read_settings, serve)
