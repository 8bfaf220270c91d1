# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""The pod's own nodes: where they are, and what is said to them through their slave API.

Only a process of this very pod is ever spoken to: a registration may be stale, and its address another node's by now.
"""

from __future__ import annotations

import contextlib
import os
import select
import socket
import xmlrpc.client
from functools import partial
from pathlib import Path
from typing import Iterable, Iterator, Mapping, Sequence
from urllib.parse import urlsplit

from .._common.errors import RosError
from .._ros.backend import MasterState, Questions
from .._ros.client import Ros1Client
from .._ros.graph import Node, Service, StatusReading, host_of
from .._ros.keeper_client import KeeperCalls
from .._ros.replies import connections
from .._ros.rpc import Api, Deadline, in_parallel, reason, tell_publishers
from .calls import calls_under_way
from .params import forget
from .state import CALLER, TIMEOUT, Settings, State, load_state, ros_of, save_state

ESTABLISHED, LISTEN = "01", "0A"  # Linux, include/net/tcp_states.h
REPLY = 0.02  # s for an answer to a shutdown; what is sent by then is read, whatever becomes of us


def is_here(uri: str) -> bool:
    """Whether the address is one of this pod: only an own one can be bound."""
    try:
        family, kind, protocol, _name, address = socket.getaddrinfo(host_of(uri), 0, type=socket.SOCK_STREAM)[0]
        with socket.socket(family, kind, protocol) as sock:
            sock.bind(address)
    except (OSError, ValueError):
        return False
    return True


def state_of(node: Node, services: Mapping[str, str]) -> State:
    """What later calls need to know without a master."""
    return State(node.uri, node.pid, services)


def find_node(settings: Settings, seconds: float = TIMEOUT) -> tuple[OwnNode | None, str]:
    """The own node where an earlier call found it, else where the master says; or why there is none.

    `seconds` is for each that is asked. A node that does not answer in them may be at work: only one whose port is
    closed is down.
    """
    name, known = settings.node, load_state(settings.node)
    if known.uri:
        node = OwnNode(name, known.uri, known.services, settings)
        if node.process(seconds) == known.pid:
            return node, ""
    ros = ros_of(os.environ, seconds)
    try:
        state = ros.state()
        if name not in state.nodes():
            return None, f"node {name}: not registered with the master"
        services = state.graph.node(name).services
        graph = ros.ask(state, Questions({name: frozenset()}, services))
    except RosError as error:
        return None, str(error)
    found = graph.node(name)
    if found.refused or not found.uri:
        return None, f"node {name}: registered, but down: {found.error}"
    if not is_here(found.uri):
        return None, f"node {name}: registered from {found.uri}, which is not this pod"
    uris = service_uris(graph.services, services)
    if found.reachable:
        save_state(name, state_of(found, uris))
    return OwnNode(name, found.uri, uris, settings), ""


def names_here(ros: Ros1Client, settings: Settings, state: MasterState) -> dict[str, str]:
    """Name -> address of all nodes that are registered from this pod. None of them is asked."""
    space = f"{settings.space.rstrip('/')}/"
    known = ros.addresses([name for name in state.nodes() if name.startswith(space)])[0]
    places = {host_of(uri): uri for uri in known.values()}
    # all at once, and not for ever: a robot that is away from its resolver looks laptops' names up in vain
    here = in_parallel({host: partial(is_here, uri) for host, uri in places.items()}, ros.timeout, lambda *_: False)
    found = {name: uri for name, uri in known.items() if here[host_of(uri)]}
    if settings.host_network:  # then the address is that of others, too
        return {name: uri for name, uri in found.items() if listens_here(urlsplit(uri).port or 0)}
    return found


def nodes_here(settings: Settings, seconds: float = TIMEOUT) -> tuple[list[OwnNode], str]:
    """All ROS nodes of the pod, found by its address, for an app that names them itself; or why there are none."""
    ros = ros_of(os.environ, seconds)
    try:
        state = ros.state()
        named = names_here(ros, settings, state)
        found = ros.ask(state, Questions({name: frozenset() for name in named}))
        here = [name for name in named if not found.node(name).refused]
        services = {name: state.graph.node(name).services for name in here}
        asked = ros.ask(state, Questions({}, tuple(name for names in services.values() for name in names))).services
    except RosError as error:
        return [], str(error)
    nodes = [OwnNode(name, found.node(name).uri, service_uris(asked, services[name]), settings) for name in here]
    return nodes, "" if nodes else "no node is registered from this pod's address"


def listens_here(port: int, proc: Path = Path("/proc")) -> bool:
    """Whether a process of this container listens at the port. Another user's does not show it, and does not count."""
    sockets = {
        f"socket:[{fields[9]}]"
        for fields in _rows(_tables(proc))
        if fields[3] == LISTEN and int(fields[1].rpartition(":")[2], 16) == port
    }
    for file in proc.glob("[0-9]*/fd/*"):
        with contextlib.suppress(OSError):
            if os.readlink(file) in sockets:
                return True
    return False


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
        state = ros.state()
        name, uri, has = self.name, self.uri, state.graph.node(self.name)
        calls = [("unregisterService", name, *one) for one in self.services.items() if one[0] in state.services]
        calls += [("unregisterPublisher", name, topic, uri) for topic in has.publications]
        calls += [("unregisterSubscriber", name, topic, uri) for topic in has.subscriptions]
        ros.calls(calls)

    def forget(self, seconds: float = TIMEOUT) -> None:
        """Take its parameters off the server."""
        forget(self.settings, seconds)

    def hand_over(self, seconds: float = TIMEOUT) -> str:
        """Have the keeper take what it has latched; why not all of it."""
        keeper = self.settings.keeper
        return KeeperCalls(keeper, CALLER).keep_latched(self.name, self.uri, seconds) if keeper else ""

    def actions(self, seconds: float = TIMEOUT) -> Sequence[str]:
        """The actions that it serves: as the graph shows it, or as expected where there is no master to ask."""
        try:
            state = ros_of(os.environ, seconds).state()
        except RosError:
            return self.settings.actions
        published = state.graph.node(self.name).publications
        names = [topic[: -len("/status")] for topic in published if topic.endswith("/status")]
        return [name for name in names if self.name in state.subscribers.get(f"{name}/goal", ())]

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
        ports = {urlsplit(uri).port or 0 for uri in self.services.values()}
        try:
            return calls_under_way(ports) if ports else 0
        except OSError:
            return self.connections(ports, seconds)

    def connections(self, ports: set[int], seconds: float) -> int:
        """Open connections of clients to its services, which come to the same port as its topics' subscribers."""
        with self._api(seconds) as api:
            edges = connections(api.call("getBusInfo"))
        streams = sum(edge.direction == "o" and edge.transport == "TCPROS" for edge in edges)
        return max(0, established(_tables(Path("/proc")), ports) - streams)

    def shut_down(self, seconds: float = TIMEOUT) -> None:
        """Ask it to end, and do not wait: rospy answers when it has ended, or never.

        Whoever ends within a process 1 that ends takes part in its end: Kubernetes would say that the hook has failed.
        """
        body = xmlrpc.client.dumps((CALLER, "stopped by rosops.fleet"), "shutdown").encode()
        with contextlib.suppress(OSError), self._api(seconds) as api:
            api.http.request("POST", api.path, body, {"Content-Type": "text/xml"})
            select.select([api.http.sock], [], [], REPLY)


def established(tables: Iterable[str], ports: set[int]) -> int:
    """Connections that peers hold to one of our ports, in the text of /proc/net/tcp and /proc/net/tcp6."""
    return sum(fields[3] == ESTABLISHED and int(fields[1].rpartition(":")[2], 16) in ports for fields in _rows(tables))


def _tables(proc: Path) -> list[str]:
    return [path.read_text("ascii") for path in (proc / "net/tcp", proc / "net/tcp6") if path.exists()]


def _rows(tables: Iterable[str]) -> Iterator[list[str]]:
    """A row is `sl local_address rem_address st queues timer retransmits uid timeout inode ...`.

    An address is `<hex>:<port in hex>`.
    """
    for table in tables:
        yield from (fields for row in table.splitlines()[1:] for fields in [row.split()] if len(fields) > 9)
