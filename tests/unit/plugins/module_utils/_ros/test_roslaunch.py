# SPDX-License-Identifier: GPL-3.0-or-later
"""What launch files started, what became of it, and servers that answer, are gone, hang or talk nonsense."""

from __future__ import annotations

import time
from dataclasses import replace
from typing import Any

import pytest
from ansible_collections.rosops.fleet.plugins.module_utils._ros.graph import Graph, Node
from ansible_collections.rosops.fleet.plugins.module_utils._ros.roslaunch import (
    URIS,
    Child,
    children,
    crash,
    processes,
)
from ansible_collections.rosops.fleet.plugins.module_utils._ros.rpc import Master
from ansible_collections.rosops.fleet.tests.unit.plugins.fake_ros import Peers

HERE, POD = ["127.0.0.1"], "10.42.0.7"
ALIVE = Child("arm/lidar-3", POD, True, None, False, False, 1)
GONE = replace(ALIVE, alive=False)


def node(name: str = "/arm/lidar", uri: str = f"http://{POD}:4711/", refused: bool = True) -> Graph:
    found = Node(name, uri, asked=True, refused=refused)
    return Graph({found.key: found})


@pytest.mark.parametrize(
    ("child", "said"),
    [
        (ALIVE, ""),
        (GONE, ""),  # it may have done its work
        (replace(GONE, exit_code=0), ""),
        (replace(GONE, exit_code=1), "ended with exit code 1"),
        (replace(GONE, exit_code=-11), "ended with signal SIGSEGV"),
        (replace(GONE, exit_code=-99), "ended with signal 99"),
        (replace(ALIVE, spawned=2), "was started again 1 time"),
        (replace(ALIVE, spawned=5), "was started again 4 times"),
        (replace(GONE, spawned=3, exit_code=4), "was started again 2 times and ended with exit code 4"),
        (replace(GONE, spawned=3, exit_code=0), "was started again 2 times"),
    ],
)
def test_what_is_a_crash(child: Child, said: str) -> None:
    assert crash(child) == said
    assert child == GONE or crash(child, node()) == said


@pytest.mark.parametrize(
    ("child", "graph", "died"),
    [
        (GONE, node(), True),
        (GONE, node(refused=False), False),
        (GONE, node(uri="http://10.42.0.8:4711/"), False),  # another pod's, of the same name
        (GONE, node("/lidar"), False),
        (replace(GONE, exit_code=0), node(), False),
        (ALIVE, node(), False),  # it is just coming, or hangs
    ],
)
def test_who_leaves_its_registration_behind_has_not_done_its_work(child: Child, graph: Graph, died: bool) -> None:
    assert crash(child, graph) == ("died, as its registration is still there" if died else "")


@pytest.mark.parametrize("listed", [None, "no", [], [None], [[["a"], [7, 1], ["b", "c"], None]], [7, [[]]]])
def test_a_list_that_is_none(listed: Any) -> None:
    assert list(processes(listed)) == []


# ---- asking


def launched(names: list[list[list[Any]]], infos: dict[str, Any] | None = None) -> dict[str, Any]:
    """A roslaunch's answers."""
    known = infos or {}
    return {
        "list_processes": lambda: [1, "processes on parent machine", names],
        "process_info": lambda name: [1, "process info", known[name]] if name in known else [-1, "no process", {}],
    }


def master(peers: Peers, told: Any, seconds: float = 1.0) -> Master:
    def parameter(name: str) -> list[Any]:
        assert name == URIS
        return [1, "", told] if told is not None else [-1, f"Parameter [{name}] is not set", 0]

    return Master(peers.api("master", {"getParam": parameter}), seconds)


@pytest.mark.parametrize("multicall", [True, False])
def test_all_are_asked(peers: Peers, multicall: bool) -> None:
    infos = {
        "lives-1": {"env": {"TOKEN": "hush"}, "alive": True, "respawn": False, "required": True, "pid": 7},
        "waits-2": {"env": {}, "alive": False, "respawn": True, "exit_code": 4},
        "odd-4": {"exit_code": "3", "respawn": "no"},
        "odd-5": None,
    }
    first = launched([[["lives-1", 1], ["waits-2", 3]], [["done-3", 1], ["odd-4", 1], ["odd-5", 1]]], infos)
    servers_of = {"first": first, "second": launched([[], []])}
    told = {label: peers.api(label, answers, multicall, caller=False) for label, answers in servers_of.items()}
    found = children(master(peers, told), HERE)
    assert found == [
        Child("done-3", "127.0.0.1", False, None, False, False, 1),
        Child("lives-1", "127.0.0.1", True, None, False, True, 1),
        Child("odd-4", "127.0.0.1", False, None, False, False, 1),
        Child("odd-5", "127.0.0.1", False, None, False, False, 1),
        Child("waits-2", "127.0.0.1", False, 4, True, False, 3),
    ]


def test_those_that_are_gone_hang_or_talk_nonsense_keep_nobody_from_the_others(peers: Peers) -> None:
    told = {
        "good": peers.api("good", launched([[["lives-1", 1]], []])),
        "hung": f"http://127.0.0.1:{peers.hung()}/",
        "odd": peers.api("odd", {"list_processes": lambda: [-1, "uninitialized", 0]}),
        "worse": peers.api("worse", {"list_processes": lambda: "no"}),
        **{"number": 7, "none": "no address", "broken": "http://[/"},
        **{f"dead{number}": f"http://127.0.0.1:{peers.dead()}/" for number in range(5)},
    }
    began = time.monotonic()
    assert [child.name for child in children(master(peers, told, 0.5), HERE)] == ["lives-1"]
    assert time.monotonic() - began < 30  # of one that hangs for ever


def test_one_question_where_nobody_launched_anything_here(peers: Peers) -> None:
    assert children(master(peers, None), HERE) == []
    assert children(master(peers, "http://127.0.0.1:9/"), HERE) == []  # somebody's own parameter of that name
    told = {"elsewhere": peers.api("elsewhere", launched([[["lives-1", 1]], []]))}
    assert children(master(peers, told), {POD}) == []
    assert peers.calls == 3 * [("master", "getParam")]
