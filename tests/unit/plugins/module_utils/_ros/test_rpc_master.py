# SPDX-License-Identifier: GPL-3.0-or-later
"""A master that a hundred robots share: its graph is read, and read again only where it says something new."""

from __future__ import annotations

import itertools
import socket
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from ansible_collections.rosops.fleet.plugins.module_utils._common.errors import RosError
from ansible_collections.rosops.fleet.plugins.module_utils._exporter.observer import Observer
from ansible_collections.rosops.fleet.plugins.module_utils._robot.keeper import Keeper
from ansible_collections.rosops.fleet.plugins.module_utils._robot.memory import KeptFiles
from ansible_collections.rosops.fleet.plugins.module_utils._ros import rpc
from ansible_collections.rosops.fleet.plugins.module_utils._ros.backend import MasterState, Questions
from ansible_collections.rosops.fleet.plugins.module_utils._ros.client import Ros1Client
from ansible_collections.rosops.fleet.plugins.module_utils._ros.conditions import conditions_from
from ansible_collections.rosops.fleet.plugins.module_utils._ros.gate import look
from ansible_collections.rosops.fleet.plugins.module_utils._ros.registrar import Registrar
from ansible_collections.rosops.fleet.plugins.module_utils._ros.replies import NodeAnswer, build
from ansible_collections.rosops.fleet.plugins.module_utils._ros.rpc import Master
from ansible_collections.rosops.fleet.tests.unit.plugins.fake_ros import Peers

ROBOTS, APPS, TOPICS = 100, 12, 10
LONG = 60.0  # for a busy machine to write and read 6 MB


def name_of(robot: int, app: int) -> str:
    return f"/robot{robot:03d}/app_{app:02d}_{robot * 7919 + app * 104729:08x}"


def whole_fleet() -> list[Any]:
    """getSystemState's value."""
    publishers, subscribers, services = {}, {}, {}
    for robot, app in itertools.product(range(ROBOTS), range(APPS)):
        name = name_of(robot, app)
        for number in range(TOPICS):
            topic = f"/robot{robot:03d}/app_{app:02d}/topic_{number}"
            publishers[topic] = [name]
            subscribers[topic] = [name_of(robot, (app + 1) % APPS), name_of(robot, (app + 5) % APPS)]
        for service in ("get_loggers", "set_logger_level", "set_parameters"):
            services[f"{name}/{service}"] = [name]
    return [list(map(list, part.items())) for part in (publishers, subscribers, services)]


class Fleet:
    """A master with its answers; `state` may change."""

    def __init__(self, peers: Peers, state: list[Any]) -> None:
        self.state = state
        node = peers.api("node", {"getPid": [1, "", 7]})
        answers: dict[str, Any] = {
            "getSystemState": lambda: [1, "", self.state],
            "getTopicTypes": [1, "", []],
            "getPid": [1, "", 1],
            "getUri": [1, "", "http://m:1/"],
            "getParam": [1, "", {}],
            "lookupNode": lambda name: [1, "", f"{node}{name[1:]}"],
            "lookupService": [1, "", "rosrpc://127.0.0.1:9"],
        }
        self.uri = peers.api("master", answers, multicall=True)


def test_a_graph_of_a_hundred_robots_is_read_by_everybody(peers: Peers, tmp_path: Path) -> None:
    fleet = Fleet(peers, whole_fleet())
    size = len(rpc.xmlrpc.client.dumps(([1, "", fleet.state],), methodresponse=True))
    assert size > 6_000_000  # and 4 MiB were the end once
    assert len(Ros1Client(fleet.uri, LONG).state().nodes()) == ROBOTS * APPS
    wanted = conditions_from(
        {"nodes": [name_of(7, 3)], "topics": [{"name": "/robot007/app_03/topic_1", "publishers": 1}]}
    )
    seen = look(Ros1Client(fleet.uri, LONG), wanted)
    assert [str(check) for check in seen.checks if check.kind == "node" and check.verdict != "pass"] == []
    assert len(Observer(fleet.uri, LONG).graph().nodes()) == ROBOTS * APPS
    said: list[str] = []
    keeper = Keeper(Registrar(fleet.uri, LONG, "/ros_keeper"), KeptFiles(str(tmp_path), said.append), said.append)
    keeper.step()
    assert (said, len(keeper.memory.nodes)) == ([], ROBOTS * APPS)


# ---- a look costs what changed


def small(nodes: int) -> list[Any]:
    return [[[f"/a_topic_of_a_robot/{number}", [f"/node_{number}"]] for number in range(nodes)], [], []]


def test_the_same_reply_is_the_same_state(peers: Peers, monkeypatch: pytest.MonkeyPatch) -> None:
    parsed: list[int] = []
    parse = rpc._parsed
    monkeypatch.setattr(rpc, "_parsed", lambda reply: parsed.append(len(reply)) or parse(reply))
    fleet = Fleet(peers, small(500))
    ros = Ros1Client(fleet.uri, LONG)
    for types in (False, True):
        first = ros.state(types)
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


class Counted(dict):  # type: ignore[type-arg] # of whatever it is filled with
    """A part of the registrations that counts how often it is read."""

    reads = 0

    def __getitem__(self, key: Any) -> Any:
        self.reads += 1
        return super().__getitem__(key)

    def items(self) -> Any:
        self.reads += len(self)
        return super().items()


def test_what_all_nodes_have_is_found_in_one_go() -> None:
    part = Counted({f"/topic_{number}": (f"/node_{number}",) for number in range(300)})
    state = MasterState(part)
    answers = {name: NodeAnswer("http://n:1/", 1, bus=[]) for name in state.nodes()}
    for _look in range(10):
        graph = build(state, answers)
    assert graph.node("/node_7").publications == ("/topic_7",)
    assert part.reads < 5 * len(part)  # and not once for every node


def test_a_master_is_left_alone_for_as_long_as_it_took_to_answer(peers: Peers, monkeypatch: pytest.MonkeyPatch) -> None:
    fleet = Fleet(peers, small(2))
    clock, slept = [100.0], []

    class Time:
        @staticmethod
        def monotonic() -> float:
            return clock[0]

        @staticmethod
        def sleep(seconds: float) -> None:
            slept.append(round(seconds, 3))

    ros = Ros1Client(fleet.uri, LONG)
    calls = ros.calls
    monkeypatch.setattr(rpc, "time", Time)

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
