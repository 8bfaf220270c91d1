# SPDX-License-Identifier: GPL-3.0-or-later
"""Asks `add_two_ints` RATE_HZ (10) times a second; every request and its answer in LOG_DIR/add-two-ints.jsonl.

PERSISTENT=true keeps one connection for all requests, as clients do for speed. When the server at its other end goes,
every later request fails: rospy does not connect such a proxy again, and neither does this program.
"""

from __future__ import annotations

import http.client
import time
import xmlrpc.client
from pathlib import Path
from typing import Any

import rospy  # type: ignore[import-not-found]
from rospy.exceptions import TransportException  # type: ignore[import-not-found]

from . import node, settings
from .arithmetic import operands, operation_of
from .jsonl import JsonLinesLog, last_record
from .metrics import Metrics

LOG_NAME = "add-two-ints.jsonl"
SERVICE = "add_two_ints"
# The last one is how rospy says that a persistent proxy's connection has been closed.
FAILURES = (rospy.ServiceException, TransportException, AttributeError)
# Of a look-up at a master that is just ending, which rospy lets through: an answer such as 404, or half of one.
ENDING = (xmlrpc.client.Error, http.client.HTTPException)


def ask(proxy: Any, request: int, metrics: Metrics) -> dict[str, Any]:
    """One request, made once: a failed one is written down as failed, not repeated."""
    a, b = operands(request)
    record: dict[str, Any] = {"time": round(time.time(), 3), "node": rospy.get_name(), "request": request}
    started = time.monotonic()
    try:
        result = proxy(a, b).sum
    except FAILURES as error:
        # rospy keeps the cause to itself: whether a master refused, was not reached or closed is what one looks for
        cause = f": {error.__context__}" if isinstance(error.__context__, OSError) else ""
        outcome = {"ok": False, "error": f"{error}{cause}"}
    except ENDING as error:
        outcome = {"ok": False, "error": f"unable to contact master: {error}"}
    else:
        operation = operation_of(a, b, result)
        outcome = {"ok": operation != "wrong", "sum": result, "operation": operation}
    seconds = time.monotonic() - started
    if outcome["ok"]:
        metrics.answered(seconds)
    else:
        metrics.failed()
    return {**record, "a": a, "b": b, **outcome, "latency_ms": round(seconds * 1e3, 3)}


def read_settings() -> tuple[float, bool, Path]:
    """Requests a second, whether over one connection, and where the log goes."""
    return settings.positive("RATE_HZ", 10.0), settings.flag("PERSISTENT"), settings.required_log_dir()


def request_answers(rate: float, persistent: bool, directory: Path) -> None:
    """Ask until asked to stop."""
    from .srv import AddTwoInts  # type: ignore[import-not-found] # noqa: PLC0415 - made when the image is built

    period = 1.0 / rate
    previous = last_record(directory / LOG_NAME, key="request")
    log = JsonLinesLog(directory / LOG_NAME)
    request = previous["request"] + 1 if previous else 0
    metrics = node.measured("service", SERVICE)
    rospy.wait_for_service(SERVICE)
    # Unless persistent, every request looks the server up, so the next one after an update finds the new server.
    proxy = rospy.ServiceProxy(SERVICE, AddTwoInts, persistent=persistent)
    is_ready = False
    due = time.monotonic()
    while not node.stopping():
        pause = due - time.monotonic()
        if pause > 0:
            time.sleep(min(pause, 0.5))
            continue
        record = ask(proxy, request, metrics)
        log.write(record)
        request += 1
        # A request that took long is not made up for by a burst: the next one is due a period from now.
        due = max(due + period, time.monotonic())
        if record["ok"] and not is_ready:
            is_ready = True
            node.ready()
    log.close()


def main() -> None:
    node.run("add_two_ints_client", read_settings, request_answers)
