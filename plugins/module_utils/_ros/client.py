# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""The ROS 1 graph over the network: what to ask the master, the nodes, topics and services. The only ROS I/O.

It reads and changes nothing: no registration, no parameter, no service call. Runs on Python 3.8 with the standard
library, on hosts and in pods.
"""

from __future__ import annotations

import math
import os
import selectors
import socket
import time
import xmlrpc.client
from functools import partial
from typing import Any, Callable, Iterable, Mapping, Sequence

from .._common.errors import RosError
from . import graph as _graph
from . import tcpros as _tcpros
from .graph import Graph, MasterState, NodeAnswer, Questions, Rate, ServiceProbe, StatusReading
from .rpc import Api, Deadline, TimedSocket, address_of, connect, handshake, in_parallel, read_frame, reason

ROS_ARGS: dict[str, dict[str, Any]] = {
    "master_uri": {"type": "str", "default": "http://localhost:11311"},
    "node_timeout": {"type": "float", "default": 2.0},
}

MAX_STATUS = 4 * 1024 * 1024
REFUSED_PAUSE = 0.05
TICK = 0.005  # read a stream in batches: waking up for each message would cost the robot's CPU


class RosMaster:
    """One ROS 1 graph, asked through its master. Nothing is kept between looks, so a node that moved is found."""

    def __init__(self, uri: str, timeout: float = 2.0, caller: str = "") -> None:
        self.uri = uri
        self.timeout = timeout
        # a caller id of its own: it shows up in the nodes' logs and connection lists
        self.caller = caller or f"/rosops_fleet_{os.getpid()}"
        address_of(uri, "http")
        if not (math.isfinite(timeout) and timeout > 0):
            raise RosError(f"a time-out of {timeout} s is not more than 0 s")

    # ---- the master

    def _master(self, calls: Sequence[tuple[str, ...]]) -> list[Any]:
        def task() -> list[Any]:
            with Api(self.uri, self.caller, Deadline(self.timeout)) as api:
                return api.calls(calls)

        def failed(_key: Any, error: BaseException) -> Any:
            return RosError(f"the ROS master does not answer: {reason(error, self.uri, self.timeout)}")

        # in a thread of its own only for the name look-up, which would not end with the deadline
        results: Any = in_parallel({"master": task}, self.timeout, failed)["master"]
        if isinstance(results, RosError):
            raise results
        return list(results)

    def state(self, types: bool = False) -> MasterState:
        results = self._master([("getSystemState",), ("getTopicTypes",)][: 2 if types else 1])
        for result in results:
            if isinstance(result, RosError):
                raise RosError(f"the ROS master at {self.uri} is not one: {result}")
        return _graph.master_state(*results)

    def _look_up(self, nodes: Iterable[str], services: Iterable[str]) -> tuple[dict[str, Any], dict[str, Any]]:
        """Addresses of nodes and services; a RosError in place of one that is not to be had."""
        calls = [*(("lookupNode", name) for name in nodes), *(("lookupService", name) for name in services)]
        results = self._master(calls) if calls else []
        found: dict[str, dict[str, Any]] = {"lookupNode": {}, "lookupService": {}}
        for (method, name), result in zip(calls, results):
            found[method][name] = result if isinstance(result, (str, RosError)) else RosError("it has no address")
        return found["lookupNode"], found["lookupService"]

    # ---- one look at nodes, services and actions

    def ask(self, state: MasterState, wanted: Questions) -> Graph:
        """Everything that is wanted, of all peers at the same time."""
        actions = {name: _graph.action_of(state, name).servers for name in wanted.actions}
        servers = {server for names in actions.values() for server in names}
        uris, service_uris = self._look_up(sorted({*wanted.nodes, *servers}), wanted.services)
        known = {name: uri for name, uri in uris.items() if isinstance(uri, str)}
        doubtful = _graph.shared_uris(known)
        tasks: dict[Any, Callable[[], Any]] = {}
        for name, calls in wanted.nodes.items():
            asked = calls | {"types"} if name in doubtful else calls
            tasks["node", name] = partial(self._node, uris[name], asked)
        for name in wanted.services:
            tasks["service", name] = partial(self._service, name, service_uris[name])
        for name, action_servers in actions.items():
            for server in action_servers:
                tasks["status", name, server] = partial(self.status, name, uris[server])

        def failed(key: Any, error: BaseException) -> Any:
            kind, name = key[0], key[1]
            found = service_uris[name] if kind == "service" else uris[key[-1]]
            where = found if isinstance(found, str) else ""
            why = reason(error, where or self.uri, self.timeout)
            if kind == "node":
                return NodeAnswer(where, error=why, refused=isinstance(error, ConnectionRefusedError))
            if kind == "service":
                return ServiceProbe(where, error=why)
            return StatusReading(error=why)

        results = in_parallel(tasks, self.timeout, failed)
        statuses: dict[str, dict[str, StatusReading]] = {name: {} for name in actions}
        for key, result in results.items():
            if key[0] == "status":
                statuses[key[1]][key[2]] = result
        answers = {key[1]: result for key, result in results.items() if key[0] == "node"}
        probes = {key[1]: result for key, result in results.items() if key[0] == "service"}
        return _graph.build(state, answers, probes, statuses)

    def _node(self, uri: Any, asked: frozenset[str]) -> NodeAnswer:
        try:
            return self._ask_node(uri, asked)
        except ConnectionRefusedError:
            time.sleep(min(REFUSED_PAUSE, self.timeout / 4))
            return self._ask_node(uri, asked)  # twice refused is dead; once may be a server that is just opening

    def _ask_node(self, uri: Any, asked: frozenset[str]) -> NodeAnswer:
        with Api(_address(uri), self.caller, Deadline(self.timeout)) as api:
            pid = api.call("getPid")
            if not isinstance(pid, int):
                raise RosError("its process id is not a number")
            # one connection, one call after the other: neither client library answers system.multicall
            return NodeAnswer(
                uri,
                pid,
                bus=_optional(api, "getBusInfo") if "bus" in asked else None,
                publications=_optional(api, "getPublications") if "types" in asked else None,
                subscriptions=_optional(api, "getSubscriptions") if "types" in asked else None,
            )

    def _service(self, name: str, uri: Any) -> ServiceProbe:
        """Shake hands as a client does before a call, and read the answer; the service itself is not called."""
        deadline = Deadline(self.timeout)
        with connect(*address_of(_address(uri), "rosrpc"), deadline) as sock:
            reply = handshake(sock, {"callerid": self.caller, "service": name, "md5sum": "*", "probe": "1"})
        return ServiceProbe(uri, reply.get("callerid", ""), reply.get("type", ""), md5sum=reply.get("md5sum", ""))

    def _subscribe(self, uri: str, topic: str, deadline: Deadline) -> tuple[TimedSocket, dict[str, str]]:
        """A connection that carries the topic's messages, without a registration: no graph tool will list us."""
        with Api(uri, self.caller, deadline) as api:
            transport = api.call("requestTopic", topic, [["TCPROS"]])
        if not (isinstance(transport, list) and transport[:1] == ["TCPROS"] and len(transport) >= 3):
            raise RosError(f"it offers no TCPROS for {topic}")
        host, port = transport[1:3]
        if not isinstance(host, str) or not isinstance(port, int) or not 0 < port < 65536:
            raise RosError(f"it offers {topic} at {host!r}, port {port!r}")
        sock = connect(host, port, deadline)
        try:
            fields = {"callerid": self.caller, "topic": topic, "md5sum": "*", "type": "*", "tcp_nodelay": "1"}
            header = handshake(sock, fields)
            sock.opened = time.monotonic()
            return sock, header
        except BaseException:
            sock.close()
            raise

    def status(self, action: str, uri: Any) -> StatusReading:
        """The latched status and, where no goal is open in it, the next one: servers publish it at 5 Hz."""
        readings: list[tuple[int, ...]] = []
        try:
            sock, header = self._subscribe(_address(uri), f"{action}/status", Deadline(self.timeout))
            with sock:
                if header.get("type", _graph.STATUS_TYPE) != _graph.STATUS_TYPE:
                    raise RosError(f"{action}/status carries {header['type']}, not {_graph.STATUS_TYPE}")
                while len(readings) < 2:
                    readings.append(_tcpros.decode_status(read_frame(sock, MAX_STATUS)))
                    if _graph.BUSY_STATES.intersection(readings[-1]):
                        break
        except (OSError, RosError) as error:
            if not readings:
                raise
            return StatusReading(tuple(readings), reason(error, uri, self.timeout))
        return StatusReading(tuple(readings))

    # ---- streams: md5sums and rates

    def _open(
        self, graph: Graph, sources: Sequence[tuple[str, str]]
    ) -> dict[tuple[str, str], tuple[TimedSocket, dict[str, str]] | str]:
        """A stream of each (topic, publisher) with its handshake, all at the same time; or why there is none."""
        uris: dict[str, Any] = {name: graph.nodes[name].uri for _topic, name in sources}
        uris.update(self._look_up(sorted(name for name, uri in uris.items() if not uri), ())[0])

        def task(topic: str, publisher: str) -> Any:
            return self._subscribe(_address(uris[publisher]), topic, Deadline(self.timeout))

        def failed(key: Any, error: BaseException) -> Any:
            where = uris[key[1]] if isinstance(uris[key[1]], str) else self.uri
            return f"{key[1]}: {reason(error, where, self.timeout)}"

        return in_parallel({key: partial(task, *key) for key in sources}, self.timeout, failed)

    def md5sums(self, graph: Graph, topics: Iterable[str]) -> dict[str, str]:
        """The md5sum that a publisher of each topic gives in its handshake; topics where none does are left out."""
        sources = []
        for topic in (graph.topics[name] for name in topics if name in graph.topics):
            alive = [name for name in topic.publishers if graph.nodes[name].reachable]
            sources += [(topic.name, name) for name in alive[:1]]
        found = {}
        for (name, _publisher), stream in self._open(graph, sources).items():
            if not isinstance(stream, str):
                stream[0].close()
                if stream[1].get("md5sum"):
                    found[name] = stream[1]["md5sum"]
        return found

    def rates(
        self, graph: Graph, seconds: Mapping[str, float], only: Mapping[str, Iterable[str]] | None = None
    ) -> dict[str, Rate]:
        """Count the messages of topics, all at the same time, each for its number of seconds.

        `only` names the publishers to count for some of the topics; of the others it is all.
        """
        sources = []
        for topic in (graph.topics[name] for name in seconds if name in graph.topics):
            wanted = set((only or {}).get(topic.name, topic.publishers))
            sources += [(topic.name, publisher) for publisher in topic.publishers if publisher in wanted]
        opened = self._open(graph, sources)
        counted = _count({key: one[0] for key, one in opened.items() if not isinstance(one, str)}, seconds)
        found = {}
        for topic_name in seconds:
            by = {key[1]: rate for key, rate in counted.items() if key[0] == topic_name}
            errors = {key[1]: one for key, one in opened.items() if key[0] == topic_name and isinstance(one, str)}
            parts = list(by.values())
            by.update({name: Rate(error=why) for name, why in errors.items()})
            if not parts:
                found[topic_name] = Rate(error="; ".join(errors.values()) or "no publisher", by=by)
                continue
            # one of several publishers may be gone: what the others send is still the topic's rate
            hz, messages = sum(rate.hz for rate in parts), sum(rate.messages for rate in parts)
            found[topic_name] = Rate(hz, messages, max(rate.seconds for rate in parts), by=by)
        return found


