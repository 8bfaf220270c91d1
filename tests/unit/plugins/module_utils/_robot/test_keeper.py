# SPDX-License-Identifier: GPL-3.0-or-later
"""The keeper at work, on a fake clock, with a master and nodes that are dictionaries."""

from __future__ import annotations

import json
import socket
import threading
import time
import xmlrpc.client
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from ansible_collections.rosops.fleet.plugins.module_utils._common.errors import RosError
from ansible_collections.rosops.fleet.plugins.module_utils._robot import keeper, memory
from ansible_collections.rosops.fleet.plugins.module_utils._robot.memory import AGAIN, KeptFiles
from ansible_collections.rosops.fleet.plugins.module_utils._ros.backend import MasterState
from ansible_collections.rosops.fleet.plugins.module_utils._ros.registrations import (
    ALIVE,
    DEAD,
    KINDS,
    SERVICE,
    UNKNOWN,
    Call,
    Entry,
    Liveness,
)
from ansible_collections.rosops.fleet.plugins.module_utils._ros.replies import master_state
from ansible_collections.rosops.fleet.tests.unit.plugins.fake_ros import Peers, until

TALKER = Entry("http://t:1/", 7, {"/chatter": "std_msgs/String"}, {}, {"/talker/get": "rosrpc://t:2"})
LISTENER = Entry("http://l:1/", 8, {}, {"/chatter": "std_msgs/String"}, {})


class Ros:
    """What the keeper asks of a registrar. `entries` is what the master has, `nodes` what the nodes have themselves."""

    caller = "/ros_keeper"

    def __init__(self) -> None:
        self.pid, self.up = 100, True
        self.nodes = {"/talker": TALKER, "/listener": LISTENER}
        self.entries: dict[str, Entry] = dict(self.nodes)
        self.params: dict[str, Any] = {"run_id": "first", "robot": {"wheels": 4}}
        self.verdicts: dict[str, Liveness] = {}
        self.snapshots = 0
        self.subscribed: list[tuple[Any, ...]] = []
        self.seconds, self.took = 0.0, 0.0  # for the master to say all that is registered, once and so far
        self.looks = 0

    def restart(self) -> None:
        self.pid += 1
        self.entries, self.params = {}, {"run_id": f"run {self.pid}"}

    # ---- the registrar

    def _raw(self) -> list[Any]:
        kinds = ("publications", "subscriptions", "services")
        found: list[dict[str, list[str]]] = [{}, {}, {}]
        for node, entry in self.entries.items():
            for part, kind in zip(found, kinds):
                for name in getattr(entry, kind):
                    part.setdefault(name, []).append(node)
        return [list(map(list, part.items())) for part in found]

    def calls(self, requests: Sequence[tuple[Any, ...]]) -> list[Any]:
        if not self.up:
            raise RosError("the ROS master does not answer: nothing listens")
        if "getSystemState" in [method for method, *_more in requests]:
            self.looks += 1
            self.took += self.seconds
        return [self._answer(method, *more) for method, _caller, *more in requests]

    def state_of(self, system: Any, types: Any = None) -> MasterState:
        return master_state(system, types)

    def _answer(self, method: str, *more: Any) -> Any:
        if method == "setParam":
            *path, last = more[0].strip("/").split("/")
            tree = self.params
            for name in path:
                tree = tree.setdefault(name, {})
            tree[last] = more[1]
            return 0
        if method == "subscribeParam":
            self.subscribed.append(more)
            return self.params
        if method == "getParam":
            return self.params if more[0] == "/" else self.params[more[0].strip("/")]
        return {"getPid": self.pid, "getUri": "http://m:1/", "getSystemState": self._raw(), "getTopicTypes": []}[method]

    def snapshot(self, _state: MasterState | None = None) -> dict[str, Entry]:
        self.snapshots += 1
        return {node: replace(entry, pid=None) for node, entry in self.entries.items()}

    def ask(self, entries: Mapping[str, Entry], _timeout: float, own_word: bool = True) -> dict[str, Liveness]:
        return {node: self._says(node, own_word) for node in entries}

    def _says(self, node: str, own_word: bool) -> Liveness:
        if node in self.verdicts:
            return self.verdicts[node]
        entry = self.nodes[node]
        if not own_word:
            return Liveness(ALIVE, "", entry.pid)
        topics = (frozenset(entry.publications), frozenset(entry.subscriptions), frozenset(entry.services))
        return Liveness(ALIVE, "", entry.pid, *topics)

    def apply(self, calls: Sequence[Call]) -> None:
        for call in calls:
            for node, entry in [*self.entries.items()]:
                if node == call.node or call.kind == SERVICE:  # which has one provider
                    other = (call.kind, call.name)
                    self.entries[node] = entry.only(lambda kind, name, other=other: (kind, name) != other)  # type: ignore[misc]
            if not call.remove:
                entry = self.entries.get(call.node, Entry(call.uri))
                part: Any = {KINDS[call.kind]: {**entry.part(call.kind), call.name: call.detail}}
                self.entries[call.node] = replace(entry, **part)
        self.entries = {node: entry for node, entry in self.entries.items() if not entry.empty}


