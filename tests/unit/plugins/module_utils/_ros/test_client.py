# SPDX-License-Identifier: GPL-3.0-or-later
"""The backend against the recorded graph, served over loopback, and against the same graph with peers gone wrong."""

from __future__ import annotations

import socket
import struct
import time
from collections.abc import Iterator
from typing import Any

import pytest
from ansible_collections.rosops.fleet.plugins.module_utils._common.errors import RosError
from ansible_collections.rosops.fleet.plugins.module_utils._common.poll import PASS, WAIT
from ansible_collections.rosops.fleet.plugins.module_utils._ros.backend import Questions, everything
from ansible_collections.rosops.fleet.plugins.module_utils._ros.client import Ros1Client
from ansible_collections.rosops.fleet.plugins.module_utils._ros.conditions import conditions_from
from ansible_collections.rosops.fleet.plugins.module_utils._ros.gate import look
from ansible_collections.rosops.fleet.plugins.module_utils._ros.graph import Handshake, Rate, names_of
from ansible_collections.rosops.fleet.plugins.module_utils._ros.graph_json import graph_data
from ansible_collections.rosops.fleet.plugins.module_utils._ros.tcpros import encode_header
from ansible_collections.rosops.fleet.tests.unit.plugins.fake_ros import DEAD, Peers, frames, recorded

SHORT = 1.0  # where something hangs; what answers must do so within it on a busy machine, too


def framed(body: bytes) -> bytes:
    return struct.pack("<I", len(body)) + body


class Replay:
    """The recorded graph on loopback: what a test changes in `nodes` or `services` before `start` goes wrong."""

    def __init__(self, peers: Peers) -> None:
        self.peers = peers
        self.tcpros = self.peers.tcpros(self.answers)
        self.nodes = {name: self.node(name, replies) for name, replies in recorded("nodes").items()}
        self.nodes[DEAD] = f"http://127.0.0.1:{self.peers.dead()}/"
        self.services: dict[str, str] = {}
        self.statuses = [frames("statuses", "never had a goal")[1]] * 2
        self.messages: list[bytes] = []
        self.state = recorded("master")["getSystemState with a client"]
        self.handshakes: list[dict[str, str]] = []

    def node(self, name: str, replies: dict[str, Any]) -> str:
        known = {call: reply for call, reply in replies.items() if "fault" not in reply}
        known["requestTopic"] = lambda topic, _: (
            [1, "ready", ["TCPROS", "127.0.0.1", self.tcpros]]
            if topic in self.published(name)
            else [-1, f"Not a publisher of [{topic}]", []]
        )
        return self.peers.api(name, known)

    def published(self, name: str) -> list[str]:
        return [topic for topic, nodes in self.state[2][0] if name in nodes]

    def answers(self, fields: dict[str, str]) -> Iterator[bytes]:
        self.handshakes.append(fields)
        if fields.get("service") == "/trigger":
            yield framed(frames("services", "/trigger by rospy")[0])
        elif "service" in fields:
            yield framed(frames("services", "/rosout/get_loggers by roscpp, unknown service")[0])
        elif fields["topic"] == "/work/status":
            yield framed(frames("statuses", "active")[0])
            yield from map(framed, self.statuses)
        else:
            yield framed(frames("topics", "/chatter by rospy")[0])
            yield from self.messages

    def start(self, multicall: bool = True, timeout: float = 10) -> Ros1Client:
        def look_up(names: dict[str, str], name: str) -> list[Any]:
            return [1, "", names[name]] if name in names else [-1, f"unknown node [{name}]", ""]

        services = {"/trigger": f"rosrpc://127.0.0.1:{self.tcpros}", **self.services}
        replies = {
            **{call: reply for call, reply in recorded("master").items() if " " not in call},
            "getSystemState": lambda: self.state,
            "lookupNode": lambda name: look_up(self.nodes, name),
            "lookupService": lambda name: look_up(services, name),
        }
        return Ros1Client(self.peers.api("master", replies, multicall), timeout, "/test")

    def calls_of(self, label: str) -> list[str]:
        return [method for name, method in self.peers.calls if name == label]


@pytest.fixture
def ros(peers: Peers) -> Replay:
    return Replay(peers)


def judge(master: Ros1Client, **params: Any) -> dict[tuple[str, str], tuple[str, str]]:
    seen = look(master, conditions_from(params))
    return {(check.kind, check.name): (check.verdict, check.reason) for check in seen.checks if check.kind != "master"}


# ---- the master


@pytest.mark.parametrize(("uri", "timeout"), [("master:11311", 2.0), ("http://m", 2.0), ("http://m:1", 0.0)])
def test_options_that_cannot_be(uri: str, timeout: float) -> None:
    with pytest.raises(RosError):
        Ros1Client(uri, timeout)


