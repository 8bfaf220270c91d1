# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""The pod's own node, where it is and what is said to it, on loopback."""

from __future__ import annotations

import socket
import threading
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from ansible_collections.rosops.fleet.plugins.module_utils._common.errors import RosError
from ansible_collections.rosops.fleet.plugins.module_utils._pod import own_node, state
from ansible_collections.rosops.fleet.plugins.module_utils._pod.own_node import (
    OwnNode,
    established,
    find_node,
    is_here,
    listens_here,
    nodes_here,
)
from ansible_collections.rosops.fleet.plugins.module_utils._pod.state import Settings, State
from ansible_collections.rosops.fleet.tests.unit.plugins.fake_ros import Peers

NODE = "/arm"
SETTINGS, NAMELESS = Settings(NODE), Settings("")


@pytest.fixture
def peers(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Peers]:
    monkeypatch.setattr(state, "SCRATCH", str(tmp_path))
    made = Peers()
    yield made
    made.close()


class World:
    """A master, and a node that it knows under NODE."""

    def __init__(self, peers: Peers, monkeypatch: pytest.MonkeyPatch, **replies: Any) -> None:
        self.peers = peers
        self.told: list[tuple[Any, ...]] = []
        node = {"getPid": [1, "", 7], "publisherUpdate": self.note("update"), **replies}
        self.node = peers.api("node", node)
        topics = [[["/arm/state", [NODE]], ["/work/status", [NODE]]], [["/work/goal", [NODE]]], [["/arm/home", [NODE]]]]
        self.system: Any = [1, "", topics]
        self.address = self.node
        self.service = f"rosrpc://127.0.0.1:{peers.dead()}"
        self.master = peers.api(
            "master",
            {
                "getSystemState": lambda: self.system,
                "lookupNode": lambda _name: [1, "", self.address],
                "lookupService": lambda _name: [1, "", self.service],
                **{f"unregister{kind}": self.note(kind) for kind in ("Publisher", "Subscriber", "Service")},
            },
            multicall=True,
        )
        monkeypatch.setenv("ROS_MASTER_URI", self.master)

    def note(self, kind: str) -> Any:
        def call(*words: Any) -> list[Any]:
            self.told.append((kind, *words))
            return [1, "", 1]

        return call

    def asked(self, label: str) -> list[str]:
        return [method for name, method in self.peers.calls if name == label]

    def own(self) -> OwnNode:
        return OwnNode(NODE, self.node, {"/arm/home": self.service}, Settings(NODE, actions=["/other"]))


@pytest.fixture
def world(peers: Peers, monkeypatch: pytest.MonkeyPatch) -> World:
    return World(peers, monkeypatch)


# ---- where it is


def test_it_is_where_the_master_says_and_the_next_call_asks_no_master(world: World) -> None:
    node, why = find_node(SETTINGS)
    assert (node and node.uri, node and node.services, why) == (world.node, {"/arm/home": world.service}, "")
    world.peers.calls.clear()
    again, _why = find_node(SETTINGS)
    assert (again and again.uri, world.asked("master")) == (world.node, [])


def test_another_process_at_its_old_address_is_not_it(world: World) -> None:
    state.save_state(NODE, State(world.node, 6))
    node, _why = find_node(SETTINGS)
    assert node is not None
    assert world.asked("master")
    assert state.load_state(NODE).pid == 7


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"system": [1, "", [[], [], []]]}, "not registered with the master"),
        ({"address": "http://127.0.0.1:9/"}, "registered, but down: nothing listens at"),
        ({"system": [0, "no", 0]}, "is not one"),
    ],
)
def test_where_it_is_not(world: World, change: dict[str, Any], words: str) -> None:
    for name, value in change.items():
        setattr(world, name, value)
    node, why = find_node(SETTINGS)
    assert node is None
    assert words in why


