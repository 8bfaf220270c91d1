# SPDX-License-Identifier: GPL-3.0-or-later
"""The pod's own node, where it is and what is said to it, on loopback."""

from __future__ import annotations

import contextlib
import socket
import struct
import threading
import time
from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any
from unittest.mock import Mock

import pytest
from ansible_collections.rosops.fleet.plugins.module_utils._common.errors import RosError
from ansible_collections.rosops.fleet.plugins.module_utils._pod import own_node, state
from ansible_collections.rosops.fleet.plugins.module_utils._pod.own_node import OwnNode, own_nodes
from ansible_collections.rosops.fleet.plugins.module_utils._pod.state import Settings, State
from ansible_collections.rosops.fleet.tests.unit.plugins.fake_ros import Peers, until

NODE = "/arm"
SETTINGS, NAMELESS = Settings(NODE, expect_node=True), Settings("")
NOBODY = ([], "no node is registered from this pod's address")


@pytest.fixture(autouse=True)
def _scratch(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(state, "SCRATCH", str(tmp_path))


class World:
    """A master, and a node that it knows under NODE."""

    def __init__(self, peers: Peers, monkeypatch: pytest.MonkeyPatch, **replies: Any) -> None:
        self.peers = peers
        self.told = Mock(return_value=[1, "", 1])
        node = {"getPid": [1, "", 7], "publisherUpdate": partial(self.told, "update"), **replies}
        self.node = peers.api("node", node)
        published, subscribed = ("/arm/state", "/work/status"), ("/work/goal", "/work/cancel")
        parts = (published, subscribed, ("/arm/home",))
        topics = [[[name, [NODE]] for name in part] for part in parts]
        self.system: Any = [1, "", topics]
        self.address = self.node
        self.service = f"rosrpc://127.0.0.1:{peers.dead()}"
        self.master = peers.api(
            "master",
            {
                "getSystemState": lambda: self.system,
                "lookupNode": lambda _name: [1, "", self.address],
                "lookupService": lambda _name: [1, "", self.service],
                **{f"unregister{kind}": partial(self.told, kind) for kind in ("Publisher", "Subscriber", "Service")},
            },
            multicall=True,
        )
        monkeypatch.setenv("ROS_MASTER_URI", self.master)

    def asked(self, label: str) -> list[str]:
        return [method for name, method in self.peers.calls if name == label]

    def own(self) -> OwnNode:
        return OwnNode(NODE, self.node, {"/arm/home": self.service}, Settings(NODE, actions=["/other"]))


@pytest.fixture
def world(peers: Peers, monkeypatch: pytest.MonkeyPatch) -> World:
    return World(peers, monkeypatch)


# ---- where it is


def test_it_is_where_the_master_says_and_the_next_call_asks_no_master(world: World) -> None:
    (node,), why = own_nodes(SETTINGS)
    assert (node.name, node.uri, node.services, why) == (NODE, world.node, {"/arm/home": world.service}, "")
    world.peers.calls.clear()
    (again,), _why = own_nodes(SETTINGS)
    assert (again.uri, world.asked("master")) == (world.node, [])


def test_another_process_at_its_old_address_is_not_it(world: World) -> None:
    state.save_state(NODE, State(world.node, 6))
    assert own_nodes(SETTINGS)[0]
    assert world.asked("master")
    assert state.load_state(NODE).pid == 7


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"system": [1, "", [[], [], []]]}, "not registered with the master"),
        ({"address": "http://127.0.0.1:9/"}, "registered, but down: nothing listens at"),
        ({"address": "http://192.0.2.7:1/"}, "registered from http://192.0.2.7:1/, which is not this pod"),
        ({"system": [0, "no", 0]}, "is not one"),
    ],
)
def test_where_it_is_not(world: World, change: dict[str, Any], words: str) -> None:
    vars(world).update(change)
    nodes, why = own_nodes(SETTINGS, 2.0)
    assert nodes == []
    assert words in why


@pytest.mark.parametrize("settings", [SETTINGS, NAMELESS])
def test_a_node_that_is_late_may_be_at_work(world: World, settings: Settings) -> None:
    """On a busy robot: what it works on would be cut off, had it been left to SIGTERM."""
    world.address = f"http://127.0.0.1:{world.peers.hung()}/"
    (node,), why = own_nodes(settings, 2.0)
    assert (node.uri, why) == (world.address, "")
    assert state.load_state(NODE) == State()
    world.address = f"http://127.0.0.1:{world.peers.dead()}/"
    assert own_nodes(settings, 20.0)[0] == []


