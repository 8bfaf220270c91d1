# SPDX-License-Identifier: GPL-3.0-or-later
"""The pod's own nodes: where they are, and what is said to them through their slave API.

Only a process of this very pod is ever spoken to: a registration may be stale, and its address another node's by now.
"""

from __future__ import annotations

import contextlib
import os
import select
import socket
import struct
import xmlrpc.client
from functools import partial
from pathlib import Path
from typing import Iterable, Iterator, Mapping, Sequence
from urllib.parse import urlsplit

from .._common.errors import RosError
from .._ros import registrations
from .._ros.backend import MasterState, Questions
from .._ros.client import Ros1Client
from .._ros.graph import Service, StatusReading, host_of, names_of
from .._ros.keeper_client import KeeperCalls
from .._ros.replies import connections
from .._ros.rpc import Api, Deadline, connect, in_parallel, reason, tell_publishers
from .params import forget
from .state import CALLER, TIMEOUT, Settings, State, load_state, ros_of, save_state

PROC = Path("/proc")
ESTABLISHED, LISTEN = "01", "0A"  # Linux, include/net/tcp_states.h
REPLY = 0.02  # s for an answer to a shutdown; what is sent by then is read, whatever becomes of us

# The kernel's word on connections: sock_diag(7), struct tcp_info of linux/tcp.h.
_NETLINK_SOCK_DIAG = 4
_BY_FAMILY, _REQUEST_DUMP = 20, 0x301
_ERROR, _DONE = 2, 3
_ESTABLISHED = 1 << 1
_WITH_INFO, _INFO = 1 << 1, 2  # inet_diag_req_v2.idiag_ext, and the attribute that it brings
_HEADER = struct.Struct("=LHHLL")
_QUESTION = struct.Struct("=BBBxL48x")
_MESSAGE = struct.Struct("!4x2H40x4x")  # the ports; after them come expires, rqueue, wqueue, uid, inode
_QUEUE = struct.Struct("=4xL12x")
_ATTRIBUTE = struct.Struct("=HH")
# ms since the last data went, and came, and since the peer last acknowledged any; segments of data that came and went
_SPOKE = struct.Struct("=44xL4x2L92x2L")
KERNEL = 1.0  # s for its answer


def is_here(uri: str) -> bool:
    """Whether the address is one of this pod: only an own one can be bound."""
    try:
        family, kind, protocol, _name, address = socket.getaddrinfo(host_of(uri), 0, type=socket.SOCK_STREAM)[0]
        with socket.socket(family, kind, protocol) as sock:
            sock.bind(address)
            return True
    except (OSError, ValueError):
        return False


def own_nodes(settings: Settings, seconds: float = TIMEOUT) -> tuple[list[OwnNode], str]:
    """The pod's own nodes; or why there are none.

    The one of the app's name is where an earlier call found it, else where the master says. Those of an app that names
    them itself are found by the pod's address. `seconds` is for each that is asked. A node that does not answer in them
    may be at work: only one whose port is closed is down.
    """
    expected, known = settings.node if settings.expect_node else "", load_state(settings.node)
    if expected and known.uri:
        node = OwnNode(expected, known.uri, known.services, settings)
        if node.process(seconds) == known.pid:
            return [node], ""
    ros = ros_of(os.environ, seconds)
    try:
        state = ros.state()
        if expected and expected not in state.nodes():
            return [], f"node {expected}: not registered with the master"
        names = [expected] if expected else list(names_here(ros, settings, state))
        services = {name: state.graph.node(name).services for name in names}
        asked = tuple(one for names in services.values() for one in names)
        graph = ros.ask(state, Questions({name: frozenset() for name in services}, asked))
    except RosError as error:
        return [], str(error)
    found = [graph.node(name) for name in services if graph.node(name).uri and not graph.node(name).refused]
    if not found:
        down = f"node {expected}: registered, but down: {graph.node(expected).error}"
        return [], down if expected else "no node is registered from this pod's address"
    if expected and not is_here(found[0].uri):
        return [], f"node {expected}: registered from {found[0].uri}, which is not this pod"
    uris = {node.name: service_uris(graph.services, services[node.name]) for node in found}
    if expected and found[0].reachable:
        save_state(expected, State(found[0].uri, found[0].pid, uris[expected]))
    return [OwnNode(node.name, node.uri, uris[node.name], settings) for node in found], ""