class Bench:
    """A keeper on a clock that a test turns."""

    def __init__(self, directory: Path) -> None:
        self.ros, self.directory, self.at = Ros(), directory, 1000.0
        self.said: list[str] = []
        self.boot = "one"
        self.keeper = self.start()

    def start(self, keeps: bool = True) -> keeper.Keeper:
        self.keeper = keeper.Keeper(
            self.ros,  # type: ignore[arg-type]
            KeptFiles(str(self.directory), self.said.append),
            self.said.append,
            lambda: self.at + self.ros.took,
            boot=self.boot,
            keeps=keeps,
        )
        return self.keeper

    def step(self, seconds: float = keeper.LOOK) -> float:
        """One look, and what it had others look at beside it."""
        pause = self.keeper.step()
        if self.keeper.probing is not None:
            self.keeper.probing.join(10)
        self.at += seconds
        return pause

    def steps(self, seconds: float) -> None:
        end = self.at + seconds
        while self.at < end:
            self.step()

    def registered(self) -> dict[str, Entry]:
        return {node: replace(one, pid=None) for node, one in self.ros.entries.items()}


@pytest.fixture
def bench(tmp_path: Path) -> Bench:
    return Bench(tmp_path)


def test_what_is_registered_goes_on_record_with_process_ids(bench: Bench) -> None:
    assert bench.step() == keeper.LOOK
    content = json.loads((bench.directory / "registrations.json").read_text())
    assert {node: entry["pid"] for node, entry in content["nodes"].items()} == {"/talker": 7, "/listener": 8}
    assert content["nodes"]["/talker"]["publications"] == {"/chatter": "std_msgs/String"}
    assert bench.said == []


def test_whatever_stands_for_the_run_it_can_be_written(bench: Bench) -> None:
    """Anybody may set that parameter."""
    bench.ros.params["run_id"] = xmlrpc.client.Binary(b"x")
    bench.step()
    assert (bench.said, bench.start().memory.nodes.keys()) == ([], {"/talker", "/listener"})


def test_its_clock_is_one_that_nobody_sets(tmp_path: Path) -> None:
    """One that is set back would keep it from looking at parameters and nodes until it has caught up."""
    assert keeper.Keeper(Ros(), KeptFiles(str(tmp_path), print), print).now is time.monotonic  # type: ignore[arg-type]


def test_it_is_ready_once_it_knows_all_that_a_new_master_would_lack(bench: Bench) -> None:
    """A master may be replaced as soon as its keeper is ready: nobody else knows the parameters then."""
    answer = bench.ros._answer
    bench.ros.up = False
    bench.step()
    assert not bench.keeper.complete  # it has seen nothing yet
    bench.ros.up = True
    lost = RosError("the parameters did not come")
    bench.ros._answer = lambda method, *more: lost if more == ("/",) else answer(method, *more)  # type: ignore[method-assign]
    bench.step()
    assert not bench.keeper.complete
    bench.ros._answer = answer  # type: ignore[method-assign]
    bench.step()
    assert bench.keeper.complete
    bench.ros.up = False
    bench.step()
    assert bench.keeper.complete  # what it knows is worth the more
    again = bench.start()
    assert again.complete  # the record outlives its container
    bench.ros.up = True
    bench.ros.restart()
    bench.step()
    assert bench.ros.params["robot"] == {"wheels": 4}
    assert set(bench.registered()) == {"/talker", "/listener"}


