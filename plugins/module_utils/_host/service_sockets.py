# SPDX-License-Identifier: GPL-3.0-or-later
"""Who holds a connection to a service, which no ROS API tells: read from the kernel's tables of sockets.

A client with a persistent proxy does not connect again by itself when the service moves, so an update wants to know of
it before. The provider's pod runs on this host in a network namespace of its own, and its sockets stand in
/proc/<pid>/net/tcp of any of its processes: the app itself is not touched. A client library listens for services and
topics at the same port, so the connections that the node knows as its topics' are taken off. What is left and still
there half a second later is no single call. Other processes' namespaces can be read by root only.
"""

from __future__ import annotations

import ipaddress
import os
import re
import socket
import struct
import time
from functools import partial
from pathlib import Path
from typing import Callable, Iterator, Mapping, NamedTuple, Tuple

from .._common.errors import RosError
from .._ros.graph import Connection, Graph, names_of
from .._ros.rpc import address_of, in_parallel

PERSISTENT_SECONDS = 0.5  # a plain call takes milliseconds
RESOLVE_SECONDS = 2.0

ESTABLISHED, LISTEN = "01", "0A"  # of TCP, as the kernel writes them
_REMOTE = re.compile(r" to \[(?P<host>[^\s\]]+):(?P<port>\d+) on socket ")

End = Tuple[str, int]


class Socket(NamedTuple):
    """One TCP or UDP socket."""

    local: End
    remote: End
    state: str
    inode: str


class Namespace(NamedTuple):
    """The TCP sockets of one network namespace, and the addresses that are its own."""

    addresses: frozenset[str]
    rows: frozenset[Socket]


# ---- the kernel's tables


def _end(text: str) -> End:
    """'0100007F:2B67' -> ('127.0.0.1', 11111): words in the machine's own byte order."""
    words, _colon, port = text.partition(":")
    packed = struct.pack(f"={len(words) // 8}I", *(int(words[at : at + 8], 16) for at in range(0, len(words), 8)))
    address = ipaddress.ip_address(packed)
    return str(getattr(address, "ipv4_mapped", None) or address), int(port, 16)


def socket_rows(text: str) -> Iterator[Socket]:
    """The rows of /proc/<pid>/net/tcp, tcp6, udp or udp6."""
    for line in text.splitlines()[1:]:
        fields = line.split()
        if len(fields) >= 10:
            yield Socket(_end(fields[1]), _end(fields[2]), fields[3], fields[9])


def local_addresses(text: str) -> Iterator[str]:
    """The namespace's own IPv4 addresses, from /proc/<pid>/net/fib_trie."""
    address = ""
    for line in text.splitlines():
        if "|-- " in line:
            address = line.rpartition(" ")[2]
        elif "/32 host LOCAL" in line:
            yield address


def namespaces(proc: Path) -> dict[str, Namespace]:
    """Every network namespace that may be read, one process of each asked; our own comes first."""
    numbers = sorted((one for one in proc.iterdir() if one.name.isdigit()), key=lambda one: int(one.name))
    found: dict[str, Namespace] = {}
    for process in [proc / "self", *numbers]:
        try:
            key = os.readlink(process / "ns" / "net")  # Path.readlink came with Python 3.9
            if key not in found:
                net = process / "net"
                tables = [net / "tcp", *([net / "tcp6"] if (net / "tcp6").exists() else [])]
                rows = frozenset(row for table in tables for row in socket_rows(table.read_text()))
                found[key] = Namespace(frozenset(local_addresses((net / "fib_trie").read_text())), rows)
        except (OSError, ValueError):
            continue  # it ended meanwhile, or is not ours to look at
    return found


# ---- what they say of a service


def topic_ends(connections: tuple[Connection, ...] | None) -> frozenset[End] | None:
    """The far ends of a node's topic connections; None where the node does not tell them all."""
    if connections is None:
        return None
    ends = set()
    for one in connections:
        if one.direction == "i" or one.transport != "TCPROS":
            continue
        remote = _REMOTE.search(one.info)
        if not remote:
            return None
        ends.add((remote["host"], int(remote["port"])))
    return frozenset(ends)


def persistent(
    before: Mapping[str, Namespace], after: Mapping[str, Namespace], at: End, topics: frozenset[End]
) -> int | None:
    """How many connections at that address stood in both looks and are no topic's; None where it is not here."""
    address, port = at
    # every namespace has the loopback addresses: that one which this process would reach is its own
    for key in list(after)[: 1 if ipaddress.ip_address(address).is_loopback else None]:
        own, rows = after[key]
        listens = any(row.state == LISTEN and row.local[1] == port for row in rows)
        if address in own and listens and key in before:
            connected = (row for row in rows & before[key].rows if row.state == ESTABLISHED and row.local[1] == port)
            return sum(row.remote not in topics for row in connected)
    return None


class ServiceConnections:
    """Make it before the graph is read, count after: what the graph does not know as a topic's is not newer than it."""

    def __init__(
        self,
        proc: Path = Path("/proc"),
        now: Callable[[], float] = time.monotonic,
        sleep: Callable[[float], None] = time.sleep,
    ) -> None:
        self.proc, self.now, self.sleep = proc, now, sleep
        self.before = namespaces(proc)
        self.at = now()

    def count(self, graph: Graph) -> dict[str, int]:
        """By service; one whose provider is not on this host, or does not tell its topics' connections, is left out."""
        left = self.at + PERSISTENT_SECONDS - self.now()
        if left > 0:
            self.sleep(left)
        after = namespaces(self.proc)
        found = {}
        for name, end in _resolved(graph).items():
            service = graph.services[name]
            provider = service.said.provider or (*names_of(service.providers), "")[0]
            topics = topic_ends(graph.node(provider).connections)
            number = persistent(self.before, after, end, topics) if topics is not None else None
            if number is not None:
                found[name] = number
        return found


def _resolved(graph: Graph) -> dict[str, End]:
    """The IPv4 address and port of each service; what does not resolve is left out."""

    def resolve(uri: str) -> End:
        host, port = address_of(uri, "rosrpc")
        return socket.gethostbyname(host), port

    def failed(_uri: str, error: BaseException) -> End:
        if not isinstance(error, (OSError, UnicodeError, RosError)):
            raise error
        return "", 0

    # many services share an address, and a name's look-up may hang
    uris = {name: service.said.uri for name, service in graph.services.items() if service.said.uri}
    found = in_parallel({uri: partial(resolve, uri) for uri in set(uris.values())}, RESOLVE_SECONDS, failed)
    return {name: found[uri] for name, uri in uris.items() if found[uri][0]}
