# SPDX-License-Identifier: GPL-3.0-or-later
"""Peers on loopback that are dead, hung, slow, or wrong. Nothing here waits longer than the time-out under test."""

from __future__ import annotations

import socket
import threading
import time
from collections.abc import Callable
from functools import partial
from types import SimpleNamespace
from typing import Any

import pytest
from ansible_collections.rosops.fleet.plugins.module_utils._common.errors import RefusalError, RosError
from ansible_collections.rosops.fleet.plugins.module_utils._ros import rpc
from ansible_collections.rosops.fleet.plugins.module_utils._ros.backend import Questions
from ansible_collections.rosops.fleet.plugins.module_utils._ros.client import Ros1Client
from ansible_collections.rosops.fleet.plugins.module_utils._ros.rpc import (
    Api,
    Deadline,
    Master,
    address_of,
    in_parallel,
    reason,
)
from ansible_collections.rosops.fleet.tests.unit.plugins.fake_ros import Peers, read_request, until

SHORT = 0.3


def ask(uri: str, method: str = "getPid", seconds: float = SHORT) -> Any:
    with Api(uri, "/test", Deadline(seconds)) as api:
        return api.call(method)


def why(uri: str, seconds: float = SHORT) -> str:
    """The reason that a call gives, and that it gave it in time."""
    start = time.monotonic()
    with pytest.raises(Exception) as caught:
        ask(uri, seconds=seconds)
    assert time.monotonic() - start < seconds + 30
    return reason(caught.value, uri, seconds)


# ---- addresses


@pytest.mark.parametrize(
    ("uri", "expected"),
    [
        ("http://127.0.0.1:11311", ("127.0.0.1", 11311)),
        ("http://robot7:4711/", ("robot7", 4711)),
        ("http://[fd00::1]:11311/", ("fd00::1", 11311)),
    ],
)
def test_addresses(uri: str, expected: tuple[str, int]) -> None:
    assert address_of(uri, "http") == expected


@pytest.mark.parametrize(
    "uri",
    ["", "robot7", "robot7:11311", "https://robot7:1", "http://robot7", "http://:1", "http://h:99999", "http://h:x",
     "http://[h:1", "rosrpc://h:1", "http://h:0"],
)  # fmt: skip
def test_what_is_no_address(uri: str) -> None:
    with pytest.raises(RosError, match="is not http://host:port"):
        address_of(uri, "http")


# ---- calls


def test_one_connection_serves_all_calls(peers: Peers) -> None:
    uri = peers.api("node", {"getPid": [1, "", 7], "echo": lambda *args: [1, "", list(args)]})
    with Api(uri, "/test", Deadline(5)) as api:
        api.call("getPid")
        kept = api.http.sock
        assert api.call("echo", "a", [["TCPROS"]]) == ["a", [["TCPROS"]]]
        assert api.http.sock is kept
        assert kept is not None


def test_a_kept_connection_that_the_peer_dropped_is_opened_again(peers: Peers) -> None:
    uri = peers.api("node", {"getPid": [1, "", 7]})
    with Api(uri, "/test", Deadline(5)) as api:
        api.call("getPid")
        assert api.http.sock is not None
        api.http.sock.shutdown(socket.SHUT_RDWR)
        assert api.call("getPid") == 7


@pytest.mark.parametrize(
    ("uri", "words"),
    [
        ("http://127.0.0.1:{dead}/", "nothing listens at {uri}"),
        ("http://127.0.0.1:{hung}/", "no answer from {uri} within 1 s"),
        ("http://no-such-host.invalid:11311/", "the name in {uri} does not resolve here"),
    ],
)
def test_a_peer_that_is_not_there(peers: Peers, uri: str, words: str) -> None:
    uri = uri.format(dead=peers.dead(), hung=peers.hung())
    assert why(uri, 1.0) == words.format(uri=uri)


def test_a_peer_that_drips_bytes_cannot_hold_us(peers: Peers) -> None:
    """Each byte comes well within the time-out; the whole does not."""
    ended = threading.Event()

    def talk(sock: socket.socket) -> None:
        sock.sendall(b"HTTP/1.1 200 OK\r\nContent-Length: 1000\r\n\r\n")
        for _byte in range(1000):
            sock.sendall(b"x")
            if ended.wait(0.05):
                return

    uri = f"http://127.0.0.1:{peers.tcp(talk)}/"
    assert why(uri).startswith("no answer")
    ended.set()


