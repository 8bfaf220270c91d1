# SPDX-License-Identifier: GPL-3.0-or-later
"""What every application's process does the same way: settings, ROS node, readiness file, clean stop."""

from __future__ import annotations

import json
import os
import sys
import threading
import time
from pathlib import Path
from typing import Any, Callable

from . import settings
from .metrics import Metrics

os.environ.setdefault("ROS_LOG_DIR", "/tmp/ros-log")  # noqa: S108 - rospy wants a home directory, a container has none

import rospy  # type: ignore[import-not-found]

READY = Path("/tmp/ready")  # noqa: S108 - a container's own /tmp
LINGER_SECONDS = 0.05
LEAVE_SECONDS = 5.0


class _Stop:
    """Whether the node was asked to stop. A plain flag: a lock could be held by the thread that a signal interrupts."""

    asked = False


def stopping() -> bool:
    """Whether to stop. True before rospy closes the connections: what is counted as sent until then can still go."""
    return _Stop.asked or bool(rospy.is_shutdown())


def _stop() -> None:
    _Stop.asked = True
    time.sleep(LINGER_SECONDS)  # the connections' own threads send meanwhile what is queued


def _leave() -> None:
    """Wait until rospy has taken the registrations back.

    It does so after `_stop` and before it says that it is shut down, in a thread that ends with the process: whoever
    returns from its main thread on `stopping` alone may leave the graph a stale registration.
    """
    end = time.monotonic() + LEAVE_SECONDS
    while _Stop.asked and not rospy.is_shutdown() and time.monotonic() < end:
        time.sleep(0.005)


def say(event: str, **fields: Any) -> None:
    """One line of JSON on the standard output, for whoever collects a container's log."""
    print(json.dumps({"event": event, "node": rospy.get_name(), **fields}), flush=True)


def ready() -> None:
    """Say that the application is ready."""
    READY.write_text("ready\n", encoding="utf-8")
    say("ready")


def measured(pattern: str, name: str) -> Metrics:
    """The metrics of a topic, service or action, shown at METRICS_PORT where there is one."""
    metrics = Metrics(pattern, str(rospy.resolve_name(name)))
    port = settings.metrics_port()
    if port:
        metrics.serve(port)
    return metrics


def _crash_after(seconds: float) -> None:
    """End the process as a fault would: at once, without a word to the ROS master."""

    def crash() -> None:
        say("crashed", after=seconds)
        os._exit(1)

    timer = threading.Timer(seconds, crash)
    timer.daemon = True
    timer.start()


def _never_connect() -> None:
    """Be a node that looks ready and offers nothing."""
    ready()
    while not stopping():
        time.sleep(0.1)


def run(name: str, read_settings: Callable[[], tuple[Any, ...]], application: Callable[..., None]) -> None:
    """Run one application as the ROS node `name` (or what `__name:=` says) until it is asked to stop.

    Its settings are read first: a wrong one ends it at once, whether there is a ROS master or not.

    rospy's own handlers end it on SIGTERM and SIGINT, as process 1 of a container too, and on `shutdown` by the
    slave API.
    """
    try:
        values = read_settings()
        crash_after, never_connect = settings.faults()
        settings.metrics_port()
    except settings.SettingError as error:
        sys.exit(f"{name}: {error}")
    READY.unlink(missing_ok=True)
    if crash_after:
        _crash_after(crash_after)
    try:
        rospy.init_node(name)
        rospy.on_shutdown(_stop)
        say("started", version=settings.version())
        if never_connect:
            _never_connect()
        else:
            application(*values)
        _leave()
        say("stopped")
    except rospy.ROSInterruptException:
        say("stopped")  # while it waited for something
    except rospy.ROSInitException as error:
        sys.exit(f"{name}: stopped before it reached the ROS master: {error}")
    finally:
        READY.unlink(missing_ok=True)