def test_a_parameter_that_changes_is_on_record_in_seconds_and_in_a_minute_where_nobody_tells(bench: Bench) -> None:
    """A master that goes a moment later would take it with it."""
    bench.keeper.uri = "http://keeper/"
    bench.step()
    assert bench.ros.subscribed == [("http://keeper/", "/")]
    bench.ros.params["robot"] = {"wheels": 6}
    bench.steps(10.0)  # nobody told
    assert memory.parameters_of(bench.keeper.params) == {"robot": {"wheels": 4}}
    assert bench.keeper.parameter_changed("/master", "/robot/wheels/", 6) == [1, "", 0]
    bench.step()
    assert memory.parameters_of(bench.keeper.params) == {"robot": {"wheels": 6}}
    bench.ros.restart()
    bench.steps(3.0)
    assert bench.ros.subscribed == [("http://keeper/", "/")] * 2  # the new master knows of nobody
    assert bench.ros.params["robot"] == {"wheels": 6}
    bench.ros.params["robot"] = {"wheels": 5}  # and nobody told
    bench.steps(keeper.PARAMETERS + 1)
    assert memory.parameters_of(bench.keeper.params) == {"robot": {"wheels": 5}}


def test_services_are_given_back_before_whoever_has_them_goes(bench: Bench) -> None:
    bench.step()
    canary = Entry("http://c:1/", 9, {}, {}, {"/talker/get": "rosrpc://c:2"})
    bench.ros.nodes["/canary"] = canary
    bench.ros.entries["/talker"] = Entry(TALKER.uri, 7, TALKER.publications)
    bench.ros.entries["/canary"] = canary
    bench.steps(20.0)
    assert bench.ros.entries["/canary"].services  # the newer one has it, as the master says
    bench.keeper.take_back(["/talker", "/nobody"])
    assert bench.ros.entries["/talker"].services == TALKER.services
    assert bench.said[-1] == "gave back /talker service /talker/get"
    bench.keeper.memory.nodes["/of_1a2b3c4d_4"] = bench.ros.nodes["/of_1a2b3c4d_4"] = replace(canary, uri="http://p:1/")
    bench.keeper.take_back(["/of_1a2b3c4d"])  # in whatever pod that is
    assert bench.ros.entries["/of_1a2b3c4d_4"].services == canary.services
    bench.keeper.take_back(["/talker"])
    said = len(bench.said)
    bench.keeper.take_back(["/talker"])
    bench.keeper.take_back([])
    assert len(bench.said) == said


