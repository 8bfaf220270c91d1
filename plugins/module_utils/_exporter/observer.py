# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""One look at a whole ROS graph for the exporter: the master, then all nodes, a few at a time.

It registers nothing and subscribes to nothing. Its only data connections: the handshake that a service's client makes,
and one message of an action's status topic.
"""

from __future__ import annotations

import queue
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, Callable, Iterable

from .._common.errors import RefusalError, RosError
from .._ros import bus_stats, graph, replies, roslaunch
from .._ros.graph import MasterState
from .._ros.master import Master
from .._ros.roslaunch import Child
from .._ros.rpc import Api, Deadline, in_parallel
from .._ros.transport import greet, read_states, subscribe_status
from . import snapshot
from .snapshot import NodeReply

CALLER = "/ros_exporter"
AT_ONCE = 8  # nodes, or launch files, asked at the same time


@dataclass(frozen=True)
class Errand:
    """What to ask one node, or the error that stands in its address' place."""

    name: str
    uri: str | RosError
    services: tuple[tuple[str, Any], ...] = ()
    actions: tuple[str, ...] = ()


class Observer(Master):
    """A ROS master's graph, looked at again and again."""

    def __init__(self, uri: str, timeout: float) -> None:
        super().__init__(uri, timeout, CALLER)
        self.late: set[str] = set()  # nodes that did not answer last time

    def graph(self) -> MasterState:
        """The registrations; raises what went wrong, as it came."""
        return self.state_of(replies.unwrap(self.within(lambda api: api.raw("getSystemState", CALLER))))

    def errands(self, state: MasterState) -> list[Errand]:
        """Every registered node with what there is to ask it; those that were late last time come last."""
        names = state.nodes()
        watched = snapshot.watched(state)
        uris, service_uris = self.look_up(names, watched)
        servers = {action: state.servers(action) for action in state.graph.actions}
        made = []
        for name in sorted(names, key=lambda name: (name in self.late, name)):
            services = tuple((one, service_uris[one]) for one in state.of(name, state.services) if one in watched)
            made.append(Errand(name, uris[name], services, tuple(one for one in servers if name in servers[one])))
        return made

    def launched(self, errands: Iterable[Errand]) -> list[Child]:
        """What launch files started where these nodes are; raises what went wrong with the master, as it came."""
        hosts = {graph.host_of(errand.uri) for errand in errands if isinstance(errand.uri, str)}
        known = list(roslaunch.found(self, hosts).items())
        turns = [known[begin : begin + AT_ONCE] for begin in range(0, len(known), AT_ONCE)]
        return [child for turn in turns for child in roslaunch.asked(self, turn)]

    def answers(self, errands: Iterable[Errand]) -> dict[str, NodeReply]:
        """What the nodes say. A node that hangs costs one time-out, and holds up one of AT_ONCE."""
        todo: queue.SimpleQueue[Errand] = queue.SimpleQueue()
        wanted = list(errands)
        for errand in wanted:
            todo.put(errand)
        answers = {errand.name: NodeReply(errors=("timeout",)) for errand in wanted}
        open_still = [True]

        def work() -> None:
            while open_still[0]:
                try:
                    errand = todo.get_nowait()
                except queue.Empty:
                    return
                answer = self.ask_node(errand)
                if open_still[0]:
                    answers[errand.name] = answer

        # twice: a node's own questions, then its services and actions
        seconds = 2 * self.timeout * -(-len(wanted) // AT_ONCE)
        workers = dict.fromkeys(range(min(AT_ONCE, len(wanted))), work)
        in_parallel(workers, seconds, lambda _key, _error: None)
        open_still[0] = False
        found = dict(answers)
        self.late = {name for name, answer in found.items() if answer.pid is None}
        return found

    def ask_node(self, errand: Errand) -> NodeReply:
        """All questions to one node, whatever it answers."""
        if not isinstance(errand.uri, str):
            return NodeReply(errors=("fault",))
        try:
            answer = self._calls(errand.uri)
        except Exception as error:  # whatever an untrusted peer provokes is that peer's result
            return NodeReply(errand.uri, errors=(snapshot.reason(error),))
        deadline = Deadline(self.timeout)
        services, actions, errors = {}, {}, list(answer.errors)
        for service, uri in errand.services:
            up, why = _tried(partial(self._greet, service, uri, deadline))
            services[service] = why is None and bool(up)
            errors += [why] if why else []
        for action in errand.actions:
            goals, why = _tried(partial(self._goals, errand.uri, action, deadline))
            if why is None:
                actions[action] = goals
            errors += [why] if why else []
        return replace(answer, services=services, actions=actions, errors=tuple(errors))

    def _calls(self, uri: str) -> NodeReply:
        """The process id, which tells that it lives; without one of the others only that part is unknown."""
        with Api(uri, CALLER, Deadline(self.timeout)) as api:
            pid = api.process()
            info, why_info = _tried(lambda: replies.unwrap(api.raw("getBusInfo", CALLER)))
            stats, why_stats = _tried(lambda: bus_stats.stats(api.raw("getBusStats", CALLER)))
        links = tuple(link for link in replies.connections(info) if link.peer != CALLER) if why_info is None else None
        errors = tuple(why for why in (why_info, why_stats) if why)
        return NodeReply(uri, pid, stats, links, own_connections(info), errors=errors)

    def _greet(self, service: str, uri: Any, deadline: Deadline) -> bool:
        """Shake hands as a client does before a call; the service itself is not called."""
        if not isinstance(uri, str):
            raise RefusalError(f"the master has no address of {service}")
        greet(service, uri, CALLER, deadline)
        return True

    def _goals(self, uri: str, action: str, deadline: Deadline) -> tuple[int, ...]:
        """The goals in one status message, over a connection that the master does not know."""
        with subscribe_status(action, uri, CALLER, deadline) as sock:
            return read_states(sock)


def own_connections(info: Any) -> tuple[int, ...]:
    """Ids of the connections in a getBusInfo value that lead to the exporter: its look at a status may linger."""
    rows = info if isinstance(info, (list, tuple)) else ()
    return tuple(
        row[0] for row in rows if isinstance(row, (list, tuple)) and len(row) > 1 and row[1] == CALLER
    )  # fmt: skip


def _tried(call: Callable[[], Any]) -> tuple[Any, str | None]:
    """A call's result, or None and the reason why there is none."""
    try:
        return call(), None
    except Exception as error:  # whatever an untrusted peer provokes is that peer's result
        return None, snapshot.reason(error)