@pytest.mark.parametrize(
    ("uri", "here"),
    [("http://127.0.0.1:1/", True), ("http://192.0.2.7:1/", False), ("http://", False), ("http://[:1", False)],
)
def test_only_an_address_of_ones_own_can_be_bound(uri: str, here: bool) -> None:
    assert own_node.is_here(uri) is here


# ---- what is said to it


def test_it_is_taken_out_of_the_master_with_all_that_it_has(world: World) -> None:
    world.own().unregister()
    assert sorted(call.args for call in world.told.call_args_list) == [
        ("Publisher", "/arm/state", world.node),
        ("Publisher", "/work/status", world.node),
        ("Service", "/arm/home", world.service),
        ("Subscriber", "/work/cancel", world.node),
        ("Subscriber", "/work/goal", world.node),
    ]


def test_it_is_cut_off_from_who_sends_it_goals(world: World) -> None:
    world.own().isolate("/work")
    world.told.assert_called_once_with("update", "/work/goal", [])


def test_its_actions_are_those_of_the_graph_or_what_was_expected(world: World, monkeypatch: pytest.MonkeyPatch) -> None:
    for part, name in ((0, "status"), (1, "goal"), (1, "cancel")):
        world.system[2][part].append([f"/their/{name}", ["/other"]])
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
    monkeypatch.setattr(own_node, "calls_under_way", Mock(side_effect=PermissionError))
    bus: list[list[Any]] = [[1, "/listener", "o", "TCPROS", "/arm/state", True]]
    world = World(peers, monkeypatch, getBusInfo=lambda: [1, "", bus])
    with socket.create_server(("127.0.0.1", 0)) as listener:
        world.service = f"rosrpc://127.0.0.1:{listener.getsockname()[1]}"
        clients = [Client(listener) for _number in range(3)]
        assert world.own().calls() == 2
        for client in clients:
            client.close()
        assert world.own().calls() == 0


def test_nodes_of_the_pod_are_found_by_its_address(world: World, monkeypatch: pytest.MonkeyPatch) -> None:
    """roslaunch names its nodes itself. Where the pod has the host's network, a process of it has to listen there."""
    (found,), reason = own_nodes(NAMELESS)
    assert (found.name, found.uri, found.services, reason) == (NODE, world.node, {"/arm/home": world.service}, "")
    (found,), _reason = own_nodes(replace(NAMELESS, host_network=True))
    assert found.name == NODE
    with monkeypatch.context() as elsewhere:
        elsewhere.setattr(own_node, "listens_here", lambda _port: False)
        assert own_nodes(replace(NAMELESS, host_network=True)) == NOBODY
    # of robots that share a master the others' nodes are not asked
    assert own_nodes(replace(NAMELESS, space="/robot2")) == NOBODY
    assert own_nodes(replace(NAMELESS, space="/"))[0]
    for world.address in ("http://[", "http://127.0.0.1:99999/"):  # whatever a stranger has registered
        assert own_nodes(replace(NAMELESS, host_network=True)) == NOBODY
    monkeypatch.setenv("ROS_MASTER_URI", f"http://127.0.0.1:{world.peers.dead()}/")
    assert "nothing listens" in own_nodes(NAMELESS)[1]


def test_a_name_that_nobody_resolves_holds_up_no_probe(world: World, monkeypatch: pytest.MonkeyPatch) -> None:
    """The resolver takes its time where the robot is off the net, and a look-up cannot be interrupted."""
    answered = threading.Event()
    resolve = socket.getaddrinfo

    def look_up(host: str, *more: Any, **options: Any) -> Any:
        if host == "laptop":
            answered.wait(60)
        return resolve(host, *more, **options)

    monkeypatch.setattr(own_node.socket, "getaddrinfo", look_up)
    world.address = "http://laptop:4711/"
    began = time.monotonic()
    assert own_nodes(NAMELESS, 0.2) == NOBODY
    assert time.monotonic() - began < 30
    answered.set()


def test_who_listens() -> None:
    with socket.create_server(("127.0.0.1", 0)) as listener:
        port = listener.getsockname()[1]
        assert own_node.listens_here(port)
    assert not own_node.listens_here(port)


def test_a_shutdown_does_not_wait_for_an_answer(peers: Peers) -> None:
    """rospy answers when it has ended, or never."""
    got, ended = list[bytes](), threading.Event()

    def talk(sock: socket.socket) -> None:
        while b"</methodCall>" not in b"".join(got):
            got.append(sock.recv(65536) or b"</methodCall> that never came")
        ended.wait(60)

    began = time.monotonic()
    OwnNode(NODE, f"http://127.0.0.1:{peers.tcp(talk)}/", {}, SETTINGS).shut_down()
    assert time.monotonic() - began < 30
    until(lambda: b"<methodName>shutdown</methodName>" in b"".join(got))
    ended.set()


