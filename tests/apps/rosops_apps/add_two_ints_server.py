# SPDX-License-Identifier: GPL-3.0-or-later
"""The service `add_two_ints`. OPERATION=subtract makes it the changed version that an update brings."""

from __future__ import annotations

import time
from typing import Any

import rospy  # type: ignore[import-not-found]

from . import node, settings
from .arithmetic import OPERATIONS, wrap

SERVICE = "add_two_ints"


def read_settings() -> tuple[str]:
    """What it answers with."""
    return (settings.choice("OPERATION", tuple(OPERATIONS)),)


def serve(name: str) -> None:
    """Answer until asked to stop."""
    from .srv import AddTwoInts, AddTwoIntsResponse  # type: ignore[import-not-found] # noqa: PLC0415 - made at build

    operation = OPERATIONS[name]
    metrics = node.measured("service", SERVICE)

    def answer(request: Any) -> Any:
        started = time.monotonic()
        response = AddTwoIntsResponse(wrap(operation(request.a, request.b)))
        metrics.answered(time.monotonic() - started)
        return response

    service = rospy.Service(SERVICE, AddTwoInts, answer)
    node.ready()
    service.spin()


def main() -> None:
    node.run("add_two_ints_server", read_settings, serve)
