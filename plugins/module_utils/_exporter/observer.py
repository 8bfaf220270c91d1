# SPDX-License-Identifier: GPL-3.0-or-later
"""The exporter's looks at a whole ROS graph: the master, then all nodes, a few at a time.

It registers nothing and subscribes to nothing. Its only data connections: the handshake that a service's client makes,
and one message of an action's status topic.
"""

from __future__ import annotations

import math
import threading
import time
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, Callable, Iterable

from .._common.errors import RefusalError, RosError
from .._ros import bus_stats, graph, replies
from .._ros.backend import MasterState
from .._ros.roslaunch import Child, children
from .._ros.rpc import Api, Deadline, Master, in_parallel
from .._ros.streams import greet, read_states, subscribe_status
from . import snapshot
from .snapshot import GraphMetrics, History, NodeReply, Snapshot
from .updates import Updates

CALLER = "/ros_exporter"
AT_ONCE = 8  # nodes, or launch files, asked at the same time
FRESH = 150.0  # seconds for which a look is shown; Prometheus wants a scrape every two minutes at least
STUCK = 600.0  # a look that takes so long: something is wrong with the exporter itself


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
        names, watched = state.nodes(), snapshot.watched(state)
        uris, service_uris = self.look_up(names, watched)
        servers = {action: state.servers(action) for action in state.graph.actions}
        made = []
        for name in sorted(names, key=lambda name: (name in self.late, name)):
            has = state.graph.node(name).services
            services = tuple((one, service_uris[one]) for one in has if one in watched)
            made.append(Errand(name, uris[name], services, tuple(one for one in servers if name in servers[one])))
        return made

    def launched(self, errands: Iterable[Errand]) -> list[Child]:
        """What launch files started where these nodes are; raises what went wrong with the master, as it came."""
        hosts = {graph.host_of(errand.uri) for errand in errands if isinstance(errand.uri, str)}
        return children(self, hosts, AT_ONCE)

    def answers(self, errands: Iterable[Errand]) -> dict[str, NodeReply]:
        """What the nodes say. A node that hangs costs one time-out, and holds up one of AT_ONCE."""
        tasks = {errand.name: partial(self.ask_node, errand) for errand in errands}
        # twice: a node's own questions, then its services and actions
        seconds = 2 * self.timeout
        found = in_parallel(tasks, seconds, lambda _name, _error: NodeReply(errors=("timeout",)), AT_ONCE)
        self.late = {name for name, answer in found.items() if answer.pid is None}
        return found

    def ask_node(self, errand: Errand) -> NodeReply:
        """All questions to one node, whatever it answers.

        Its process id tells that it lives; without one of the others only that part is unknown.
        """
        uri = errand.uri
        errors: list[str] = []
        if not isinstance(uri, str):
            return NodeReply(errors=("fault",))
        try:
            with Api(uri, CALLER, Deadline(self.timeout)) as api:
                pid = api.process()
                info = _tried(errors, lambda: replies.unwrap(api.raw("getBusInfo", CALLER)))
                stats = _tried(errors, lambda: bus_stats.stats(api.raw("getBusStats", CALLER)))
        except Exception as error:  # whatever an untrusted peer provokes is that peer's result
            return NodeReply(uri, errors=(snapshot.reason(error),))
        links = None if info is None else tuple(link for link in replies.connections(info) if link.peer != CALLER)
        deadline = Deadline(self.timeout)
        greeted = {name: _tried(errors, partial(self._greet, name, at, deadline)) for name, at in errand.services}
        read = {action: _tried(errors, partial(self._goals, uri, action, deadline)) for action in errand.actions}
        services = {name: bool(answers) for name, answers in greeted.items()}
        actions = {action: goals for action, goals in read.items() if goals is not None}
        return NodeReply(uri, pid, stats, links, own_connections(info), services, actions, tuple(errors))

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


def _tried(errors: list[str], call: Callable[[], Any]) -> Any:
    """A call's result; None where there is none, and the reason goes to the errors."""
    try:
        return call()
    except Exception as error:  # whatever an untrusted peer provokes is that peer's result
        errors.append(snapshot.reason(error))
        return None


# ---- again and again


class Poller(threading.Thread):
    """A look after each scrape, which shows what the one before found, and never waits.

    So each scrape finds exactly one new look, and a rate over some minutes does not jump. Where nobody scrapes the
    graph is left alone. The thread is its own: what goes wrong here is told once, and delays nobody.
    """

    def __init__(
        self,
        observer: Observer,
        interval: float,
        updates: Updates,
        tell: Callable[[str], None],
        say: Callable[[str], None],
    ) -> None:
        """`interval` is that of one who scrapes: of many that do, looks come up to twice as often.

        `tell` gets what goes wrong, `say` the lines of updates, which others read.
        """
        super().__init__(daemon=True, name="poller")
        self.observer, self.interval, self.updates, self.tell, self.say = observer, interval, updates, tell, say
        self.memory = History()
        self.snapshot = Snapshot(errors=self.memory.errors)
        self.asked = self.ended = -math.inf  # when a look was asked for last, and when one ended
        self.due = threading.Event()  # until its end
        self.wrong = ""

    def run(self) -> None:
        while self.due.wait():
            try:
                self.poll()
                self.wrong = ""
            except Exception as error:  # a mistake of ours: the next poll may do
                told, self.wrong = self.wrong, f"{type(error).__name__}: {error}"
                if self.wrong != told:
                    self.tell(f"no metrics of the graph: {self.wrong}")
            self.due.clear()

    def scraped(self) -> Snapshot:
        """What the last look found. Of one that is long ago nothing is known of the graph any more."""
        now, found = time.monotonic(), self.snapshot
        if not self.due.is_set() and now - self.asked >= self.interval / 2:
            self.asked = now
            self.due.set()
        return found if now - self.ended < FRESH else replace(found, ros=GraphMetrics())

    def healthy(self) -> bool:
        """Whether looks come to an end."""
        return not self.due.is_set() or time.monotonic() - self.asked < STUCK

    def poll(self) -> None:
        """One look, and a new snapshot."""
        began, at = time.monotonic(), time.time()
        ros, self.memory = self._look()
        for line in self.updates.read(time.time()):
            self.say(line)
        self.ended = time.monotonic()
        self.snapshot = Snapshot(ros, self.memory.errors, self.memory.polls, self.ended - began, at)

    def _look(self) -> tuple[GraphMetrics, History]:
        try:
            state = self.observer.graph()
            errands = self.observer.errands(state)
            launched = self.observer.launched(errands)
        except Exception as error:  # whatever the master does, it is away
            return snapshot.master_away(self.memory, snapshot.reason(error))
        answers = self.observer.answers(errands)
        # the next poll's graph is asked anew, so a node that has moved is found
        return snapshot.next_poll(state, answers, self.memory, launched)
