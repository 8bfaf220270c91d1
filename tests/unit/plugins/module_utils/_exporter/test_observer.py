# SPDX-License-Identifier: GPL-3.0-or-later
"""The exporter's look at peers that answer, refuse, hang or talk nonsense."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from typing import Any

import pytest
from ansible_collections.rosops.fleet.plugins.module_utils._exporter import observer
from ansible_collections.rosops.fleet.plugins.module_utils._exporter.observer import (
    CALLER,
    Observer,
    Poller,
    own_connections,
    too_near,
)
from ansible_collections.rosops.fleet.plugins.module_utils._exporter.updates import Updates
from ansible_collections.rosops.fleet.tests.unit.plugins.fake_ros import Peers, recorded, until

NODES = recorded("nodes")


def node(**changes: Any) -> dict[str, Any]:
    replies = {call: NODES["/talker_a"][call] for call in ("getPid", "getBusInfo", "getBusStats")}
    return {**replies, **changes}


def overflow(*_args: Any) -> Any:
    raise OverflowError("int exceeds XML-RPC limits")


def polls(uri: str, timeout: float, tell: Callable[[str], None] = lambda _line: None) -> Poller:
    return Poller(Observer(uri, timeout), 10, Updates("/nonexistent"), tell, tell)


def poller(peers: Peers, nodes: dict[str, str], timeout: float = 0.5, **more: Any) -> Poller:
    """A poller of a master that has these nodes, each subscribed to /chatter, and answers more."""
    look_up = {name: [1, "node api", uri] if uri else [-1, "unknown node", ""] for name, uri in nodes.items()}
    state = [1, "", [[], [["/chatter", list(nodes)]], []]]
    return polls(peers.api("master", {"getSystemState": state, "lookupNode": look_up.get, **more}), timeout)


def errors(made: Poller) -> dict[str, int]:
    return {why: number for why, number in made.snapshot.errors.items() if number}


def test_good_and_bad_nodes_side_by_side(peers: Peers) -> None:
    nodes = {
        "/good": peers.api("good", node()),
        "/cpp": peers.api("cpp", node(getBusStats=NODES["/relay"]["getBusStats"])),
        "/over": peers.api("over", node(getBusStats=overflow)),
        "/odd": peers.api("odd", node(getPid=[1, "", "seven"])),
        "/hung": f"http://127.0.0.1:{peers.hung()}/",
        "/dead": "http://127.0.0.1:9/",
        "/unknown": "",
    }
    made = poller(peers, nodes)
    began = time.monotonic()
    made.poll()
    ros = made.snapshot.ros
    assert ros.nodes == {name: name in ("/good", "/cpp", "/over") for name in nodes}
    assert set(ros.counts) == {"/good", "/cpp"}
    assert errors(made) == {"timeout": 1, "refused": 1, "fault": 1, "malformed": 1, "overflow": 1}
    assert time.monotonic() - began < 3
    # what was late comes last the next time, so that it holds up nobody
    state = made.observer.graph()
    last = [errand.name for errand in made.observer.errands(state)][-4:]
    assert set(last) == {"/odd", "/hung", "/dead", "/unknown"}


def test_only_so_many_at_once(peers: Peers, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(observer, "AT_ONCE", 3)
    lock, now, most = threading.Lock(), [0], [0]

    def slow(*_args: Any) -> Any:
        with lock:
            now[0] += 1
            most[0] = max(most[0], now[0])
        time.sleep(0.03)
        with lock:
            now[0] -= 1
        return [1, "", 7]

    nodes = {f"/n{i}": peers.api(f"n{i}", node(getPid=slow)) for i in range(12)}
    made = poller(peers, nodes, 2)
    made.poll()
    assert all(made.snapshot.ros.nodes.values())
    assert most[0] == 3


@pytest.mark.parametrize(
    ("reply", "why"),
    [([1, "", 7], "malformed"), ([-1, "no", 0], "fault"), ("nonsense", "malformed"), (None, "timeout")],
)
def test_a_master_that_is_none(peers: Peers, reply: Any, why: str) -> None:
    hangs = f"http://127.0.0.1:{peers.hung()}/"
    made = polls(peers.api("master", {"getSystemState": reply}) if reply else hangs, 0.5)
    made.poll()
    assert (made.snapshot.ros.master, errors(made)) == (False, {why: 1})


def test_only_calls_that_change_nothing(peers: Peers) -> None:
    made = poller(peers, {"/good": peers.api("good", node())})
    made.poll()
    assert {method for _label, method in peers.calls} <= {
        "getSystemState", "lookupNode", "getParam", "system.multicall", "getPid", "getBusInfo", "getBusStats",
    }  # fmt: skip


def test_launch_files_where_there_are_nodes(peers: Peers, monkeypatch: pytest.MonkeyPatch) -> None:
    """A few at a time, and none of a pod that is gone."""
    monkeypatch.setattr(observer, "AT_ONCE", 2)
    answers = {"process_info": lambda _name: [-1, "no process by that name", {}]}
    servers = {
        name: peers.api(name, {**answers, "list_processes": [1, "", [[[f"{name}-1", 2]], []]]}, caller=False)
        for name in ("a", "b", "c")
    }
    told = {**servers, "hung": f"http://127.0.0.1:{peers.hung()}/", "elsewhere": "http://192.0.2.1:4711/"}
    made = poller(peers, {"/good": peers.api("good", node()), "/unknown": ""}, getParam=[1, "", told])
    began = time.monotonic()
    made.poll()
    launched = made.snapshot.ros.launched
    assert {name: (child.alive, child.spawned) for name, child in launched.items()} == dict.fromkeys(
        ("/a", "/b", "/c"), (True, 2)
    )
    assert (made.snapshot.ros.nodes["/good"], time.monotonic() - began < 2) == (True, True)


def test_our_own_connections() -> None:
    assert own_connections([[4, CALLER, "o", "TCPROS", "/a", True], [5, "/b", "o", "TCPROS", "/a", True]]) == (4,)
    for nonsense in (None, 7, [7], [[]], [[1]]):
        assert own_connections(nonsense) == ()


# --- again and again --------------------------------------------------------------------------------------------------


def running(tell: Callable[[str], None]) -> Poller:
    """Of a master that is not there, every hundredth of a second."""
    made = polls("http://127.0.0.1:9/", 0.5, tell)
    made.interval = 0.01
    made.start()
    until(lambda: made.asleep)
    return made


def test_nobody_is_asked_until_somebody_scrapes_nor_once_nobody_does_any_more(monkeypatch: pytest.MonkeyPatch) -> None:
    made = running(lambda _line: None)
    assert made.snapshot.polls == 0
    made.scraped()
    until(lambda: made.snapshot.ros.master is False and made.snapshot.polls > 2)
    monkeypatch.setattr(observer, "WANTED", 0.05)
    until(lambda: made.asleep)
    polled = made.snapshot.polls
    # what was seen then may not be so any more
    assert (made.snapshot.ros.master, made.snapshot.ros.nodes, made.healthy()) == (None, {}, True)
    time.sleep(0.05)
    assert made.snapshot.polls == polled
    monkeypatch.setattr(observer, "WANTED", 60.0)
    made.scraped()
    until(lambda: made.snapshot.polls > polled)


def test_a_mistake_of_ours_is_told_once_and_the_next_poll_goes_on(monkeypatch: pytest.MonkeyPatch) -> None:
    said: list[str] = []
    made = running(said.append)
    tries, look = [0], made._look

    def bad() -> Any:
        tries[0] += 1
        return look() if tries[0] > 5 else {}["missing"]

    monkeypatch.setattr(made, "_look", bad)
    made.scraped()
    until(lambda: made.snapshot.polls > 2)
    assert said == ["no metrics of the graph: KeyError: 'missing'"]


@pytest.mark.parametrize(
    ("at", "near"), [(100.1, True), (101.4, True), (101.6, False), (105, False), (108.4, False), (108.6, True)]
)
def test_polls_keep_away_from_scrapes(at: float, near: bool) -> None:
    assert too_near(100, 110, at, 10) is near


def test_one_shift_is_enough() -> None:
    """Scrapes every ten seconds, as the polls, at whatever time: after one shift they are not near again."""
    for tenth in range(100):
        scrape, last, due, shifts = 100 + tenth / 10, 100.0, 110.0, 0
        for _round in range(5):
            if too_near(last, due, scrape, 10):
                shifts += 1
                due += 3
            while due <= scrape + 10:
                last, due = due, due + 10
            scrape += 10
        assert shifts <= 1, tenth
