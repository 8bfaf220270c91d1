# SPDX-License-Identifier: GPL-3.0-or-later
"""The registrar against peers that are late, gone or refuse."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import pytest
from ansible_collections.rosops.fleet.plugins.module_utils._common.errors import RosError
from ansible_collections.rosops.fleet.plugins.module_utils._ros import registrar
from ansible_collections.rosops.fleet.plugins.module_utils._ros.graph import host_of
from ansible_collections.rosops.fleet.plugins.module_utils._ros.registrar import Registrar, reap, register
from ansible_collections.rosops.fleet.plugins.module_utils._ros.registrations import (
    ALIVE,
    DEAD,
    UNKNOWN,
    Call,
    Entry,
    Liveness,
)
from ansible_collections.rosops.fleet.tests.unit.plugins.fake_ros import Peers


def test_who_is_dead_and_who_is_only_late(peers: Peers) -> None:
    node = peers.api("node", {"getPid": [1, "", 7], "getPublications": [1, "", [["/a", "x/A"]]]})
    uris = {
        "/alive": node,
        "/dead": f"http://127.0.0.1:{peers.dead()}/",
        "/hung": f"http://127.0.0.1:{peers.hung()}/",
        "/nameless": "http://no-such-name.invalid:1/",
        "/odd": peers.api("odd", {"getPid": [1, "", "seven"]}),
    }
    entries = {name: Entry(uri) for name, uri in uris.items()}
    answers = Registrar("http://127.0.0.1:1/", 0.5).ask(entries)
    assert {name: answer.verdict for name, answer in answers.items()} == {
        "/alive": ALIVE,
        "/dead": DEAD,
        "/hung": UNKNOWN,
        "/nameless": UNKNOWN,
        "/odd": UNKNOWN,
    }
    # it does not know getSubscriptions: that says nothing of its subscriptions
    assert (answers["/alive"].pid, answers["/alive"].publications) == (7, frozenset({"/a"}))
    assert answers["/alive"].subscriptions is None


def test_a_call_that_the_master_refuses(peers: Peers) -> None:
    uri = peers.api("master", {"registerPublisher": [-1, "no", 0]}, multicall=True)
    with pytest.raises(RosError, match="refused registerPublisher /n /t"):
        Registrar(uri).apply([Call("publisher", "/n", "/t", "x/T", "http://n:1/")])


def test_a_process_that_has_come_under_the_name_since_it_was_decided_keeps_it(peers: Peers) -> None:
    """The master would shut it down: to it the old address is that of a newer process."""
    made: list[str] = []
    there = {"/newer": "http://n:2/", "/same": "http://n:1/"}
    replies = {
        "lookupNode": lambda name: [1, "", there[name]] if name in there else [-1, "unknown", ""],
        "registerPublisher": lambda topic, *_more: made.append(topic) or [1, "", []],
        "unregisterPublisher": lambda topic, _uri: made.append(f"not {topic}") or [1, "", 1],
    }
    ros = Registrar(peers.api("master", replies, multicall=True))
    ros.apply([Call("publisher", node, f"{node}/out", "x/T", "http://n:1/") for node in ("/newer", "/same", "/gone")])
    assert made == ["/same/out", "/gone/out"]
    ros.apply([Call("publisher", "/newer", "/newer/out", "x/T", "http://n:1/", remove=True)])
    assert made[2:] == ["not /newer/out"]


def test_a_subscriber_is_told_until_the_list_stays_the_same(peers: Peers) -> None:
    """A publisher came while the first list was on its way."""
    told: list[list[str]] = []
    node = peers.api("node", {"publisherUpdate": lambda _topic, uris: told.append(uris) or [1, "", 0]})
    publishers = iter([["/p"], ["/p", "/q"], ["/p", "/q"]])
    replies = {
        "registerSubscriber": [1, "", []],
        "getSystemState": lambda: [1, "", [[["/t", next(publishers)]], [], []]],
        "getTopicTypes": [1, "", []],
        "lookupNode": lambda name: [1, "", node if name == "/n" else f"http://h{name}:1/"],
    }
    uri = peers.api("master", replies, multicall=True)
    Registrar(uri).apply([Call("subscriber", "/n", "/t", "x/T", node)])
    assert told == [["http://h/p:1/"], ["http://h/p:1/", "http://h/q:1/"]]


# ---- the jobs of a step

URI, SERVICE = "http://10.0.0.1:1/", "rosrpc://10.0.0.1:3"
NODE = {"uri": URI, "pid": 7, "publications": ["/a"], "subscriptions": [], "services": ["/s"]}
GRAPH = {"nodes": {"/n": NODE}, "topics": {"/a": {"type": "x/A"}}, "services": {"/s": {"uri": SERVICE}}}
WHOLE, PART = Entry(URI, None, {"/a": "x/A"}, {}, {"/s": SERVICE}), Entry(URI, None, {"/a": "x/A"})
LIVES, GONE, LATE = (
    Liveness(ALIVE, "", 7, frozenset({"/a"}), frozenset(), frozenset({"/s"})),
    Liveness(DEAD, "refused"),
    Liveness(UNKNOWN, "late"),
)


class World:
    """What is registered, what nodes answer, one look after the other, and what was done: (method, node, name)."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.there: dict[str, Entry] = {}
        self.answers: dict[str, list[Liveness]] = {}
        self.done: list[tuple[str, ...]] = []
        monkeypatch.setattr(registrar, "BETWEEN_LOOKS", 0)
        monkeypatch.setattr(Registrar, "snapshot", lambda _ros: self.there)
        monkeypatch.setattr(Registrar, "ask", self.ask)
        monkeypatch.setattr(Registrar, "apply", lambda _ros, calls: self.done.extend(one.request[:3] for one in calls))

    def ask(self, entries: dict[str, Entry], seconds: float = 0.0, own_word: bool = True) -> dict[str, Liveness]:
        assert (seconds >= 5) is not own_word  # a pod's address that is no more takes its time
        return {node: self.answers[node].pop(0) for node in entries}

    def register(self, *nodes: str, graph: Any = GRAPH) -> bool:
        found: bool = register({"master_uri": "http://m:1", "graph": graph, "nodes": nodes})["changed"]
        return found

    def reap(self, *nodes: str, hosts: Sequence[str] = ()) -> bool:
        found: bool = reap({"master_uri": "http://m:1", "nodes": nodes, "hosts": hosts})["changed"]
        return found