def reply(body: bytes, status: bytes = b"200 OK", length: int | None = None) -> bytes:
    return b"HTTP/1.1 %s\r\nContent-Length: %d\r\n\r\n" % (status, len(body) if length is None else length) + body


VALUE = b"<?xml version='1.0'?><methodResponse><params><param><value>%s</value></param></params></methodResponse>"


@pytest.mark.parametrize(
    ("data", "words"),
    [
        (b"", "closed connection without response"),
        (reply(b"not xml"), "not plain XML-RPC"),
        (reply(b"<?xml version='1.0'?><methodResponse>"), "nonsense"),
        (reply(b"", b"404 Not Found"), "HTTP status 404"),
        (reply(VALUE % b"<i4>7</i4>"), "not [code, message, value]"),
        (reply(b"<?xml", length=500), "nonsense"),
        (reply(b"x" * 100, length=rpc.MAX_REPLY * 10), "not plain XML-RPC"),
        (b"HTTP/1.1 200 OK\r\n" + b"X: y\r\n" * 200, "nonsense"),
    ],
    ids=["nothing", "text", "cut", "404", "shape", "short", "long", "headers"],
)
def test_a_peer_that_talks_nonsense(peers: Peers, data: bytes, words: str) -> None:
    def talk(sock: socket.socket) -> None:
        read_request(sock)
        sock.sendall(data)

    told = why(f"http://127.0.0.1:{peers.tcp(talk)}/", 2)
    assert words in told
    assert len(told) < 300