# ---- one look


@pytest.mark.parametrize("multicall", [True, False])
def test_a_look_at_the_recorded_graph(ros: Replay, multicall: bool) -> None:
    seen = judge(
        ros.start(multicall),
        nodes=["/talker_a", "/relay", DEAD, "/nobody"],
        topics=[
            {"name": "/chatter", "type": "std_msgs/String", "publishers": 2, "connected": True},
            {"name": "/chatter_relay", "connected": True},
        ],
        services=[{"name": "/trigger"}],
        actions=[{"name": "/work", "state": "idle"}],
        absent=["/gone"],
    )
    unmet = {key: reason for key, (verdict, reason) in seen.items() if verdict != PASS}
    down = f"nothing listens at {ros.nodes[DEAD]}"
    assert unmet == {
        ("node", DEAD): f"registered, but down: {down}",
        ("node", "/nobody"): "not registered with the master",
    }
    assert f"3 subscribers connected to 2 publishers; down, so not counted: {DEAD}" in seen["topic", "/chatter"][1]
    assert seen["service", "/trigger"] == (PASS, "served by /helper")
    assert seen["action", "/work"] == (PASS, "idle on /worker, seen twice")


def test_only_what_is_needed_is_asked(ros: Replay) -> None:
    master = ros.start()
    judge(master, nodes=["/talker_a"])
    assert ros.calls_of("talker_a") == []  # labels are full names
    assert ros.calls_of("/talker_a") == ["getPid"]
    assert ros.calls_of("/talker_b") == []
    assert "getTopicTypes" not in ros.calls_of("master")
    judge(master, topics=[{"name": "/chatter_relay", "connected": True, "type": "std_msgs/String"}])
    assert ros.calls_of("/relay") == ["getPid", "getBusInfo", "getPublications", "getSubscriptions"]
    assert ros.calls_of("/listener_relay") == ["getPid", "getPublications", "getSubscriptions"]


def test_hung_nodes_cost_one_time_out_together(ros: Replay) -> None:
    for name in ("/talker_b", "/listener_a", "/helper", "/worker"):
        ros.nodes[name] = f"http://127.0.0.1:{ros.peers.hung()}/"
    ros.services["/trigger"] = f"rosrpc://127.0.0.1:{ros.peers.hung()}"
    master = ros.start(timeout=SHORT)
    start = time.monotonic()
    seen = judge(
        master,
        nodes=["/talker_a", "/talker_b", "/listener_a", "/helper", "/worker", DEAD],
        topics=[{"name": "/chatter", "connected": True}],
        services=[{"name": "/trigger"}],
        actions=[{"name": "/work"}],
    )
    assert time.monotonic() - start < 6 * SHORT  # one after the other they would take 7
    assert seen["node", "/talker_a"][0] == PASS
    assert seen["topic", "/chatter"][0] == WAIT  # one look tells nobody who hangs from who is late
    for key in (("node", "/talker_b"), ("service", "/trigger"), ("action", "/work")):
        assert seen[key][0] == WAIT
        assert "within 1 s" in seen[key][1]


@pytest.mark.parametrize(
    ("uri", "reason"),
    [
        (None, "unknown node [/relay]"),  # it left between the two questions
        ("rosrpc://h:1", "'rosrpc://h:1' is not http://host:port"),
        (7, "it has no address"),
        ({"getPid": [1, "", "7"]}, "its process id is not a number"),
    ],
)
def test_a_node_that_cannot_be_asked(ros: Replay, uri: Any, reason: str) -> None:
    there = {} if uri is None else {"/relay": ros.peers.api("odd", uri) if isinstance(uri, dict) else uri}
    ros.nodes = {**{name: one for name, one in ros.nodes.items() if name != "/relay"}, **there}
    seen = judge(ros.start(), nodes=["/relay", "/talker_a"])
    assert seen["node", "/relay"] == (WAIT, f"registered, but down: {reason}")
    assert seen["node", "/talker_a"][0] == PASS


def test_a_dead_node_whose_port_a_living_one_took(ros: Replay) -> None:
    ros.nodes[DEAD] = ros.nodes["/listener_relay"]
    seen = judge(ros.start(), nodes=["/listener_relay", DEAD])
    assert seen["node", "/listener_relay"][0] == PASS
    assert seen["node", DEAD][0] == WAIT
    assert "another node answers" in seen["node", DEAD][1]


# ---- services


