# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Registrations over the network: read them, ask their nodes, make them and take them back.

The only code that changes a ROS graph for somebody else. Runs on Python 3.8 with the standard library.
"""

from __future__ import annotations

import errno
import math
import os
import xmlrpc.client
from functools import partial
from typing import Any, Callable, Iterable, Mapping, Sequence

from .._common.errors import RosError
from . import registrations
from .graph import MasterState, master_state, topic_types, unwrap
from .registrations import ALIVE, DEAD, SUBSCRIBER, UNKNOWN, Answer, Call, Entry
from .rpc import Api, Deadline, address_of, connect, handshake, in_parallel, reason

# Of an address whose kernel says that nothing is there; a time-out says only that nothing came in time.
_GONE = frozenset({errno.ECONNREFUSED, errno.EHOSTUNREACH, errno.ENETUNREACH, errno.EHOSTDOWN})
MASTER = "/master"  # the caller id that the master itself uses towards nodes
UPDATES = 3  # publisher lists are sent again where they changed meanwhile


class RosWriter:
    """The registrations of one ROS 1 graph."""

    def __init__(self, uri: str, timeout: float = 2.0, caller: str = "") -> None:
        self.uri = uri
        self.timeout = timeout
        self.caller = caller or f"/rosops_fleet_{os.getpid()}"
        address_of(uri, "http")
        if not (math.isfinite(timeout) and timeout > 0):
            raise RosError(f"a time-out of {timeout} s is not more than 0 s")

    # ---- the master

    def master(self, requests: Sequence[tuple[Any, ...]]) -> list[Any]:
        """Requests (method, caller, *arguments) in one round trip; each result is a value or a RosError."""
        if not requests:
            return []
        wanted = [{"methodName": method, "params": list(params)} for method, *params in requests]

        def task() -> list[Any]:
            with Api(self.uri, self.caller, Deadline(self.timeout)) as api:
                return [_value(reply) for reply in api.raw("system.multicall", wanted)]

        def failed(_key: Any, error: BaseException) -> Any:
            return RosError(f"the ROS master does not answer: {reason(error, self.uri, self.timeout)}")

        # in a thread of its own only for the name look-up, which would not end with the deadline
        results: Any = in_parallel({"master": task}, self.timeout, failed)["master"]
        if isinstance(results, RosError):
            raise results
        return list(results)

    def state(self) -> MasterState:
        """Who registered what, with the topics' types."""
        system, types = self.master([("getSystemState", self.caller), ("getTopicTypes", self.caller)])
        for result in (system, types):
            if isinstance(result, RosError):
                raise RosError(f"the ROS master at {self.uri} is not one: {result}")
        return master_state(system, types)

    def snapshot(self, state: MasterState | None = None) -> dict[str, Entry]:
        """Everything that is registered, with addresses."""
        state = state or self.state()
        nodes, services = state.nodes(), sorted(state.services)
        requests = [
            *(("lookupNode", self.caller, name) for name in nodes),
            *(("lookupService", self.caller, name) for name in services),
        ]
        found = self.master(requests)
        uris = {name: uri for name, uri in zip(nodes, found) if isinstance(uri, str)}
        service_uris = {name: uri for name, uri in zip(services, found[len(nodes) :]) if isinstance(uri, str)}
        return registrations.from_master(state, uris, service_uris)

    def apply(self, calls: Sequence[Call]) -> None:
        """Make the calls in their order, and tell subscribers that were registered who publishes."""
        for call, result in zip(calls, self.master([call.request for call in calls])):
            if isinstance(result, RosError):
                raise RosError(f"the ROS master refused {' '.join(call.request)}: {result}")
        self.introduce([call for call in calls if call.kind == SUBSCRIBER and not call.remove])

    def introduce(self, subscribers: Sequence[Call]) -> None:
        """Send each subscriber its topic's publishers, as the master does when one of them comes or goes.

        The master hands the list to whoever registers, which is us. A publisher that comes while we hand it on makes
        the master send a newer list that ours might overtake: so look again until what was sent is what there is.
        """
        sent: dict[Call, list[str]] = {}
        for _attempt in range(UPDATES):
            found = self._publishers({call.name for call in subscribers})
            todo = {call: found[call.name] for call in subscribers if sent.get(call) != found[call.name]}
            if not todo:
                return
            tasks = {call: partial(self._tell, call, uris) for call, uris in todo.items() if uris}
            in_parallel(tasks, self.timeout, lambda _call, _error: None)  # one that is gone by now misses nothing
            sent.update(todo)

    def _tell(self, call: Call, uris: list[str]) -> None:
        with Api(call.uri, MASTER, Deadline(self.timeout)) as api:
            api.call("publisherUpdate", call.name, uris)

    def _publishers(self, topics: Iterable[str]) -> dict[str, list[str]]:
        """The addresses of each topic's publishers."""
        state = self.state()
        names = {topic: state.publishers.get(topic, ()) for topic in topics}
        nodes = sorted({node for found in names.values() for node in found})
        uris = dict(zip(nodes, self.master([("lookupNode", self.caller, node) for node in nodes])))
        return {topic: [uris[node] for node in found if isinstance(uris[node], str)] for topic, found in names.items()}

    # ---- nodes

    def ask(self, entries: Mapping[str, Entry], timeout: float = 0.0, own_word: bool = True) -> dict[str, Answer]:
        """What the nodes say of themselves, all at the same time."""
        seconds = timeout or self.timeout

        def failed(node: Any, error: BaseException) -> Answer:
            dead = isinstance(error, OSError) and error.errno in _GONE
            return Answer(DEAD if dead else UNKNOWN, reason(error, entries[node].uri, seconds))

        tasks: dict[Any, Callable[[], Answer]] = {
            node: partial(self._node, node, entry, seconds, own_word) for node, entry in entries.items()
        }
        return in_parallel(tasks, seconds, failed)

    def _node(self, name: str, entry: Entry, seconds: float, own_word: bool) -> Answer:
        deadline = Deadline(seconds)
        with Api(entry.uri, self.caller, deadline) as api:
            pid = api.call("getPid")
            if not isinstance(pid, int):
                raise RosError("its process id is not a number")
            if not own_word:
                return Answer(ALIVE, "", pid)
            publications, subscriptions = (_names(api, method) for method in ("getPublications", "getSubscriptions"))
        services = frozenset(
            service for service, uri in entry.services.items() if self._serves(name, service, uri, deadline)
        )
        return Answer(ALIVE, "", pid, publications, subscriptions, services)

    def _serves(self, node: str, service: str, uri: str, deadline: Deadline) -> bool:
        """Whether the address answers for this service, in this node's name; the service itself is not called."""
        try:
            with connect(*address_of(uri, "rosrpc"), deadline) as sock:
                reply = handshake(sock, {"callerid": self.caller, "service": service, "md5sum": "*", "probe": "1"})
        except (OSError, RosError):
            return False
        return reply.get("callerid", node) == node


def _names(api: Api, method: str) -> frozenset[str] | None:
    """Topics that the node says it has; None if it does not know the call."""
    try:
        return frozenset(topic_types(api.call(method)))
    except (RosError, xmlrpc.client.Fault):
        return None


def _value(reply: Any) -> Any:
    """A result of system.multicall is a list of one reply, or a fault."""
    if isinstance(reply, list) and len(reply) == 1:
        try:
            return unwrap(reply[0])
        except RosError as error:
            return error
    text = reply.get("faultString") if isinstance(reply, dict) else ""
    return RosError(f"refused: {str(text)[:200]}")