def places(ros: Ros1Client, settings: Settings, state: MasterState) -> dict[str, str]:
    """Name -> address of all nodes of the robot."""
    space = f"{settings.space.rstrip('/')}/"
    return ros.addresses([name for name in state.nodes() if name.startswith(space)])[0]


def names_here(ros: Ros1Client, settings: Settings, state: MasterState) -> dict[str, str]:
    """Name -> address of all nodes that are registered from this pod. None of them is asked."""
    known = places(ros, settings, state)
    hosts = {host_of(uri): uri for uri in known.values()}
    # all at once, and not for ever: a robot that is away from its resolver looks laptops' names up in vain
    here = in_parallel({host: partial(is_here, uri) for host, uri in hosts.items()}, ros.timeout, lambda *_: False)
    found = {name: uri for name, uri in known.items() if here[host_of(uri)]}
    if settings.host_network:  # then the address is that of others, too
        return {name: uri for name, uri in found.items() if listens_here(port_of(uri))}
    return found


def port_of(uri: str) -> int:
    """The port of a URI; 0 where it has none."""
    try:
        return urlsplit(uri).port or 0
    except ValueError:
        return 0


def listens_here(port: int) -> bool:
    """Whether a process of this container listens at the port. Another user's does not show it, and does not count."""
    sockets = {f"socket:[{inode}]" for own, state, inode in _sockets() if (own, state) == (port, LISTEN)}
    for file in PROC.glob("[0-9]*/fd/*"):
        with contextlib.suppress(OSError):
            if os.readlink(file) in sockets:
                return True
    return False


def _sockets() -> Iterator[tuple[int, str, str]]:
    """Own port, state and inode of the pod's TCP sockets.

    A row is `sl local_address rem_address st queues timer retransmits uid timeout inode ...`, an address
    `<hex>:<port in hex>`.
    """
    for table in (PROC / "net/tcp", PROC / "net/tcp6"):
        for row in table.read_text("ascii").splitlines()[1:] if table.exists() else ():
            fields = row.split()
            yield int(fields[1].rpartition(":")[2], 16), fields[3], fields[9]


def service_uris(found: Mapping[str, Service], names: Iterable[str]) -> dict[str, str]:
    return {name: found[name].said.uri for name in names if found[name].said.uri}


class OwnNode:
    """A living node of this pod, and what is done to it, each within so many seconds."""

    def __init__(self, name: str, uri: str, services: Mapping[str, str], settings: Settings) -> None:
        self.name, self.uri, self.services, self.settings = name, uri, services, settings

    def _api(self, seconds: float) -> Api:
        return Api(self.uri, CALLER, Deadline(seconds))

    def process(self, seconds: float = TIMEOUT) -> int | None:
        """Its process id; None if it does not answer as a node does."""
        try:
            with self._api(seconds) as api:
                return api.process()
        except Exception:  # whatever answers there is not our node
            return None

    def unregister(self, seconds: float = TIMEOUT) -> None:
        """Take everything of it out of the master. That compares addresses, so nobody else's registration is meant."""
        ros = ros_of(os.environ, seconds / 2)  # a question, and what follows from it
        has = registrations.from_master(ros.state(), {self.name: self.uri}, self.services)
        ros.calls([call.request for call in registrations.remove(has, [])])

    def forget(self, seconds: float = TIMEOUT) -> None:
        forget(self.settings, seconds)

    def hand_over(self, seconds: float = TIMEOUT) -> str:
        """Have the keeper take what it has latched; why not all of it."""
        keeper = self.settings.keeper
        return KeeperCalls(keeper, CALLER).keep_latched(self.name, self.uri, seconds) if keeper else ""

    def actions(self, seconds: float = TIMEOUT) -> Sequence[str]:
        """The actions that it serves: as the graph shows it, or as expected where there is no master to ask."""
        try:
            actions = ros_of(os.environ, seconds).state().graph.actions
        except RosError:
            return self.settings.actions
        return [name for name, action in actions.items() if self.name in names_of(action.servers)]

    def status(self, action: str, seconds: float = TIMEOUT) -> StatusReading:
        """Two statuses of an action that it serves, read from itself."""
        try:
            return ros_of(os.environ, seconds).status(action, self.uri)
        except Exception as error:
            return StatusReading(error=reason(error, self.uri, seconds))

    def isolate(self, action: str, seconds: float = TIMEOUT) -> None:
        """Cut it off from everybody who sends it goals: as if the master had said that nobody does."""
        tell_publishers(self.uri, f"{action}/goal", [], seconds, CALLER)

    def calls(self, seconds: float = TIMEOUT) -> int:
        """Calls of its services that are under way; where the kernel does not tell, all open connections count."""
        ports = {*map(port_of, self.services.values())}
        try:
            return calls_under_way(ports) if ports else 0
        except OSError:  # clients come to the same port as its topics' subscribers
            with self._api(seconds) as api:
                edges = connections(api.call("getBusInfo"))
            streams = sum(edge.direction == "o" and edge.transport == "TCPROS" for edge in edges)
            return max(0, sum(own in ports and state == ESTABLISHED for own, state, _inode in _sockets()) - streams)

    def shut_down(self, seconds: float = TIMEOUT) -> None:
        """Ask it to end, and do not wait: rospy answers when it has ended, or never.

        Whoever ends within a process 1 that ends takes part in its end: Kubernetes would say that the hook has failed.
        """
        body = xmlrpc.client.dumps((CALLER, "stopped by rosops.fleet"), "shutdown").encode()
        with contextlib.suppress(OSError), self._api(seconds) as api:
            api.http.sock = connect(api.http.host, api.http.port, api.deadline)
            api.http.request("POST", api.path, body, {"Content-Type": "text/xml"})
            select.select([api.http.sock], [], [], REPLY)