@pytest.mark.parametrize(
    ("uri", "words"),
    [
        ("rosrpc://127.0.0.1:{dead}", "not served: nothing listens at rosrpc://127.0.0.1:"),
        ("rosrpc://127.0.0.1:{hung}", "not served: no answer from rosrpc://127.0.0.1:"),
        ("rosrpc://127.0.0.1:{closes}", "not served: the connection was closed"),
        ("rosrpc://127.0.0.1:{cut}", "not served: the connection was closed in the middle of a message"),
        ("rosrpc://127.0.0.1:{long}", "not served: a message of 4294967295 bytes"),
        ("rosrpc://127.0.0.1:{stranger}", "/stranger answers at rosrpc://127.0.0.1:"),
        ("http://127.0.0.1:1", "is not rosrpc://host:port"),
    ],
)
def test_a_service_that_is_not_there(ros: Replay, uri: str, words: str) -> None:
    ports = {
        "dead": ros.peers.dead(),
        "hung": ros.peers.hung(),
        "closes": ros.peers.tcp(lambda sock: sock.recv(65536)),
        "cut": ros.peers.tcp(lambda sock: (sock.recv(65536), sock.sendall(b"\x10\x00\x00\x00abc"))),
        "long": ros.peers.tcp(lambda sock: (sock.recv(65536), sock.sendall(b"\xff\xff\xff\xff"))),
        "stranger": ros.peers.tcpros(lambda _: [encode_header({"callerid": "/stranger"})]),
    }
    ros.services["/trigger"] = uri.format(**ports)
    verdict, reason = judge(ros.start(timeout=SHORT), services=[{"name": "/trigger"}])["service", "/trigger"]
    assert verdict == WAIT
    assert words in reason


def test_the_services_reply_is_read(ros: Replay) -> None:
    """roscpp takes the connection of a probe for a service that it no longer has; only its reply says so."""
    ros.services["/relay/get_loggers"] = f"rosrpc://127.0.0.1:{ros.tcpros}"
    seen = judge(ros.start(), services=[{"name": "/relay/get_loggers"}])
    verdict, reason = seen["service", "/relay/get_loggers"]
    assert (verdict, "refused: received a tcpros connection for a nonexistent service" in reason) == (WAIT, True)
    assert ros.handshakes == [{"callerid": "/test", "service": "/relay/get_loggers", "md5sum": "*", "probe": "1"}]


# ---- actions


def test_a_goal_that_was_on_its_way_at_the_first_status_is_busy(ros: Replay) -> None:
    ros.statuses = [frames("statuses", name)[1] for name in ("never had a goal", "active")]
    busy = (WAIT, "busy on /worker: 1 ACTIVE")
    assert judge(ros.start(), actions=[{"name": "/work", "state": "idle"}])["action", "/work"] == busy


def test_a_status_that_comes_only_once_is_not_idle(ros: Replay) -> None:
    ros.statuses = ros.statuses[:1]
    master = ros.start(timeout=SHORT)
    verdict, reason = judge(master, actions=[{"name": "/work", "state": "idle"}])["action", "/work"]
    assert (verdict, reason.startswith("idle on /worker, seen once only: no answer from")) == (WAIT, True)
    assert judge(master, actions=[{"name": "/work"}])["action", "/work"][0] == PASS


# ---- rates


def test_rates_are_counted_over_all_publishers_or_those_asked_for(ros: Replay) -> None:
    ros.messages = [framed(b"hello") * 30]
    master = ros.start()
    graph = master.ask(master.state(), Questions({"/talker_a": frozenset(), "/talker_b": frozenset()}))
    rates = master.rates(graph, {"/chatter": 0.6, "/chatter_relay": 0.4, "/nothing": 0.1})
    rate = rates["/chatter"]
    assert {key.name: part.messages for key, part in rate.by.items()} == {"/talker_a": 30, "/talker_b": 30}
    assert (rate.messages, rate.hz) == (60, sum(part.hz for part in rate.by.values()))
    assert (rate.seconds >= 0.6, rates["/chatter_relay"].messages) == (True, 30)
    assert rates["/nothing"] == Rate(error="no publisher")
    wanted = {"callerid": "/test", "topic": "/chatter", "md5sum": "*", "type": "*", "tcp_nodelay": "1"}
    assert ros.handshakes.count(wanted) == 2
    alone = graph.published_by({"/chatter": ["/talker_b"]})
    assert names_of(master.rates(alone, {"/chatter": 0.2})["/chatter"].by) == ["/talker_b"]
    assert ros.handshakes.count(wanted) == 3