def test_a_shutdown_of_what_is_gone_is_done(peers: Peers) -> None:
    OwnNode(NODE, f"http://127.0.0.1:{peers.dead()}/", {}, SETTINGS).shut_down()


def test_a_shutdown_of_what_takes_no_connection_ends_in_time() -> None:
    """As of a pod whose host has gone: the kernel alone would try for two minutes."""
    with socket.create_server(("127.0.0.1", 0), backlog=0) as full, contextlib.ExitStack() as guests:
        for _guest in range(2):
            guest = guests.enter_context(socket.socket())
            guest.setblocking(False)
            guest.connect_ex(full.getsockname())
        own = OwnNode(NODE, f"http://127.0.0.1:{full.getsockname()[1]}/", {}, SETTINGS)
        asked = threading.Thread(target=own.shut_down, args=(0.1,), daemon=True)
        asked.start()
        asked.join(60)
        assert not asked.is_alive()


# ---- calls under way


class Client:
    """Both ends of a connection."""

    def __init__(self, listener: socket.socket) -> None:
        self.end = socket.create_connection(listener.getsockname()[:2])
        self.server = listener.accept()[0]

    def asks(self, read: bool = True) -> None:
        self.end.sendall(b"question")
        if read:
            self.server.recv(100)

    def gets(self) -> None:
        self.server.sendall(b"answer")
        self.end.recv(100)

    def close(self) -> None:
        self.end.close()
        self.server.close()


@pytest.fixture(params=["127.0.0.1", "::1"])
def listener(request: pytest.FixtureRequest) -> Iterator[socket.socket]:
    family = socket.AF_INET6 if ":" in request.param else socket.AF_INET
    with socket.create_server((request.param, 0), family=family) as made:
        yield made


def test_a_call_is_a_question_without_an_answer(listener: socket.socket) -> None:
    ports = {listener.getsockname()[1]}
    with contextlib.closing(Client(listener)) as client:
        assert own_node.calls_under_way(ports) == 0  # somebody who has said nothing yet
        for read in (True, False):
            client.asks()
            client.gets()  # headers
            assert own_node.calls_under_way(ports) == 0  # a persistent client at rest, and a subscriber
            client.asks(read)
            assert own_node.calls_under_way(ports) == 1
            assert own_node.calls_under_way({1}) == 0
            client.gets()
            if not read:
                client.server.recv(100)
            assert own_node.calls_under_way(ports) == 0
        client.asks()
        client.gets()
        client.asks()
        client.end.close()  # it does not want the answer any more
        assert own_node.calls_under_way(ports) == 0


def test_every_connection_counts(listener: socket.socket) -> None:
    with contextlib.ExitStack() as ends:
        clients = [ends.enter_context(contextlib.closing(Client(listener))) for _number in range(40)]
        for client in clients[::2]:
            client.asks()
        assert own_node.calls_under_way({listener.getsockname()[1]}) == 20


@pytest.mark.parametrize(
    ("sent", "received", "acknowledged", "segments", "asking"),
    [
        (9, 8, 8, (2, 1), True),
        (8, 9, 4, (2, 2), False),
        (8, 9, 9, (6, 5), False),
        # all within one tick of the kernel's clock
        (104, 104, 104, (6, 5), True),
        (104, 104, 60, (6, 6), False),  # the answer was acknowledged, 40 ms later as is usual
        (0, 0, 0, (6, 6), False),
        (104, 104, 60, (34, 6), False),  # it asks with an image and rests: it was waited for as long as it was there
        (168, 168, 168, (34, 5), True),
        (168, 168, 168, (1, 1), False),
        (168, 168, 168, (1, 34), False),  # a subscriber of a latched map
        (4, 4, 4, (6, 29), True),  # it got a map, and asked again at once: that call was cut off
    ],
)
def test_who_spoke_last(sent: int, received: int, acknowledged: int, segments: tuple[int, int], asking: bool) -> None:
    """`segments` of data that came and went; the rest is ms since then."""
    tcp_info = struct.pack("=44xL4x2L92x2L", sent, received, acknowledged, *segments)
    assert own_node._is_asking(tcp_info, 0) is asking
    assert own_node._is_asking(tcp_info, 1)
    with pytest.raises(OSError, match="too little"):
        own_node._is_asking(b"", 0)


def test_what_the_kernel_refuses_is_an_error(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(own_node, "_BY_FAMILY", 9999)
    with pytest.raises(OSError, match="Invalid argument"):
        own_node.calls_under_way({1})