# ---- calls under way


def calls_under_way(ports: set[int]) -> int:
    """Connections to these ports whose client waits for an answer; OSError where the kernel does not tell.

    No node tells of its service connections. But in TCPROS whoever serves speaks last: on a connection whose client
    sent something that is not answered yet, a call is under way; a persistent client that rests, and a topic's
    subscriber, wait for the server to speak. The kernel says for every connection who spoke last.
    """
    return sum(
        _is_asking(info, unread)
        for family in (socket.AF_INET, socket.AF_INET6)
        for port, unread, info in _connections(family)
        if port in ports
    )


def _is_asking(info: bytes, unread: int) -> bool:
    if unread:
        return True
    if len(info) < _SPOKE.size:
        raise OSError("the kernel tells too little of its connections")
    since_sent, since_received, since_acknowledged, segments_in, segments_out = _SPOKE.unpack_from(info)
    if since_sent != since_received:
        return bool(since_received < since_sent)
    # Within one tick of the kernel's clock. What the peer acknowledged later than it last spoke is our answer.
    if since_acknowledged < since_received:
        return False
    # Small messages are one segment each. Who got large ones may have asked again at once, so is waited for; except a
    # topic's subscriber, who sends its header and nothing more.
    return bool(segments_in > segments_out or 1 < segments_in < segments_out)


def _connections(family: int) -> Iterator[tuple[int, int, bytes]]:
    """Own port, bytes that nobody has read, and tcp_info of every connection."""
    question = _QUESTION.pack(family, socket.IPPROTO_TCP, _WITH_INFO, _ESTABLISHED)
    with socket.socket(socket.AF_NETLINK, socket.SOCK_DGRAM, _NETLINK_SOCK_DIAG) as sock:
        sock.settimeout(KERNEL)
        sock.sendall(_HEADER.pack(_HEADER.size + len(question), _BY_FAMILY, _REQUEST_DUMP, 1, 0) + question)
        while True:
            reply = sock.recv(1 << 16)
            while reply:
                length, kind, _flags, _sequence, _port = _HEADER.unpack_from(reply)
                if kind == _DONE:
                    return
                if kind == _ERROR:
                    (number,) = struct.unpack_from("=i", reply, _HEADER.size)
                    raise OSError(-number, os.strerror(-number))
                yield _parsed(reply[_HEADER.size : length])
                reply = reply[(length + 3) & ~3 :]


def _parsed(message: bytes) -> tuple[int, int, bytes]:
    port, _peer = _MESSAGE.unpack_from(message)
    (unread,) = _QUEUE.unpack_from(message, _MESSAGE.size)
    rest = message[_MESSAGE.size + _QUEUE.size :]
    while len(rest) >= _ATTRIBUTE.size:
        length, kind = _ATTRIBUTE.unpack_from(rest)
        if kind == _INFO:
            return port, unread, rest[_ATTRIBUTE.size : length]
        rest = rest[max((length + 3) & ~3, _ATTRIBUTE.size) :]
    return port, unread, b""
