# SPDX-License-Identifier: GPL-3.0-or-later
"""The kernel's tables as files of a made-up /proc, and once as the kernel has them."""

from __future__ import annotations

import contextlib
import socket
import struct
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from ansible_collections.rosops.fleet.plugins.module_utils._host.service_sockets import (
    ESTABLISHED,
    LISTEN,
    Namespace,
    ServiceConnections,
    Socket,
    local_addresses,
    namespaces,
    persistent,
    socket_rows,
    topic_ends,
)
from ansible_collections.rosops.fleet.plugins.module_utils._ros.graph import Connection, Graph, ServiceProbe
from ansible_collections.rosops.fleet.plugins.module_utils._ros.replies import NodeAnswer, build, master_state

POD, PORT = "10.42.1.9", 40133
HEADER = "  sl  local_address rem_address   st tx_queue rx_queue tr tm->when retrnsmt   uid  timeout inode\n"
FIB_TRIE = """Main:
  +-- 0.0.0.0/0 3 0 5
     |-- 10.42.1.0
        /24 link UNICAST
Local:
  +-- 0.0.0.0/0 3 0 5
     +-- 10.42.1.0/24 2 0 2
        |-- 10.42.1.0
           /32 link BROADCAST
        |-- {address}
           /32 host LOCAL
     +-- 127.0.0.0/8 2 0 2
           |-- 127.0.0.0
              /8 host LOCAL
           |-- 127.0.0.1
              /32 host LOCAL
        |-- 127.255.255.255
           /32 link BROADCAST
"""


def end(address: str, port: int) -> str:
    return f"{struct.unpack('=I', socket.inet_aton(address))[0]:08X}:{port:04X}"


def line(local: tuple[str, int], remote: tuple[str, int], state: str = "01", inode: int = 7) -> str:
    return (
        f"   0: {end(*local)} {end(*remote)} {state} 00000000:00000000 00:00000000 00000000     0        0 {inode} 1\n"
    )


ANYWHERE = "0.0.0.0"  # noqa: S104 - only text here
LISTENING = line((ANYWHERE, PORT), (ANYWHERE, 0), "0A")


class Proc:
    """A /proc of processes that each have a network namespace."""

    def __init__(self, root: Path) -> None:
        self.root = root
        self.process("self", "net:[1]", "192.0.2.1", "")

    def process(self, name: str, namespace: str, address: str, tcp: str) -> None:
        (self.root / name / "ns").mkdir(parents=True)
        (self.root / name / "net").mkdir()
        (self.root / name / "ns" / "net").symlink_to(namespace)
        (self.root / name / "net" / "fib_trie").write_text(FIB_TRIE.format(address=address))
        self.sockets(name, tcp)

    def sockets(self, name: str, tcp: str) -> None:
        (self.root / name / "net" / "tcp").write_text(HEADER + tcp)


@pytest.fixture
def proc(tmp_path: Path) -> Proc:
    return Proc(tmp_path)


# ---- the tables


def test_rows_of_both_families() -> None:
    mapped = "0000000000000000FFFF0000" + end(POD, 1)[:8]
    text = HEADER + line((POD, PORT), ("10.42.0.3", 55000)) + f"  1: {mapped}:9CC5 {mapped}:0001 01 0:0 0:0 0 0 0 8 1\n"
    assert list(socket_rows(text)) == [
        Socket((POD, PORT), ("10.42.0.3", 55000), "01", "7"),
        Socket((POD, PORT), (POD, 1), "01", "8"),
    ]
    loopback = "0" * 24 + f"{struct.unpack('=I', bytes([0, 0, 0, 1]))[0]:08X}"
    assert next(socket_rows(HEADER + f" 0: {loopback}:0001 {loopback}:0002 01 0 0 0 0 0 9 1\n")).local == ("::1", 1)
    assert list(socket_rows("")) == list(socket_rows(HEADER + "cut\n")) == []


def test_a_namespaces_own_addresses() -> None:
    assert list(local_addresses(FIB_TRIE.format(address=POD))) == [POD, "127.0.0.1"]


def test_each_namespace_is_read_once_and_ours_comes_first(proc: Proc) -> None:
    proc.process("20", "net:[2]", POD, LISTENING)
    proc.process("30", "net:[2]", "203.0.113.5", "")
    proc.process("4", "net:[1]", "203.0.113.6", "")
    (proc.root / "40").mkdir()  # one that ended meanwhile
    (proc.root / "sys").mkdir()
    found = namespaces(proc.root)
    assert list(found) == ["net:[1]", "net:[2]"]
    assert found["net:[1]"].addresses == {"192.0.2.1", "127.0.0.1"}
    assert (found["net:[2]"].addresses, len(found["net:[2]"].rows)) == (frozenset({POD, "127.0.0.1"}), 1)


def test_a_table_that_cannot_be_read_is_tried_at_the_namespaces_next_process(proc: Proc) -> None:
    proc.process("20", "net:[2]", POD, LISTENING)
    proc.process("30", "net:[2]", POD, LISTENING)
    (proc.root / "20" / "net" / "fib_trie").unlink()
    assert "net:[2]" in namespaces(proc.root)


