# SPDX-License-Identifier: GPL-3.0-or-later
"""A master that a hundred robots share: its graph is read, and read again only where it says something new."""

from __future__ import annotations

import socket
import threading
import time
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import pytest
from ansible_collections.rosops.fleet.plugins.module_utils._common.errors import RosError
from ansible_collections.rosops.fleet.plugins.module_utils._ros import rpc
from ansible_collections.rosops.fleet.plugins.module_utils._ros.backend import Questions
from ansible_collections.rosops.fleet.plugins.module_utils._ros.client import Ros1Client
from ansible_collections.rosops.fleet.plugins.module_utils._ros.rpc import Master
from ansible_collections.rosops.fleet.tests.unit.plugins.fake_ros import Peers

LONG = 60.0  # for a busy machine to write and read 6 MB


def small(nodes: int) -> list[Any]:
    return [[[f"/a_topic_of_a_robot/{number}", [f"/node_{number}"]] for number in range(nodes)], [], []]


class Fleet:
    """A master with its answers; `state` may change."""

    def __init__(self, peers: Peers, state: list[Any]) -> None:
        self.state = state
        answers = {"getSystemState": lambda: [1, "", self.state], "getTopicTypes": [1, "", []]}
        self.uri = peers.api("master", answers, multicall=True)


def test_a_graph_of_a_hundred_robots_is_read(peers: Peers) -> None:
    fleet = Fleet(peers, small(32_000))
    assert len(rpc.xmlrpc.client.dumps(([1, "", fleet.state],), methodresponse=True)) > 6_000_000
    assert len(Ros1Client(fleet.uri, LONG).state().publishers) == 32_000


# ---- a look costs what changed


def test_the_same_reply_is_the_same_state(peers: Peers, monkeypatch: pytest.MonkeyPatch) -> None:
    parsed: list[int] = []
    parse = rpc._parsed
    monkeypatch.setattr(rpc, "_parsed", lambda reply: parsed.append(len(reply)) or parse(reply))
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


# ---- names


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
    assert time.monotonic() - began < 5
    end.set()


def test_a_pods_address_needs_no_resolver(peers: Peers, monkeypatch: pytest.MonkeyPatch) -> None:
    uri = Fleet(peers, small(2)).uri
    end = threading.Event()
    monkeypatch.setattr(socket, "getaddrinfo", blocking(end, socket.getaddrinfo))
    assert Master(uri, LONG).state().nodes() == ["/node_0", "/node_1"]
    end.set()