def test_a_node_that_comes_meanwhile_keeps_no_service_from_being_given_back(
    bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The looks at the master are another thread's."""
    bench.step()
    bench.ros.entries["/talker"] = Entry(TALKER.uri, 7, TALKER.publications)

    def comes(node: str, names: set[str]) -> bool:
        bench.keeper.memory.nodes.setdefault("/new", LISTENER)
        return node in names

    monkeypatch.setattr(keeper, "is_meant", comes)
    bench.keeper.take_back(["/talker"])
    assert bench.ros.entries["/talker"].services == TALKER.services


def test_at_rest_it_looks_seldom_as_long_as_it_would_notice_the_masters_end(bench: Bench) -> None:
    bench.keeper.held = lambda: True
    while bench.at - 1000 < keeper.QUIET:
        assert bench.step() == keeper.LOOK
    assert bench.step(keeper.REST) == keeper.REST
    bench.keeper.held = lambda: False
    assert bench.step() == keeper.LOOK
    bench.keeper.held = lambda: True
    bench.ros.entries["/third"] = bench.ros.nodes["/third"] = Entry("http://x:1/", 9, {"/more": "std_msgs/String"})
    assert [bench.step() for _look in range(2)] == [keeper.LOOK, keeper.LOOK]
    bench.steps(keeper.QUIET)
    assert bench.step(keeper.REST) == keeper.REST
    del bench.ros.entries["/third"]  # its registrations are lost: that is looked into at once
    assert bench.step() == keeper.LOOK
    bench.ros.up = False
    assert bench.step() == keeper.AWAY


def test_a_master_that_is_somebody_else_s_is_looked_at_and_changed_in_nothing(bench: Bench) -> None:
    assert bench.start(keeps=False).complete  # there is nothing to keep for the next master
    bench.ros.seconds, bench.keeper.uri = 0.5, "http://keeper/"  # some looks find nothing due
    bench.step()
    assert set(bench.keeper.memory.nodes) == {"/talker", "/listener"}
    del bench.ros.entries["/listener"]
    bench.steps(keeper.ADDRESSES)
    assert set(bench.ros.entries) == set(bench.keeper.memory.nodes) == {"/talker"}
    assert not bench.keeper.is_whole(999.0)
    assert bench.keeper.is_whole(bench.at)
    bench.ros.restart()
    bench.step()
    assert not bench.keeper.is_whole(bench.at - 5)
    bench.steps(keeper.PARAMETERS)
    assert (bench.ros.entries, bench.ros.params, bench.ros.subscribed) == ({}, {"run_id": "run 101"}, [])
    assert bench.keeper.is_whole(bench.at)
    assert (bench.keeper.complete, bench.said) == (True, [])


def test_addresses_are_looked_up_where_names_changed_or_now_and_then(bench: Bench) -> None:
    for _look in range(int(keeper.ADDRESSES)):
        bench.step()
    assert bench.ros.snapshots == 1
    bench.step()
    assert bench.ros.snapshots == 2  # so many seconds are over
    bench.ros.nodes["/new"] = bench.ros.entries["/new"] = Entry("http://n:1/", 9, {"/n": "x/N"})
    bench.step()
    assert bench.ros.snapshots == 3


def test_a_graph_that_stays_as_it_is_is_not_gone_through_again(bench: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    """With 100 robots on one master, that is most of what a look costs."""
    gone_through: list[str] = []
    for owner, name in ((memory.Memory, "as_dict"), (memory.registrations, "missing")):
        real = getattr(owner, name)
        monkeypatch.setattr(owner, name, lambda *given, real=real, name=name: gone_through.append(name) or real(*given))
    bench.step()
    assert gone_through == ["missing", "as_dict"]
    bench.steps(keeper.ADDRESSES - 2)
    assert gone_through == ["missing", "as_dict"]
    del bench.ros.entries["/listener"]
    bench.step()
    bench.step()  # it comes back at the second look
    assert set(bench.registered()) == {"/talker", "/listener"}
    assert gone_through == ["missing", "as_dict"] * 3


def test_a_large_graph_is_looked_at_less_often_and_a_restart_is_seen_at_once_all_the_same(bench: Bench) -> None:
    bench.step()
    bench.ros.looks = 0
    bench.steps(20)
    assert bench.ros.looks == 20
    bench.ros.seconds, bench.ros.looks = 0.5, 0  # a fleet of a hundred robots
    bench.steps(20)
    assert 3 <= bench.ros.looks <= 5
    bench.ros.seconds = 2.0
    bench.steps(2)
    bench.ros.restart()
    bench.step()
    assert bench.registered().keys() == {"/talker", "/listener"}


def test_a_master_that_is_away_is_said_once(bench: Bench) -> None:
    bench.step()
    bench.ros.up = False
    assert [bench.step(), bench.step()] == [keeper.AWAY, keeper.AWAY]
    bench.ros.up = True
    assert bench.step() == keeper.LOOK
    assert bench.said == ["the master is away: the ROS master does not answer: nothing listens", "the master is back"]


def test_a_restarted_master_gets_everything_back(bench: Bench) -> None:
    bench.steps(2)
    before = bench.registered()
    bench.ros.restart()
    bench.step()
    assert bench.registered() == before
    assert bench.ros.params == {"run_id": "run 101", "robot": {"wheels": 4}}  # the run's own name is not the old one
    assert "3 registrations of 2 nodes and 1 parameters restored" in bench.said[-1]


def test_when_the_master_was_restarted_is_known_to_who_saw_the_one_before(bench: Bench) -> None:
    bench.steps(2)
    assert bench.keeper.restarted_at < 0
    bench.ros.restart()
    at = bench.at
    bench.step()
    assert bench.keeper.restarted_at == at
    bench.ros.restart()
    again, at = bench.start(), bench.at  # with other code
    bench.step()
    assert again.restarted_at == at
    bench.ros.restart()
    bench.boot = "two"
    again = bench.start()
    bench.step()
    assert again.restarted_at < 0
    bench.ros.restart()
    at = bench.at
    bench.step()
    assert again.restarted_at == at


def test_a_node_that_is_late_when_the_master_comes_back_is_no_node_that_left(bench: Bench) -> None:
    """Its peers would do without it: a new publisher would be proven while nobody tells its subscriber of it."""
    bench.steps(20)
    before = bench.registered()
    bench.ros.verdicts["/listener"] = Liveness(UNKNOWN, "no answer")
    bench.ros.restart()
    bench.step()
    assert bench.registered() == before
    bench.ros.nodes["/listener"] = Entry(LISTENER.uri, 8, {}, {"/other": "std_msgs/String"}, {})
    bench.steps(20)
    assert bench.registered() == before  # it has not said anything yet
    del bench.ros.verdicts["/listener"]
    bench.steps(AGAIN + 2)
    assert bench.registered() == {"/talker": replace(TALKER, pid=None)}
    assert bench.said[-1] == "took back /listener subscriber /chatter: by its own word it has that no more"
    assert "/listener" not in bench.keeper.memory.nodes
    said = len(bench.said)
    bench.steps(20)
    assert len(bench.said) == said


def test_a_master_that_is_restarted_within_a_look_is_asked_for_nothing_that_it_lacks(bench: Bench) -> None:
    """Parameters that are read of it are not what the one before had."""
    bench.step(keeper.PARAMETERS)
    calls = bench.ros.calls

    def restarts(requests: Sequence[tuple[Any, ...]]) -> list[Any]:
        if requests[-1][2:] == ("/",):
            bench.ros.restart()
            bench.ros.calls = calls  # type: ignore[method-assign]
        return calls(requests)

    bench.ros.calls = restarts  # type: ignore[method-assign]
    bench.steps(3)
    assert bench.ros.params["robot"] == {"wheels": 4}


def test_a_pod_that_was_ended_meanwhile_gets_nothing_back(bench: Bench) -> None:
    """Its address answers nobody, and its nodes would be looked for by those of the next version."""
    bench.steps(2)
    bench.ros.verdicts["/listener"] = Liveness(UNKNOWN, "no answer")
    bench.ros.restart()
    # an address is what a host says: on a master that robots share, too, one takes nothing from another
    bench.keeper.has_ended("l", "/r2")
    bench.step()
    assert set(bench.registered()) == {"/talker", "/listener"}
    bench.ros.restart()
    bench.keeper.has_ended("l", "/")
    bench.step()
    assert set(bench.registered()) == {"/talker"}
    bench.ros.entries["/listener"] = LISTENER
    bench.steps(2)
    ask, bench.ros.verdicts["/talker"] = bench.ros.ask, Liveness(UNKNOWN, "no answer")

    def ends_meanwhile(*given: Any, **options: Any) -> dict[str, Liveness]:
        bench.keeper.has_ended("t", "")
        return ask(*given, **options)

    bench.ros.ask = ends_meanwhile  # type: ignore[method-assign]
    bench.ros.restart()
    bench.step()
    assert set(bench.registered()) == {"/listener"}
    bench.steps(20)
    assert set(bench.registered()) == {"/listener"}


@pytest.mark.parametrize("keeper_too", [False, True])
def test_who_left_before_the_master_did_gets_nothing_back(bench: Bench, keeper_too: bool) -> None:
    """Its pod is gone, and a busy host says that late: as if it were late itself. A service would go to nobody."""
    bench.steps(2)
    del bench.ros.entries["/talker"]
    bench.ros.verdicts["/talker"] = Liveness(UNKNOWN, "no answer")
    bench.steps(20)
    bench.ros.restart()
    if keeper_too:
        bench.start()
    bench.steps(3)
    assert set(bench.registered()) == {"/listener"}
    del bench.ros.verdicts["/talker"]  # it was there all the time, and the master had lost it
    bench.steps(AGAIN + 2)
    assert set(bench.registered()) == {"/listener", "/talker"}


def test_a_newer_process_of_a_late_nodes_name_keeps_it(bench: Bench) -> None:
    """The master would shut it down for the old address."""
    bench.steps(2)
    newer, ask = Entry("http://l:2/", 9, {}, {"/chatter": "std_msgs/String"}, {}), bench.ros.ask

    def comes_meanwhile(entries: Mapping[str, Entry], *more: Any, **options: Any) -> dict[str, Liveness]:
        answers = ask(entries, *more, **options)
        bench.ros.entries["/listener"] = bench.ros.nodes["/listener"] = newer
        return answers

    bench.ros.verdicts["/listener"] = Liveness(UNKNOWN, "no answer")
    bench.ros.ask = comes_meanwhile  # type: ignore[method-assign]
    bench.ros.restart()
    bench.step()
    assert bench.registered()["/listener"].uri == newer.uri


def test_who_is_late_at_the_boot_of_a_host_ended_with_it(bench: Bench) -> None:
    bench.steps(2)
    bench.ros.verdicts["/listener"] = Liveness(UNKNOWN, "no answer")
    bench.ros.restart()
    bench.start()
    bench.step()
    assert set(bench.registered()) == {"/talker", "/listener"}  # only the keeper began anew
    bench.ros.restart()
    bench.boot = "two"
    bench.start()
    bench.step()
    assert set(bench.registered()) == {"/talker"}


def test_a_master_that_breaks_off_while_it_is_given_back_is_given_all_once_more(bench: Bench) -> None:
    bench.steps(2)
    before, calls = bench.registered(), bench.ros.calls
    bench.ros.restart()

    def breaks_off(requests: Sequence[tuple[Any, ...]]) -> list[Any]:
        if any(method == "setParam" for method, *_more in requests):
            raise RosError("no answer within 2 s")
        return calls(requests)

    assert not bench.keeper.is_whole(bench.at)
    bench.ros.calls = breaks_off  # type: ignore[method-assign]
    assert bench.step() == keeper.AWAY
    assert not bench.keeper.is_whole(bench.at)
    bench.ros.calls = calls  # type: ignore[method-assign]
    bench.ros.up = False
    assert not bench.keeper.is_whole(bench.at)
    bench.ros.up = True
    began = bench.at
    bench.step()
    assert (bench.registered(), bench.ros.params["robot"]) == (before, {"wheels": 4})
    assert bench.keeper.is_whole(bench.at)
    assert not bench.keeper.is_whole(began - 1)  # what was seen then may have been of one that was not
    bench.ros.restart()
    assert not bench.keeper.is_whole(bench.at)  # although it has not seen that one yet
    bench.ros.up = False
    assert not bench.keeper.is_whole(bench.at)


def test_what_died_with_the_master_or_was_set_since_is_left_alone(bench: Bench) -> None:
    bench.steps(2)
    bench.ros.verdicts["/talker"] = Liveness(DEAD, "nothing listens")
    bench.ros.restart()
    bench.ros.params["robot"] = {"wheels": 6}
    bench.step()
    assert (set(bench.registered()), set(bench.keeper.memory.removed)) == ({"/listener"}, {"/talker"})
    assert bench.ros.params["robot"] == {"wheels": 6}


def test_a_dead_node_goes_once_it_was_gone_twice(bench: Bench) -> None:
    bench.step()
    bench.ros.verdicts["/talker"] = Liveness(DEAD, "nothing listens at http://t:1/")
    bench.steps(AGAIN)
    assert "/talker" in bench.registered()
    bench.steps(20)
    assert "/talker" not in bench.registered()
    gone = "/talker service /talker/get, /talker publisher /chatter: nothing listens at http://t:1/"
    assert bench.said == [f"removed {gone}"]


def test_one_that_only_hangs_stays(bench: Bench) -> None:
    bench.step()
    bench.ros.verdicts["/talker"] = Liveness(UNKNOWN, "no answer within 5 s")
    bench.steps(120)
    assert "/talker" in bench.registered()
    ((node, (_uri, seconds)),) = bench.keeper.silence.silent.items()
    assert (node, bench.keeper.silence.answering) == ("/talker", {bench.ros.entries["/listener"].uri})
    assert 90 <= seconds <= 120


def test_one_that_left_with_its_pod_is_not_asked_for_ever(bench: Bench) -> None:
    """Its address leads nowhere, which takes longer to find out than the master may wait for an answer."""

    def ask(entries: Mapping[str, Entry], timeout: float, own_word: bool = True) -> dict[str, Liveness]:
        late = {node: Liveness(DEAD if timeout > 3.0 else UNKNOWN, "no route to host") for node in entries}
        return {node: late[node] if node == "/talker" else bench.ros._says(node, own_word) for node in entries}

    bench.steps(5)
    bench.ros.ask = ask  # type: ignore[method-assign]
    del bench.ros.entries["/talker"]
    bench.steps(40)
    assert [*bench.keeper.memory.nodes] == ["/listener"]
    assert bench.keeper.memory.missed == {}
    assert "/talker" in bench.keeper.memory.removed  # should it answer again, it gets everything back


def test_a_name_that_a_newer_process_has_taken_meanwhile_is_its_own(bench: Bench) -> None:
    bench.step()
    bench.ros.verdicts["/talker"] = Liveness(DEAD, "nothing listens")
    while not ("/talker" in bench.keeper.memory.suspects and "/talker" in bench.keeper.probed[1]):
        bench.step()
    newer = bench.ros.entries["/talker"] = replace(TALKER, uri="http://t:9/")
    bench.step()
    assert bench.registered()["/talker"].uri == newer.uri


def test_the_very_same_process_gets_everything_back(bench: Bench) -> None:
    """Its host was cut off for longer than it takes to be removed."""
    bench.step()
    before = bench.registered()
    bench.ros.verdicts["/talker"] = Liveness(DEAD, "no route to host")
    bench.steps(30)
    assert "/talker" not in bench.registered()
    del bench.ros.verdicts["/talker"]
    bench.steps(40)
    assert bench.registered() == before
    assert "/talker is back, process 7: restored /talker publisher /chatter, /talker service /talker/get" in bench.said


def test_its_own_registrations_are_none_of_its_business(bench: Bench) -> None:
    bench.ros.nodes["/ros_keeper"] = bench.ros.entries["/ros_keeper"] = Entry("http://k:1/", 1, {"/work/goal": "x"})
    bench.steps(3)
    assert "/ros_keeper" not in bench.keeper.memory.nodes


# ---- the connection that tells of the master's end


class Listening:
    """A master that accepts, and hangs up when it is told to, or after `idle` seconds."""

    def __init__(self, peers: Peers, idle: float) -> None:
        self.peers, self.idle, self.came, self.over = peers, idle, 0, threading.Event()
        self.address = ("127.0.0.1", peers.tcp(self._accepted))

    def _accepted(self, _peer: socket.socket) -> None:
        self.came += 1
        self.over.wait(self.idle)

    def end(self) -> None:
        """As a process that ends: nothing listens first, then the connections go."""
        self.peers.close()
        self.over.set()


@pytest.fixture
def woken(monkeypatch: pytest.MonkeyPatch) -> threading.Event:
    monkeypatch.setattr(keeper, "LEAST", 0.05)
    return threading.Event()


def test_a_master_that_hangs_up_on_the_silent_has_not_ended_and_its_end_is_noticed_at_once(
    peers: Peers, woken: threading.Event
) -> None:
    master = Listening(peers, idle=0.1)
    line = keeper.Lifeline(master.address, woken.set)
    until(line.hold)
    until(lambda: master.came >= 4)
    assert not woken.is_set()
    master.end()
    assert woken.wait(60)
    until(lambda: not line.stands)


def test_one_that_hangs_up_at_once_is_not_connected_to_all_the_time(peers: Peers, woken: threading.Event) -> None:
    master = Listening(peers, idle=0.0)
    line = keeper.Lifeline(master.address, woken.set)
    began = time.monotonic()
    line.hold()
    until(lambda: master.came == 4)
    assert time.monotonic() - began >= 3 * keeper.LEAST
    assert not woken.is_set()


def test_a_master_that_is_away_wakes_nobody(peers: Peers, woken: threading.Event) -> None:
    line = keeper.Lifeline(("127.0.0.1", peers.dead()), woken.set)
    line.hold()
    until(lambda: not line._thread.is_alive())  # type: ignore[union-attr]
    assert not line.hold()
    assert not woken.is_set()