def test_the_kernels_own_tables() -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:
        port = server.getsockname()[1]
        with socket.create_connection(("127.0.0.1", port)) as client, contextlib.closing(server.accept()[0]):
            own = next(iter(namespaces(Path("/proc")).values()))
            assert "127.0.0.1" in own.addresses
            rows = [row for row in own.rows if row.local[1] == port]
            assert sorted(row.state for row in rows) == [ESTABLISHED, LISTEN]
            assert client.getsockname() in [row.remote for row in rows]


# ---- what they say


def space(*rows: Socket, key: str = "pod", address: str = POD) -> dict[str, Namespace]:
    listening = Socket((ANYWHERE, PORT), (ANYWHERE, 0), "0A", "1")
    return {key: Namespace(frozenset({address, "127.0.0.1"}), frozenset({listening, *rows}))}


def held(port: int, inode: str = "7", local: int = PORT) -> Socket:
    return Socket((POD, local), ("10.42.0.3", port), "01", inode)


ENDING = Socket((POD, PORT), ("10.42.0.3", 1), "06", "0")


@pytest.mark.parametrize(
    ("before", "after", "number"),
    [
        ([held(1), held(2)], [held(1), held(2)], 2),
        ([held(1)], [held(2)], 0),  # calls, one after the other
        ([held(1)], [held(1, inode="8")], 0),  # the port was taken again
        ([], [held(1)], 0),
        ([held(1, local=5)], [held(1, local=5)], 0),  # the pod's own connections to others
        ([held(99)], [held(99)], 0),  # a topic's
        ([ENDING], [ENDING], 0),
    ],
)
def test_persistent_is_what_both_looks_show_and_no_topic_owns(before: Any, after: Any, number: int) -> None:
    topics = frozenset({("10.42.0.3", 99)})
    assert persistent(space(*before), space(*after), (POD, PORT), topics) == number


def test_a_provider_that_is_not_here_is_not_known() -> None:
    here = space(held(1))
    assert persistent(here, here, ("10.42.7.7", PORT), frozenset()) is None
    assert persistent(here, here, (POD, PORT + 1), frozenset()) is None  # it moved
    assert persistent({}, here, (POD, PORT), frozenset()) is None  # it has only just come
    assert persistent({}, {}, (POD, PORT), frozenset()) is None


def test_a_loopback_address_is_our_own_namespaces() -> None:
    both = {**space(key="own", address="192.0.2.1"), **space(held(1))}
    assert persistent(both, both, ("127.0.0.1", PORT), frozenset()) == 0


ROW = Connection("/t", "/b", "o", "TCPROS", True, "TCPROS connection on port 40133 to [10.42.0.3:55000 on socket 11]")


def test_the_far_ends_of_topics() -> None:
    incoming, local = replace(ROW, direction="i", info=""), replace(ROW, transport="INTRAPROCESS", info="")
    assert topic_ends((ROW, incoming, local)) == frozenset({("10.42.0.3", 55000)})
    assert topic_ends((ROW, replace(ROW, info=""))) is None  # an old client library
    assert topic_ends(()) == frozenset()
    assert topic_ends(None) is None


# ---- the count


class Clock:
    def __init__(self, proc: Proc) -> None:
        self.time, self.proc = 100.0, proc
        self.naps: list[float] = []

    def sleep(self, seconds: float) -> None:
        self.naps.append(seconds)
        self.proc.sockets("20", LISTENING + line((POD, PORT), ("10.42.0.3", 1)) + line((POD, PORT), ("10.42.0.3", 99)))


def provider(bus: Any) -> Graph:
    services = ["/add", "/adder/get_loggers", "/far", "/unnamed", "/unasked"]
    state = master_state([[], [], [[name, ["/adder"]] for name in services]])
    probes = {
        "/add": ServiceProbe(f"rosrpc://{POD}:{PORT}", "/adder"),
        "/adder/get_loggers": ServiceProbe(f"rosrpc://{POD}:{PORT}", error="it does not answer"),
        "/far": ServiceProbe("rosrpc://10.42.7.7:1", "/adder"),
        "/unnamed": ServiceProbe("rosrpc://no-such-host.invalid:1", "/adder"),
    }
    return build(state, {"/adder": NodeAnswer("http://h:1/", 1, bus=bus)}, probes)


BUS = [[1, "/ear", "o", "TCPROS", "/t", True, f"TCPROS connection on port {PORT} to [10.42.0.3:99 on socket 4]"]]


def test_the_count_by_service_over_half_a_second(proc: Proc) -> None:
    rows = [line((POD, PORT), ("10.42.0.3", port)) for port in (1, 2, 99)]
    proc.process("20", "net:[2]", POD, LISTENING + "".join(rows))
    clock = Clock(proc)
    sockets = ServiceConnections(proc.root, lambda: clock.time, clock.sleep)
    clock.time += 0.2  # the graph is read meanwhile
    assert sockets.count(provider(BUS)) == {"/add": 1, "/adder/get_loggers": 1}
    assert clock.naps == [pytest.approx(0.3)]
    clock.time += 5
    assert sockets.count(provider(None)) == {}
    assert len(clock.naps) == 1  # the graph took longer than that
