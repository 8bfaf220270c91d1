# SPDX-License-Identifier: GPL-3.0-or-later
"""What the keeper of a ROS master is asked; its answers: `_robot/goal_forwarding.py`, `_robot/latched_topics.py`."""

from __future__ import annotations

from typing import Any

from .._common.documents import Data
from .._common.errors import RefusalError
from .replies import unwrap
from .rpc import Api, Deadline, reason

FORGETFUL = "it was begun anew, and has not yet been given back all that was registered"
TIMEOUT = 4.0  # it connects to all of an action's clients before it says that it holds their goals


class KeeperCalls:
    """A keeper, from a stop hook or a step. It is a help, never a condition: what it cannot do is told in words."""

    def __init__(self, uri: str, caller: str) -> None:
        self.uri = uri
        self.caller = caller

    def hold(self, action: str, server: str, seconds: float, within: float = TIMEOUT) -> str:
        """Why it does not hold the action's goals, or nothing if it does; it has so many seconds to answer."""
        return self._problem(within, "hold", action, server, seconds)

    def release(self, action: str) -> str:
        """Why it may not have let the action's goals go, or nothing if it has."""
        return self._problem(TIMEOUT, "release", action)

    def keep_latched(self, node: str, uri: str, seconds: float) -> str:
        """Why it does not keep all that the node at `uri` has latched, or nothing if it does. It takes that itself."""
        return self._problem(seconds, "keep_latched", node, uri, seconds * 0.8)

    def held(self) -> Data:
        """Action -> what is held of it. Raises what went wrong."""
        with Api(self.uri, self.caller, Deadline(TIMEOUT)) as api:
            found: Data = api.raw("state")[2]
        return found

    def is_whole(self, age: float) -> bool:
        """Whether the master had, so many seconds ago, been given back what the one before had.

        False by the keeper's own word alone: a robot without a keeper starts its apps, too.
        """
        try:
            with Api(self.uri, self.caller, Deadline(TIMEOUT)) as api:
                return unwrap(api.raw("is_whole", age)) is not False
        except Exception:  # one of an older collection has no such call
            return True

    def _problem(self, seconds: float, method: str, *params: Any) -> str:
        try:
            with Api(self.uri, self.caller, Deadline(seconds)) as api:
                unwrap(api.raw(method, *params))
        except RefusalError as error:
            return f"the keeper refused: {error}"
        except Exception as error:
            return reason(error, self.uri, seconds)
        return ""
