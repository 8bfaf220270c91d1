# SPDX-License-Identifier: GPL-3.0-or-later
"""Registrations over the network: read them, ask their nodes, make them and take them back.

The only code that changes a ROS graph for somebody else.
"""

from __future__ import annotations

import errno
import time
from functools import partial
from typing import Any, Callable, Mapping, Sequence

from .._common.documents import Arguments, Data
from .._common.errors import RosError
from . import registrations
from .backend import MasterState
from .graph import host_of
from .graph_json import graph_from
from .names import is_meant
from .registrations import ALIVE, DEAD, SUBSCRIBER, UNKNOWN, Call, Entry, Liveness
from .replies import topic_types
from .rpc import Api, Deadline, Master, in_parallel, reason, tell_publishers
from .streams import greet

# Of an address whose kernel says that nothing is there; a time-out says only that nothing came in time.
_GONE = frozenset({errno.ECONNREFUSED, errno.EHOSTUNREACH, errno.ENETUNREACH, errno.EHOSTDOWN})
UPDATES = 3  # publisher lists are sent again where they changed meanwhile
# A pod's address that is no more: its host finds that out by three ARP requests, one second each.
UNREACHABLE = 5.0
BETWEEN_LOOKS = 1.0


class Registrar(Master):
    """The registrations of one ROS 1 graph."""

    # ---- the master

    def snapshot(self, state: MasterState | None = None) -> dict[str, Entry]:
        """Everything that is registered, with addresses."""
        state = state or self.state(types=True)
        return registrations.from_master(state, *self.addresses(state.nodes(), sorted(state.services)))

    def apply(self, calls: Sequence[Call]) -> None:
        """Make the calls in their order, and tell subscribers that were registered who publishes.

        Who has come under a name since that was decided keeps it: for the old address the master would shut it down.
        """
        now = self.addresses(sorted({call.node for call in calls if not call.remove}))[0]
        calls = [call for call in calls if call.remove or now.get(call.node, call.uri) == call.uri]
        for call, result in zip(calls, self.calls([call.request for call in calls])):
            if isinstance(result, RosError):
                raise RosError(f"the ROS master refused {' '.join(call.request)}: {result}")
        subscribers = [call for call in calls if call.kind == SUBSCRIBER and not call.remove]
        if subscribers:
            self.introduce(subscribers)

    def introduce(self, subscribers: Sequence[Call]) -> None:
        """Send each subscriber its topic's publishers, as the master does when one of them comes or goes.

        The master hands the list to whoever registers, which is us. A publisher that comes while we hand it on makes
        the master send a newer list that ours might overtake: so look again until what was sent is what there is.
        """
        sent: dict[Call, list[str]] = {}
        for _attempt in range(UPDATES):
            state = self.state()
            names = {call.name: state.publishers.get(call.name, ()) for call in subscribers}
            known = self.addresses(sorted({node for nodes in names.values() for node in nodes}))[0]
            found = {topic: [known[node] for node in nodes if node in known] for topic, nodes in names.items()}
            todo = {call: found[call.name] for call in subscribers if sent.get(call) != found[call.name]}
            if not todo:
                return
            tasks = {
                call: partial(tell_publishers, call.uri, call.name, uris, self.timeout)
                for call, uris in todo.items()
                if uris
            }
            in_parallel(tasks, self.timeout, lambda _call, _error: None)  # one that is gone by now misses nothing
            sent.update(todo)

    # ---- nodes

    def ask(self, entries: Mapping[str, Entry], timeout: float = 0.0, own_word: bool = True) -> dict[str, Liveness]:
        """What the nodes say of themselves, all at the same time."""
        seconds = timeout or self.timeout

        def failed(node: Any, error: BaseException) -> Liveness:
            dead = isinstance(error, OSError) and error.errno in _GONE
            return Liveness(DEAD if dead else UNKNOWN, reason(error, entries[node].uri, seconds))

        tasks: dict[Any, Callable[[], Liveness]] = {
            node: partial(self._node, node, entry, seconds, own_word) for node, entry in entries.items()
        }
        return in_parallel(tasks, seconds, failed)

    def _node(self, name: str, entry: Entry, seconds: float, own_word: bool) -> Liveness:
        deadline = Deadline(seconds)
        with Api(entry.uri, self.caller, deadline) as api:
            pid = api.process()
            if not own_word:
                return Liveness(ALIVE, "", pid)
            told = [api.optional(method) for method in ("getPublications", "getSubscriptions")]
        publications, subscriptions = (None if one is None else frozenset(topic_types(one)) for one in told)
        services = frozenset(
            service for service, uri in entry.services.items() if self._serves(name, service, uri, deadline)
        )
        return Liveness(ALIVE, "", pid, publications, subscriptions, services)

    def _serves(self, node: str, service: str, uri: str, deadline: Deadline) -> bool:
        """Whether the address answers for this service, in this node's name; the service itself is not called."""
        try:
            reply = greet(service, uri, self.caller, deadline)
        except (OSError, RosError):
            return False
        return reply.get("callerid", node) == node


# ---- jobs of an update's step on the robot's host


def register(arguments: Arguments) -> Data:
    """Register again what the `graph` (`graph_json`) has of these `nodes` (all without names) and the master has not.

    Only of nodes that answer at their recorded address, with their recorded process id, and that have the topic or the
    service by their own word. Services point to the nodes of the graph afterwards.
    """
    ros, nodes = Registrar(arguments["master_uri"]), arguments["nodes"]
    present, recorded = ros.snapshot(), registrations.from_graph(graph_from(arguments["graph"]))
    wanted = {name: entry for name, entry in recorded.items() if not nodes or is_meant(name, nodes)}
    need = registrations.missing(wanted, present, take_services=True)
    calls = registrations.restore(need, present, ros.ask(need))
    ros.apply(calls)
    return {"changed": bool(calls)}


def reap(arguments: Arguments) -> Data:
    """Take back what those of the `nodes` left that are gone in two looks. One that is only late is not.

    `hosts` are addresses of pods that are no more: nobody has to be asked there, and for most of a minute the kernel
    of who has just talked with such a pod would not know.
    """
    ros, nodes = Registrar(arguments["master_uri"]), arguments["nodes"]
    suspects = {name: entry for name, entry in ros.snapshot().items() if is_meant(name, nodes)}
    known = {name: Liveness(DEAD) for name, entry in suspects.items() if host_of(entry.uri) in arguments["hosts"]}

    def look(entries: Mapping[str, Entry]) -> dict[str, Liveness]:
        asked = {name: entry for name, entry in entries.items() if name not in known}
        return {**ros.ask(asked, UNREACHABLE, own_word=False), **known}

    first = look(suspects)
    suspects = {name: entry for name, entry in suspects.items() if registrations.gone(entry, first[name])}
    if suspects.keys() - known:
        time.sleep(BETWEEN_LOOKS)
    calls = registrations.remove(suspects, [first, look(suspects)])
    ros.apply(calls)
    return {"changed": bool(calls)}