def _address(uri: Any) -> str:
    """An address from the master, or the error that stood in its place."""
    if isinstance(uri, RosError):
        raise uri
    return str(uri)


def _optional(api: Api, method: str) -> Any:
    """A node that answers its process id is alive; one call that it does not know leaves only that part unknown."""
    try:
        return api.call(method)
    except (RosError, xmlrpc.client.Fault):
        return None


def _count(sockets: Mapping[Any, TimedSocket], seconds: Mapping[str, float]) -> dict[Any, Rate]:
    """Read all streams until each topic's time is over. One thread; messages are skipped, not copied.

    A stream's time begins when it was opened: what it sent while others were still being opened (one dead peer takes
    its whole time-out) waits here and belongs to that time.
    """
    start = time.monotonic()
    counters = {key: _tcpros.FrameCounter() for key in sockets}
    ends = {key: start + seconds[key[0]] for key in sockets}
    buffer = bytearray(1 << 18)
    view = memoryview(buffer)
    rates: dict[Any, Rate] = {}
    with selectors.DefaultSelector() as selector:
        for key, sock in sockets.items():
            sock.setblocking(False)
            selector.register(sock, selectors.EVENT_READ, key)
        while True:
            at = time.monotonic()
            for key in [key for key in sockets if key not in rates and ends[key] <= at]:
                began = sockets[key].opened
                counter = counters[key]
                steady = counter.steady(began, at)
                rates[key] = Rate(counter.rate(began, at), counter.count, at - began, steady=steady)
                _leave(selector, sockets[key])
            if len(rates) == len(sockets):
                return rates
            for ready, _events in selector.select(timeout=TICK * 4):
                if not _drain(sockets[ready.data], view, counters[ready.data]):
                    _leave(selector, sockets[ready.data])  # the rest of its window is silence
            time.sleep(TICK)


def _leave(selector: selectors.BaseSelector, sock: TimedSocket) -> None:
    if sock.fileno() >= 0:
        selector.unregister(sock)
        sock.close()


def _drain(sock: TimedSocket, view: memoryview, counter: _tcpros.FrameCounter) -> bool:
    """Feed what has arrived; False at the stream's end."""
    for _read in range(16):  # one fast stream must not keep the others waiting
        try:
            size = socket.socket.recv_into(sock, view)
        except (BlockingIOError, InterruptedError):
            return True
        except OSError:
            return False
        if not size:
            return False
        counter.feed(view[:size], time.monotonic())
        if size < len(view):
            return True
    return True