def test_a_node_that_is_late_may_be_at_work(world: World) -> None:
    """On a busy robot: what it works on would be cut off, had it been left to SIGTERM."""
    world.address = f"http://127.0.0.1:{world.peers.hung()}/"
    node, why = find_node(SETTINGS, 0.2)
    assert (node and node.uri, why) == (world.address, "")
    assert state.load_state(NODE) == State()
    assert [one.uri for one in nodes_here(NAMELESS, 0.2)[0]] == [world.address]
    world.address = f"http://127.0.0.1:{world.peers.dead()}/"
    assert nodes_here(NAMELESS, 0.2) == ([], "no node is registered from this pod's address")


def test_a_node_of_another_pod_is_left_alone(world: World, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(own_node, "is_here", lambda _uri: False)
    assert find_node(SETTINGS) == (None, f"node {NODE}: registered from {world.node}, which is not this pod")


@pytest.mark.parametrize(
    ("uri", "here"),
    [("http://127.0.0.1:1/", True), ("http://192.0.2.7:1/", False), ("http://", False), ("http://[:1", False)],
)
def test_only_an_address_of_ones_own_can_be_bound(uri: str, here: bool) -> None:
    assert is_here(uri) is here


# ---- what is said to it


def test_it_is_taken_out_of_the_master_with_all_that_it_has(world: World) -> None:
    world.own().unregister()
    assert sorted(world.told) == [
        ("Publisher", "/arm/state", world.node),
        ("Publisher", "/work/status", world.node),
        ("Service", "/arm/home", world.service),
        ("Subscriber", "/work/goal", world.node),
    ]


def test_it_is_cut_off_from_who_sends_it_goals(world: World) -> None:
    world.own().isolate("/work")
    assert world.told == [("update", "/work/goal", [])]


def test_its_actions_are_those_of_the_graph_or_what_was_expected(world: World, monkeypatch: pytest.MonkeyPatch) -> None:
    assert world.own().actions() == ["/work"]
    monkeypatch.setenv("ROS_MASTER_URI", "http://127.0.0.1:9/")
    assert world.own().actions() == ["/other"]
    with pytest.raises(RosError, match="does not answer"):
        world.own().unregister()


def test_a_status_that_cannot_be_read_has_its_reason(world: World) -> None:
    found = world.own().status("/work")
    assert (found.readings, found.error.startswith("refused:")) == ((), True)


def test_a_node_that_does_not_answer_has_no_process(world: World) -> None:
    assert world.own().process() == 7
    for uri in (f"http://127.0.0.1:{world.peers.dead()}/", world.peers.api("odd", {"getPid": [1, "", "seven"]})):
        assert OwnNode(NODE, uri, {}, SETTINGS).process() is None


def test_where_the_kernel_does_not_tell_all_clients_count(peers: Peers, monkeypatch: pytest.MonkeyPatch) -> None:
    """Services and topics have one port: two clients and one subscriber there are two calls."""

    def untold(_ports: set[int]) -> int:
        raise PermissionError

    monkeypatch.setattr(own_node, "calls_under_way", untold)
    bus: list[list[Any]] = [[1, "/listener", "o", "TCPROS", "/arm/state", True]]
    world = World(peers, monkeypatch, getBusInfo=lambda: [1, "", bus])
    with socket.create_server(("127.0.0.1", 0)) as listener:
        at = listener.getsockname()
        world.service = f"rosrpc://127.0.0.1:{at[1]}"
        ends = [socket.create_connection(at) for _end in range(3)]
        accepted = [listener.accept()[0] for _end in range(3)]
        assert world.own().calls() == 2
        for end in (*ends, *accepted):
            end.close()
        assert world.own().calls() == 0


def test_nodes_of_the_pod_are_found_by_its_address(peers: Peers, monkeypatch: pytest.MonkeyPatch) -> None:
    """roslaunch names its nodes itself. Where the pod has the host's network, a process of it has to listen there."""
    world = World(peers, monkeypatch)
    (found,), reason = nodes_here(NAMELESS)
    assert (found.name, found.uri, found.services, reason) == (NODE, world.node, {"/arm/home": world.service}, "")
    (found,), _reason = nodes_here(replace(NAMELESS, host_network=True))
    assert found.name == NODE
    monkeypatch.setattr(own_node, "listens_here", lambda _port: False)
    assert nodes_here(replace(NAMELESS, host_network=True)) == ([], "no node is registered from this pod's address")
    assert (
        nodes_here(replace(NAMELESS, space="/robot2"))[0] == []
    )  # several robots share a master: the others' nodes are not asked
    assert nodes_here(replace(NAMELESS, space="/"))[0]
    world.address = "http://["  # whatever a stranger has registered
    assert nodes_here(NAMELESS) == ([], "no node is registered from this pod's address")
    monkeypatch.setenv("ROS_MASTER_URI", f"http://127.0.0.1:{peers.dead()}/")
    assert "nothing listens" in nodes_here(NAMELESS)[1]


def test_a_name_that_nobody_resolves_holds_up_no_probe(world: World, monkeypatch: pytest.MonkeyPatch) -> None:
    """The resolver takes its time where the robot is off the net, and a look-up cannot be interrupted."""
    answered = threading.Event()
    resolve = socket.getaddrinfo

    def look_up(host: str, *more: Any, **options: Any) -> Any:
        if host == "laptop":
            answered.wait(10)
        return resolve(host, *more, **options)

    monkeypatch.setattr(own_node.socket, "getaddrinfo", look_up)
    world.address = "http://laptop:4711/"
    began = time.monotonic()
    assert nodes_here(NAMELESS, 0.2) == ([], "no node is registered from this pod's address")
    assert time.monotonic() - began < 5
    answered.set()


def test_who_listens() -> None:
    with socket.create_server(("127.0.0.1", 0)) as listener:
        port = listener.getsockname()[1]
        assert listens_here(port)
    assert not listens_here(port)


def test_a_shutdown_does_not_wait_for_an_answer(peers: Peers) -> None:
    """rospy answers when it has ended, or never."""
    got, ended = threading.Event(), threading.Event()

    def talk(sock: socket.socket) -> None:
        data = b""
        while b"</methodCall>" not in data:
            data += sock.recv(65536) or b"</methodCall> that never came"
        if b"<methodName>shutdown</methodName>" in data:
            got.set()
        ended.wait(30)

    began = time.monotonic()
    OwnNode(NODE, f"http://127.0.0.1:{peers.tcp(talk)}/", {}, SETTINGS).shut_down()
    assert time.monotonic() - began < 5
    assert got.wait(5)
    ended.set()


def test_a_shutdown_of_what_is_gone_is_done(peers: Peers) -> None:
    OwnNode(NODE, f"http://127.0.0.1:{peers.dead()}/", {}, SETTINGS).shut_down()


TABLE = """\
  sl  local_address rem_address   st tx_queue rx_queue tr tm->when retrnsmt   uid  timeout inode
   0: 0100007F:9F6B 00000000:0000 0A 00000000:00000000 00:00000000 00000000     0        0 3487123 1
   1: 0100007F:9F6B 0100007F:BE2E 01 00000000:00000000 00:00000000 00000000     0        0 3487124 1
   2: 0100007F:BE2E 0100007F:9F6B 01 00000000:00000000 00:00000000 00000000     0        0 3487125 1
   3: 0100007F:9F6B 0100007F:BE30 06 00000000:00000000 03:00001000 00000000     0        0 0 3
"""


def test_established_counts_what_peers_hold_to_a_port() -> None:
    assert established([TABLE], {0x9F6B}) == 1
    assert established([TABLE, TABLE], {0x9F6B, 0xBE2E}) == 4
    assert established([TABLE], {1}) == 0
    assert established(["", "header only\n"], {1}) == 0
