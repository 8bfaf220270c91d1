# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""The ROS 1 master's XML-RPC API, within one time-out for everything that is asked at once."""

from __future__ import annotations

import math
import os
import time
from typing import Any, Callable, Iterable, Sequence, TypeVar

from .._common.documents import Data
from .._common.errors import RosError
from .graph import MasterState
from .replies import master_state
from .rpc import Api, Deadline, Memo, Request, address_of, reason

_Result = TypeVar("_Result")


class Master:
    """One master, by its URI. It is asked anew by every call, so a node that moved is found.

    What it says is read again only where it says something else: that of a large fleet takes a good part of a second.
    """

    def __init__(self, uri: str, timeout: float = 2.0, caller: str = "") -> None:
        self.uri = uri
        self.timeout = timeout
        # a caller id of its own: it shows up in the nodes' logs and connection lists
        self.caller = caller or f"/rosops_fleet_{os.getpid()}"
        self._memo = Memo()
        self._states: dict[bool, tuple[Any, Any, MasterState]] = {}  # with types, without
        self._rest = 0.0  # by time.monotonic; until then it is left alone
        address_of(uri, "http")
        if not (math.isfinite(timeout) and timeout > 0):
            raise RosError(f"a time-out of {timeout} s is not more than 0 s")

    def within(self, call: Callable[[Api], _Result]) -> _Result:
        """Make calls of the master, and end with the time-out; raises what went wrong, as it came."""
        with Api(self.uri, self.caller, Deadline(self.timeout), self._memo) as api:
            return call(api)

    def calls(self, requests: Sequence[Request]) -> list[Any]:
        """Requests (method, caller, *arguments) in one round trip; each result is a value or a RosError."""
        if not requests:
            return []
        try:
            return self.within(lambda api: api.calls(requests))
        except Exception as error:
            raise RosError(f"the ROS master does not answer: {reason(error, self.uri, self.timeout)}") from error

    def state(self, types: bool = False) -> MasterState:
        """Who registered what, with the topics' types where they are wanted.

        To say it all takes a master as long as it has to tell, so it is then left alone for as long: many who look at
        a large graph at the same time must not keep it from its work.
        """
        time.sleep(max(0.0, self._rest - time.monotonic()))
        began = time.monotonic()
        results = self.calls([("getSystemState", self.caller), ("getTopicTypes", self.caller)][: 2 if types else 1])
        ended = time.monotonic()
        self._rest = ended + min(ended - began, self.timeout)
        for result in results:
            if isinstance(result, RosError):
                raise RosError(f"the ROS master at {self.uri} is not one: {result}")
        return self.state_of(*results)

    def state_of(self, system_state: Any, types: Any = None) -> MasterState:
        """The state that these values of the master's replies are. The same values as before are the same object."""
        known = self._states.get(types is None)
        if known is None or known[0] is not system_state or known[1] is not types:
            known = self._states[types is None] = (system_state, types, master_state(system_state, types))
        return known[2]

    def look_up(self, nodes: Iterable[str], services: Iterable[str] = ()) -> tuple[Data, Data]:
        """Addresses of nodes and services; a RosError in place of one that is not to be had."""
        requests = [
            *(("lookupNode", self.caller, name) for name in nodes),
            *(("lookupService", self.caller, name) for name in services),
        ]
        found: dict[str, Data] = {"lookupNode": {}, "lookupService": {}}
        for (method, _caller, name), result in zip(requests, self.calls(requests)):
            found[method][name] = result if isinstance(result, (str, RosError)) else RosError("it has no address")
        return found["lookupNode"], found["lookupService"]

    def addresses(self, nodes: Iterable[str], services: Iterable[str] = ()) -> tuple[dict[str, str], dict[str, str]]:
        """The addresses that there are."""
        found = self.look_up(nodes, services)
        return tuple({name: uri for name, uri in part.items() if isinstance(uri, str)} for part in found)  # type: ignore[return-value] # two of them
