# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""The service `add_two_ints`. OPERATION=subtract makes it the changed version that an update brings."""

from __future__ import annotations

from typing import Any

import rospy  # type: ignore[import-not-found]

from . import node, settings
from .arithmetic import OPERATIONS, wrap


def read_settings() -> str:
    """What it answers with."""
    return settings.choice("OPERATION", tuple(OPERATIONS))


def serve(name: str) -> None:
    """Answer until asked to stop."""
    from .srv import AddTwoInts, AddTwoIntsResponse  # type: ignore[import-not-found] # noqa: PLC0415 - made at build

    operation = OPERATIONS[name]

    def answer(request: Any) -> Any:
        return AddTwoIntsResponse(wrap(operation(request.a, request.b)))

    service = rospy.Service("add_two_ints", AddTwoInts, answer)
    node.ready()
    service.spin()


def main() -> None:
    """Run it."""
    node.run("add_two_ints_server", read_settings, serve)
