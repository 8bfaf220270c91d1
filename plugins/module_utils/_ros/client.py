# SPDX-License-Identifier: GPL-3.0-or-later
"""The ROS 1 graph over the network: what to ask the master, the nodes, topics and services.

It reads and changes nothing: no registration, no parameter, no service call.
"""

from __future__ import annotations

import time
from functools import partial
from typing import Any, Callable, Iterable, Mapping, Sequence

from .._common.documents import Data
from .._common.errors import RosError
from .backend import MasterState, Questions
from .bus_stats import stats
from .graph import BUSY_STATES, Graph, Handshake, NodeKey, Rate, ServiceProbe, Stats, StatusReading
from .names import is_keeper
from .replies import NodeAnswer, build, shared_uris
from .rpc import MAX_THREADS, Api, Deadline, Master, in_parallel, reason
from .streams import Opened, count_messages, greet, read_states, subscribe, subscribe_status

ROS_ARGS: dict[str, Data] = {
    "master_uri": {"type": "str", "default": "http://localhost:11311"},
    "node_timeout": {"type": "float", "default": 2.0},
}

REFUSED_PAUSE = 0.05


class Ros1Client(Master):
    """One ROS 1 graph, asked through its master: the `Backend` for ROS 1."""

    at_once = MAX_THREADS  # peers that are asked at the same time
    statuses = 2  # messages that are read of an action server

    def noted(self, key: tuple[str, ...], error: BaseException) -> None:
        """What went wrong with one question."""

    # ---- one look at nodes, services and actions

    def ask(self, state: MasterState, wanted: Questions) -> Graph:
        """Everything that is wanted, of all peers at the same time."""
        actions = {name: state.servers(name) for name in wanted.actions}
        servers = {server for names in actions.values() for server in names}
        uris, service_uris = self.look_up(sorted({*wanted.nodes, *servers}), wanted.services)
        known = {name: uri for name, uri in uris.items() if isinstance(uri, str)}
        doubtful = shared_uris(known)
        tasks: dict[tuple[str, ...], Callable[[], Any]] = {}
        for name, calls in wanted.nodes.items():
            tasks["node", name] = partial(self._node, uris[name], calls | {"types"} if name in doubtful else calls)
        for name in wanted.services:
            tasks["service", name] = partial(self._service, name, service_uris[name])
        for name, action_servers in actions.items():
            for server in action_servers:
                tasks["status", name, server] = partial(self.status, name, uris[server])

        def failed(key: Any, error: BaseException) -> Any:
            self.noted(key, error)
            found = service_uris[key[1]] if key[0] == "service" else uris[key[-1]]
            where = found if isinstance(found, str) else ""
            why, refused = reason(error, where or self.uri, self.timeout), isinstance(error, ConnectionRefusedError)
            if key[0] == "node":
                return NodeAnswer(where, error=why, refused=refused)
            return ServiceProbe(where, error=why) if key[0] == "service" else StatusReading((), why, refused)

        results = in_parallel(tasks, self.timeout, failed, self.at_once)
        return build(
            state,
            {name: results["node", name] for name in wanted.nodes},
            {name: results["service", name] for name in wanted.services},
            {name: {one: results["status", name, one] for one in of_it} for name, of_it in actions.items()},
        )

    def _node(self, uri: Any, asked: frozenset[str]) -> NodeAnswer:
        try:
            return self._ask_node(uri, asked)
        except ConnectionRefusedError:
            time.sleep(min(REFUSED_PAUSE, self.timeout / 4))
            return self._ask_node(uri, asked)  # twice refused is dead; once may be a server that is just opening

    def _ask_node(self, uri: Any, asked: frozenset[str]) -> NodeAnswer:
        with Api(_address(uri), self.caller, Deadline(self.timeout)) as api:
            pid = api.process()
            # one connection, one call after the other: neither client library answers system.multicall
            return NodeAnswer(
                uri,
                pid,
                bus=api.optional("getBusInfo", partial(self.noted, ("bus", uri))) if "bus" in asked else None,
                publications=api.optional("getPublications") if "types" in asked else None,
                subscriptions=api.optional("getSubscriptions") if "types" in asked else None,
                stats=self._stats(api, uri) if "stats" in asked else None,
            )

    def _stats(self, api: Api, uri: str) -> Stats | None:
        """What a node has counted; it lives, whatever becomes of that."""
        try:
            return stats(api.raw("getBusStats", self.caller))
        except Exception as error:  # whatever an untrusted peer provokes is that peer's result
            self.noted(("stats", uri), error)
            return None

    def _service(self, name: str, uri: Any) -> ServiceProbe:
        reply = greet(name, _address(uri), self.caller, Deadline(self.timeout))
        return ServiceProbe(uri, reply.get("callerid", ""), reply.get("type", ""), md5sum=reply.get("md5sum", ""))

    def status(self, action: str, uri: Any) -> StatusReading:
        """The latched status and, where no goal is open in it, the next one: servers publish it at 5 Hz."""
        readings: list[tuple[int, ...]] = []
        try:
            with subscribe_status(action, _address(uri), self.caller, Deadline(self.timeout)) as sock:
                while len(readings) < self.statuses:
                    readings.append(read_states(sock))
                    if BUSY_STATES.intersection(readings[-1]):
                        break
        except (OSError, RosError) as error:
            if not readings:
                raise
            return StatusReading(tuple(readings), reason(error, uri, self.timeout))
        return StatusReading(tuple(readings))

    # ---- streams: handshakes and rates

    def _open(
        self, graph: Graph, sources: Sequence[tuple[str, NodeKey]]
    ) -> tuple[dict[tuple[str, NodeKey], Opened], dict[tuple[str, NodeKey], str]]:
        """A stream of each (topic, publisher) with its handshake, all at the same time; and why there is none."""
        uris: dict[NodeKey, Any] = {key: graph.at(key).uri for _topic, key in sources}
        unknown = {key.name: key for key, uri in uris.items() if not uri}
        uris.update({unknown[name]: uri for name, uri in self.look_up(sorted(unknown))[0].items()})

        def task(topic: str, publisher: NodeKey) -> Any:
            return subscribe(topic, _address(uris[publisher]), self.caller, Deadline(self.timeout))

        def failed(key: Any, error: BaseException) -> Any:
            where = uris[key[1]] if isinstance(uris[key[1]], str) else self.uri
            return f"{key[1]}: {reason(error, where, self.timeout)}"

        opened = in_parallel({key: partial(task, *key) for key in sources}, self.timeout, failed)
        errors = {key: why for key, why in opened.items() if isinstance(why, str)}
        return {key: stream for key, stream in opened.items() if key not in errors}, errors

    def handshakes(self, graph: Graph, topics: Iterable[str]) -> dict[str, Handshake]:
        """What a publisher of each topic says; one that stands in for others only where there is nobody else."""
        sources = []
        for topic in (graph.topics[name] for name in topics if name in graph.topics):
            alive = [key for key in topic.publishers if graph.at(key).reachable]
            sources += [(topic.name, key) for key in sorted(alive, key=lambda key: is_keeper(key.name))[:1]]
        found = {}
        for (topic_name, publisher), (sock, header) in self._open(graph, sources)[0].items():
            sock.close()
            definition, latching = header.get("message_definition", ""), header.get("latching") == "1"
            found[topic_name] = Handshake(publisher, header.get("md5sum", ""), latching, definition)
        return found

    def rates(self, graph: Graph, seconds: Mapping[str, float], patient: bool = False) -> dict[str, Rate]:
        """See `Backend`. One of several publishers may be gone: what the others send is still the topic's rate."""
        sources = [(name, publisher) for name in seconds for publisher in graph.topic(name).publishers]
        streams, errors = self._open(graph, sources)
        counted = count_messages(streams, seconds, patient)
        return {
            name: Rate.of_all(
                {key: rate for (topic, key), rate in counted.items() if topic == name},
                {key: why for (topic, key), why in errors.items() if topic == name},
            )
            for name in seconds
        }


def _address(uri: Any) -> str:
    """An address from the master, or the error that stood in its place."""
    if isinstance(uri, RosError):
        raise uri
    return str(uri)