def test_a_reply_that_is_too_long(peers: Peers, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(rpc, "MAX_REPLY", 1000)
    assert "longer than 1000 bytes" in why(peers.api("node", {"getPid": [1, "x" * 1000, 7]}), 2)


# ---- several calls


@pytest.mark.parametrize("multicall", [True, False])
def test_several_calls_with_and_without_multicall(peers: Peers, multicall: bool) -> None:
    replies = {"getPid": [1, "", 7], "lookupNode": lambda name: [-1, f"unknown node [{name}]", ""]}
    uri = peers.api("master", replies, multicall=multicall)
    with Api(uri, "/test", Deadline(5)) as api:
        results = api.calls(
            [(name, "/test", *more) for name, *more in (["getPid"], ["lookupNode", "/x"], ["noSuchCall"], ["getPid"])]
        )
    assert [results[0], results[3]] == [7, 7]
    assert [type(result) for result in results[1:3]] == [RefusalError, RosError]
    assert str(results[1]) == "unknown node [/x]"
    assert "refused" in str(results[2])


# ---- at the same time


def test_tasks_run_at_the_same_time_and_each_has_its_own_result_in_time() -> None:
    """Also one that raises whatever it is, and one that cannot be interrupted: that is left behind."""
    release, start = threading.Event(), time.monotonic()
    together = threading.Barrier(20, timeout=10)

    def task(number: int) -> str:
        together.wait()  # passes only when all twenty are in it
        if number == 7:
            raise RecursionError("deep")
        return str(release.wait(60)) if number == 8 else "fine"

    results = in_parallel(
        {n: partial(task, n) for n in range(20)}, 2.0, lambda n, error: f"{n}: {reason(error, 'u', 2.0)}"
    )
    release.set()
    assert time.monotonic() - start < 30
    late = {7: "7: u answered nonsense (RecursionError: deep)", 8: "8: no answer from u within 2 s"}
    assert list(results.items()) == [(n, late.get(n, "fine")) for n in range(20)]


def test_more_tasks_than_threads_take_turns_and_none_begins_after_the_end() -> None:
    assert in_parallel({n: partial(int, n) for n in range(50)}, 5, lambda *_: -1, 3) == {n: n for n in range(50)}
    release = threading.Event()
    begun, ended = list[int](), list[int]()

    def late(number: int) -> str:
        begun.append(number)
        release.wait(30)
        ended.append(number)
        return "done"

    tasks = {number: partial(late, number) for number in range(4)}
    assert in_parallel(tasks, 0.05, lambda *_: "late", 2) == dict.fromkeys(range(4), "late")
    release.set()
    until(lambda: len(ended) == 2)
    assert sorted(begun) == [0, 1]


# ---- a master that a hundred robots share: its graph is read again only where it says something new

LONG = 60.0  # for a busy machine to write and read 6 MB


def small(nodes: int) -> list[Any]:
    return [[[f"/a_topic_of_a_robot/{number}", [f"/node_{number}"]] for number in range(nodes)], [], []]


class Fleet:
    """A master with its answers; `state` may change."""

    def __init__(self, peers: Peers, state: list[Any]) -> None:
        self.state = state
        answers = {"getSystemState": lambda: [1, "", self.state], "getTopicTypes": [1, "", []]}
        self.uri = peers.api("master", answers, multicall=True)


@pytest.fixture
def parsed(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """The lengths of replies that were parsed."""
    found, parse = list[int](), rpc._parsed
    monkeypatch.setattr(rpc, "_parsed", lambda reply: found.append(len(reply)) or parse(reply))
    return found


def test_a_graph_of_a_hundred_robots_is_read(peers: Peers, parsed: list[int]) -> None:
    assert len(Ros1Client(Fleet(peers, small(32_000)).uri, LONG).state().publishers) == 32_000
    assert max(parsed) > 6_000_000


# ---- a look costs what changed


def test_the_same_reply_is_the_same_state(peers: Peers, parsed: list[int]) -> None:
    fleet = Fleet(peers, small(500))
    ros = Ros1Client(fleet.uri, LONG)
    for types in (False, True):
        first = ros.state(types)
        assert first.graph is first.graph  # made in one go for all who ask what a node has
        count = len(parsed)
        assert ros.state(types) is first
        assert len(parsed) == count
    fleet.state = small(501)
    assert len(ros.state(types=False).nodes()) == 501
    assert len(ros.state(types=True).nodes()) == 501


def test_a_memo_keeps_little() -> None:
    memo = rpc.Memo()
    reply = rpc.xmlrpc.client.dumps(("x" * memo.LEAST,), methodresponse=True).encode()
    first = memo.parsed(b"question", reply)
    assert memo.parsed(b"question", reply) is first
    for number in range(memo.KEPT):
        memo.parsed(b"other %d" % number, reply)
    assert memo.parsed(b"question", reply) is not first
    short = rpc.xmlrpc.client.dumps((["x"],), methodresponse=True).encode()
    assert memo.parsed(b"short", short) is not memo.parsed(b"short", short)


def test_a_master_is_left_alone_for_as_long_as_it_took_to_answer(peers: Peers, monkeypatch: pytest.MonkeyPatch) -> None:
    fleet = Fleet(peers, small(2))
    clock, slept = [100.0], []

    ros = Ros1Client(fleet.uri, LONG)
    calls = ros.calls
    time_of = SimpleNamespace(monotonic=lambda: clock[0], sleep=lambda seconds: slept.append(round(seconds, 3)))
    monkeypatch.setattr(rpc, "time", time_of)

    def slow(requests: Any) -> list[Any]:
        clock[0] += 0.5
        return calls(requests)

    monkeypatch.setattr(ros, "calls", slow)
    ros.state()
    clock[0] += 0.1
    ros.state()
    clock[0] += 2.0
    ros.state()
    assert slept == [0.0, 0.4, 0.0]
    ros.ask(ros.state(), Questions())  # nobody is asked, so nothing is


# ---- a master's name


def blocking(end: threading.Event, look_up: Callable[..., Any]) -> Callable[..., Any]:
    def found(*args: Any, flags: int = 0, **more: Any) -> Any:
        if not flags & socket.AI_NUMERICHOST:
            end.wait(LONG)
        return look_up(*args, flags=flags, **more)

    return found


def test_a_resolver_that_hangs_costs_the_time_out(monkeypatch: pytest.MonkeyPatch) -> None:
    end = threading.Event()
    monkeypatch.setattr(socket, "getaddrinfo", blocking(end, socket.getaddrinfo))
    began = time.monotonic()
    with pytest.raises(RosError, match=r"no answer from http://localhost:11311 within 0\.3 s"):
        Master("http://localhost:11311", 0.3).state()
    assert time.monotonic() - began < 30
    end.set()


def test_a_pods_address_needs_no_resolver(peers: Peers, monkeypatch: pytest.MonkeyPatch) -> None:
    uri = Fleet(peers, small(2)).uri
    end = threading.Event()
    monkeypatch.setattr(socket, "getaddrinfo", blocking(end, socket.getaddrinfo))
    assert Master(uri, LONG).state().nodes() == ["/node_0", "/node_1"]
    end.set()
