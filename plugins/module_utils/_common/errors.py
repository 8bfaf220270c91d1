# SPDX-License-Identifier: GPL-3.0-or-later
"""Errors of the collection, and what of others they may print. Only a module's main() turns one into a failed task."""

from __future__ import annotations

import re
from typing import Any

# What moves the cursor, sets colours or titles (C0 and C1, U+009B among them) or turns the direction of writing.
_CONTROL = re.compile("[\x00-\x08\x0b-\x1f\x7f-\x9f\u061c\u200e\u200f\u2028-\u202e\u2066-\u2069]")


def printable(text: str) -> str:
    """The text with control characters as Python writes them, `\\x1b`; line ends and tabs stay.

    Whoever may register a ROS node may give it any name, which is on its way to a terminal.
    """
    return _CONTROL.sub(lambda found: found.group().encode("unicode_escape").decode(), text)


class FleetError(Exception):
    """Something the operator has to know: what, where, what to do.

    `details` goes into the module's result next to the message, so keep it JSON-serialisable and free of secrets. The
    message may have names of others in it: they cannot write to the operator's terminal.
    """

    def __init__(self, message: str, **details: Any) -> None:
        super().__init__(printable(message))
        self.details: dict[str, Any] = details


class SpecError(FleetError):
    """The inventory or an app's specification is wrong; nothing was touched."""


class RosError(FleetError):
    """The ROS master or a node did not answer as the protocol says."""


class RefusalError(RosError):
    """A well-formed reply that says no."""


class KubeError(FleetError):
    """The Kubernetes API could not be reached or refused the request."""


class NotReadyError(FleetError):
    """A wait ended without success; `details` carries the last observation."""