@pytest.fixture
def world(monkeypatch: pytest.MonkeyPatch) -> World:
    return World(monkeypatch)


@pytest.mark.parametrize(
    ("there", "nodes", "done"),
    [
        ({}, [], [("registerPublisher", "/n", "/a"), ("registerService", "/n", "/s")]),
        ({"/n": PART}, ["/n"], [("registerService", "/n", "/s")]),
        # whoever has the service now is about to go
        ({"/n": PART, "/m": Entry("http://m:2/", None, {}, {}, {"/s": "x"})}, [], [("registerService", "/n", "/s")]),
        ({"/n": WHOLE}, [], []),
        ({}, ["/other"], []),
    ],
)
def test_what_lives_is_registered_again(world: World, there: Any, nodes: list[str], done: list[Any]) -> None:
    world.there, world.answers = there, {"/n": [LIVES]}
    assert world.register(*nodes) is bool(done)
    assert world.done == done
    assert bool(world.answers["/n"]) is not bool(done)  # nobody is asked where nothing is missing


@pytest.mark.parametrize(
    ("answers", "nodes", "hosts", "removed"),
    [
        ([GONE, GONE], ["/n"], [], 1),
        ([GONE, LIVES], ["/n"], [], 0),
        ([LATE], ["/n"], [], 0),
        ([LIVES], ["/n"], [], 0),
        ([], [], [], 0),
        ([], ["/n"], [host_of(PART.uri)], 1),  # where a pod was nobody is asked
    ],
)
def test_what_the_dead_left_is_taken_away(
    world: World, answers: list[Liveness], nodes: list[str], hosts: list[str], removed: int
) -> None:
    world.there, world.answers = {"/n": PART}, {"/n": answers}
    assert world.reap(*nodes, hosts=hosts) is bool(removed)
    assert world.done == [("unregisterPublisher", "/n", "/a")] * removed


def test_the_name_of_a_revision_means_the_nodes_of_its_pods(world: World) -> None:
    """Of the graph that was recorded when it is to be registered, of those that are there when it is to go."""
    one, two, other = "/n_1a2b3c4d_4", "/n_1a2b3c4d_5", "/n_99999999_4"
    world.answers = {one: [LIVES, LIVES], two: [GONE, GONE]}
    assert world.register("/n_1a2b3c4d", graph={**GRAPH, "nodes": dict.fromkeys((one, other), NODE)})
    assert {node for _method, node, _name in world.done} == {one}
    world.there = dict.fromkeys((one, two, other), PART)
    assert world.reap("/n_1a2b3c4d")
    assert world.done[-1] == ("unregisterPublisher", two, "/a")