def test_handshakes_come_from_the_first_publisher_that_lives(ros: Replay) -> None:
    ros.nodes["/talker_a"] = f"http://127.0.0.1:{ros.peers.dead()}/"
    master = ros.start()
    graph = master.ask(master.state(), everything(master.state()))
    md5sum = "992ce8a1687cec8c8bd883ec73ca41d1"
    assert master.handshakes(graph, ["/chatter", "/chatter_relay", "/nothing", "/work/result"]) == {
        "/chatter": Handshake(graph.node("/talker_b").key, md5sum),
        "/chatter_relay": Handshake(graph.node("/relay").key, md5sum),
        "/work/result": Handshake(graph.node("/worker").key, md5sum),
    }


def test_a_refusal_that_comes_once_is_no_death(ros: Replay, monkeypatch: pytest.MonkeyPatch) -> None:
    ask_node = Ros1Client._ask_node
    refusals = [ConnectionRefusedError()]

    def once(self: Ros1Client, uri: Any, asked: frozenset[str]) -> Any:
        if refusals:
            raise refusals.pop()
        return ask_node(self, uri, asked)

    monkeypatch.setattr(Ros1Client, "_ask_node", once)
    assert judge(ros.start(), nodes=["/relay"])["node", "/relay"][0] == PASS


@pytest.mark.parametrize(
    ("a", "b", "messages", "error"),
    [("dead", "dead", 0, "/talker_a: nothing listens at"), ("hung", "", 5, ""), ("dead", "", 5, "")],
)
def test_who_is_gone_leaves_the_others_rate(ros: Replay, a: str, b: str, messages: int, error: str) -> None:
    ros.messages = [framed(b"hello") * 5]
    for name, what in (("/talker_a", a), ("/talker_b", b)):
        if what:
            ros.nodes[name] = f"http://127.0.0.1:{getattr(ros.peers, what)()}/"
    master = ros.start(timeout=SHORT)
    rate = master.rates(master.ask(master.state(), Questions()), {"/chatter": 0.5})["/chatter"]
    assert (rate.messages, rate.error.startswith(error), bool(rate.error)) == (messages, True, bool(error))
    of = {key.name: part.error for key, part in rate.by.items()}
    assert of["/talker_a"].startswith("/talker_a: " + {"dead": "nothing listens at", "hung": "no answer from"}[a])


def test_a_publisher_that_closes_the_stream(ros: Replay) -> None:
    def talk(sock: socket.socket) -> None:
        sock.recv(65536)
        sock.sendall(encode_header({"callerid": "/relay"}) + framed(b"last") * 3)

    port = ros.peers.tcp(talk)
    ros.nodes["/relay"] = ros.peers.api("closing", {"requestTopic": [1, "", ["TCPROS", "127.0.0.1", port]]})
    master = ros.start()
    rate = master.rates(master.ask(master.state(), Questions()), {"/chatter_relay": 0.3})["/chatter_relay"]
    assert (rate.messages, rate.hz < 11) == (3, True)


def test_a_topic_called_status_that_is_no_actions(ros: Replay) -> None:
    port = ros.peers.tcpros(lambda _fields: [encode_header({"type": "std_msgs/String"})])
    ros.nodes["/worker"] = ros.peers.api("odd", {"requestTopic": [1, "", ["TCPROS", "127.0.0.1", port]]})
    told = judge(ros.start(), actions=[{"name": "/work"}])["action", "/work"][1]
    assert "/work/status carries std_msgs/String, not actionlib_msgs/GoalStatusArray" in told


@pytest.mark.parametrize("offer", [[], ["UDPROS", "h", 1], ["TCPROS"], ["TCPROS", 5, 5], ["TCPROS", "h", 0], "TCPROS"])
def test_a_publisher_that_offers_nothing_usable(ros: Replay, offer: Any) -> None:
    ros.nodes["/relay"] = ros.peers.api("odd", {"requestTopic": [1, "", offer]})
    master = ros.start()
    rates = master.rates(master.ask(master.state(), Questions()), {"/chatter_relay": 0.1})
    assert "it offers" in rates["/chatter_relay"].error


# ---- the whole graph


def test_everything(ros: Replay) -> None:
    master = ros.start()
    state = master.state(types=True)
    graph = graph_data(master.ask(state, everything(state)))
    assert [name for name, node in graph["nodes"].items() if not node["reachable"]] == [DEAD]
    assert [name for name, node in graph["nodes"].items() if node["refused"]] == [DEAD]
    trigger, unknown = graph["services"]["/trigger"], graph["services"]["/relay/get_loggers"]
    assert (trigger["provider"], trigger["md5sum"]) == ("/helper", "937c9679a518e3a18d831e57125ea522")
    assert (unknown["error"], unknown["up"]) == ("unknown node [/relay/get_loggers]", False)
    assert graph["actions"]["/work"]["up"] is True
    assert {"publisher": "/relay", "subscriber": "/listener_relay"} in graph["topics"]["/chatter_relay"]["connections"]
