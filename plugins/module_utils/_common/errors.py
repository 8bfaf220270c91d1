# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Errors of the collection. Only a module's main() turns one into a failed task."""

from __future__ import annotations

from typing import Any

from .printable import printable


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
