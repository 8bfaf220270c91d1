# SPDX-License-Identifier: GPL-3.0-or-later
"""The startup probe from look to line, on a fake clock and a fake graph."""

from __future__ import annotations

import json
import os
import time
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any
from unittest.mock import Mock

import pytest
from ansible_collections.rosops.fleet.plugins.module_utils._common.errors import RosError
from ansible_collections.rosops.fleet.plugins.module_utils._pod import started as started_command
from ansible_collections.rosops.fleet.plugins.module_utils._pod import state as kept
from ansible_collections.rosops.fleet.plugins.module_utils._pod.started import Owed
from ansible_collections.rosops.fleet.plugins.module_utils._pod.state import Settings, State, load_settings
from ansible_collections.rosops.fleet.plugins.module_utils._ros.contract import Contract
from ansible_collections.rosops.fleet.plugins.module_utils._ros.graph import PATIENCE, Graph, Rate
from ansible_collections.rosops.fleet.plugins.module_utils._ros.keeper_client import FORGETFUL, KeeperCalls
from ansible_collections.rosops.fleet.plugins.module_utils._ros.replies import NodeAnswer
from ansible_collections.rosops.fleet.plugins.module_utils._ros.roslaunch import Child
from ansible_collections.rosops.fleet.tests.unit.plugins.pod_graph import (
    OWN,
    PUBLISHER,
    SUBSCRIBER,
    URI,
    Clock,
    World,
    bus,
    contract,
)

SETTINGS = Settings(OWN, expect_node=True)
UNHEARD = f"not ready: edge {OWN} -> /out -> {SUBSCRIBER}: {SUBSCRIBER} is not connected to {OWN}"


@pytest.fixture(autouse=True)
def scratch(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(kept, "SCRATCH", str(tmp_path))
    monkeypatch.setattr(started_command, "is_here", lambda uri: uri == URI)


def started(world: World, clock: Clock | None = None, failed: bool = False, run: Any = None, **settings: Any) -> str:
    clock, here, children = clock or Clock(), settings.pop("here", {}), settings.pop("children", [])
    introduce, places = settings.pop("introduce", lambda _calls: None), settings.pop("places", {})
    measured, whole_since = settings.pop("measured", lambda graph, _nodes: graph), settings.pop("whole_since", 0.0)
    outside = started_command.Outside(
        run or (lambda *_: ""), lambda _state: here, lambda uri: started_command.is_here(uri), lambda _state: places,
        lambda _hosts: children, introduce, lambda: started_command.load_owed(SETTINGS), kept.save_state,
        measured, clock.now, clock.sleep, lambda since: since >= whole_since,
    )  # fmt: skip
    known = replace(SETTINGS, version=kept.load_settings(os.environ).version, **settings)
    return started_command.started(known, State(failed=failed), world, outside)


def owe(monkeypatch: pytest.MonkeyPatch, **changes: Any) -> None:
    owed = Owed(contract(**changes))
    monkeypatch.setattr(started_command, "load_owed", lambda *_: owed)


def test_ready_keeps_what_later_calls_need() -> None:
    assert started(World()) == ""
    assert kept.load_state(OWN) == State(URI, 71, {"/add": "rosrpc://127.0.0.1:40004"})


def test_without_contract_and_command_it_waits_until_nothing_more_is_registered() -> None:
    """A node is registered before it has advertised anything: connected to nobody, it would pass."""
    world, clock = World(), Clock()
    late = world.publishers.pop("/out")
    world.replies(OWN, bus=bus())
    clock.when = [(0.3, lambda: world.publishers.update({"/out": late}))]
    assert started(world, clock).startswith(UNHEARD)
    clock = Clock()
    assert started(World(), clock) == ""
    assert started_command.SETTLE <= clock.at <= started_command.SETTLE + 0.2


def test_the_command_is_asked_before_the_graph() -> None:
    """Else what the app registers in between, and then agrees, would not be looked at. It says that it has all."""
    world, before, clock = World(), list[int](), Clock()
    assert started(world, clock, command=["x"], run=lambda *_: before.append(len(world.asked)) or "") == ""
    assert (before, clock.at) == ([0], 0)


def test_the_commands_word_counts_and_rates_wait_for_it() -> None:
    world, clock, words = World(), Clock(), ["readiness.command exited with 1"]
    clock.when = [(3.0, words.clear)]
    assert started(world, clock, command=["x"], run=lambda *_: "".join(words), min_rates={"/out": 50}) == ""
    assert 3.0 <= clock.at < 3.2
    assert world.asked.count("rates") == 1
    said = started(World(), command=["x"], run=lambda *_: "exited with 1: no fix yet")
    assert said == "not ready: command readiness: exited with 1: no fix yet"


@pytest.mark.parametrize(("failed", "looks"), [(False, 101), (True, 21)])
def test_it_looks_ten_times_a_second_or_after_a_call_in_vain_twice_and_gives_up_after_ten(
    failed: bool, looks: int
) -> None:
    world, clock = World(), Clock()
    world.replies(OWN, bus=bus())
    assert started(world, clock, failed).startswith(UNHEARD)
    assert clock.at == pytest.approx(started_command.SECONDS)
    assert world.asked.count("state") == pytest.approx(looks, abs=2)


def test_what_waiting_cannot_mend_is_told_at_once_and_then_patiently(monkeypatch: pytest.MonkeyPatch) -> None:
    owe(monkeypatch, topics={"/out": {"type": "std_msgs/Bool", "publishers": {OWN: {}}}})
    clock = Clock()
    line = started(World(), clock)
    assert line == f"cannot become ready: topic /out: the type is std_msgs/String at {OWN}, not std_msgs/Bool"
    assert clock.at == 0
    assert started(World(), clock, failed=True) == line
    assert clock.at == pytest.approx(started_command.SECONDS)


def test_another_definition_cannot_be_mended(monkeypatch: pytest.MonkeyPatch) -> None:
    owe(monkeypatch)
    world = World()
    world.sums["/out"] = "cc"
    assert started(world).startswith("cannot become ready: topic /out: this version's definition")
    assert "rates" not in world.asked


def test_a_contract_that_comes_later_counts(monkeypatch: pytest.MonkeyPatch) -> None:
    clock = Clock()
    clock.when = [(0.2, lambda: owe(monkeypatch, services={"/gone": {}}))]
    assert started(World(), clock) == f"not ready: node {OWN}: as the version before: does not offer the service /gone"


@pytest.mark.parametrize("peer", [SUBSCRIBER, PUBLISHER])
def test_one_late_answer_of_a_peer_lets_nobody_in(peer: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """However long the connection has been missing: it is the peer itself that has to be gone."""
    owe(monkeypatch)
    world, clock = World(), Clock()
    world.replies(OWN, bus=bus())
    world.replies(PUBLISHER, bus=bus())
    answer = world.answers[peer]

    def late() -> None:
        world.replies(peer, error="no answer within 2 s")

    clock.when = [(2.0, late), (6.5, lambda: world.answers.update({peer: answer})), (8.0, late)]
    assert started(world, clock).startswith("not ready: ")


@pytest.mark.parametrize("peer", [SUBSCRIBER, PUBLISHER])
def test_a_peer_that_never_answers_is_waited_for_until_that_is_certain(
    peer: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    owe(monkeypatch)
    world, clock = World(), Clock()
    if peer == SUBSCRIBER:
        world.replies(OWN, bus=bus())
    world.replies(peer, error="no answer within 2 s")
    assert started(world, clock) == ""
    assert clock.at == pytest.approx(PATIENCE, abs=0.2)


def test_the_own_node_must_be_there() -> None:
    world = World()
    world.replies(OWN, uri="http://10.42.0.9:1/")
    assert started(world) == f"not ready: node {OWN}: registered from http://10.42.0.9:1/, which is not this pod"
    world.publishers, world.subscribers, world.services = {}, {}, {}
    assert started(world) == f"not ready: node {OWN}: not registered with the master"


def test_a_master_that_is_away_is_a_reason_to_wait(monkeypatch: pytest.MonkeyPatch) -> None:
    world = World()
    monkeypatch.setattr(world, "state", Mock(side_effect=RosError("the ROS master does not answer: nothing listens")))
    line = "not ready: master http://ros-master:11311: the ROS master does not answer: nothing listens"
    assert started(world) == line


def test_where_no_node_can_be_known_only_the_command_counts() -> None:
    world = World()
    assert started(world, expect_node=False) == ""
    assert started(world, expect_node=False, command=["x"], run=lambda *_: "no").startswith("not ready: command")
    assert world.asked == []


# ---- all nodes of a launch file


OTHER, OTHER_URI = "/mapper_0a1b2c3d", "http://127.0.0.1:40009/"
BOTH = {OWN: URI, OTHER: OTHER_URI}


@pytest.fixture
def two_nodes(monkeypatch: pytest.MonkeyPatch) -> World:
    """A second node of the same pod, which publishes a topic of its own."""
    world = World()
    world.answers[OTHER] = NodeAnswer(
        OTHER_URI, 79, bus=bus(("/map", SUBSCRIBER)), publications=[["/map", "std_msgs/String"]], subscriptions=[]
    )
    world.publishers["/map"], world.subscribers["/map"] = [OTHER], [SUBSCRIBER]
    world.types["/map"] = "std_msgs/String"
    monkeypatch.setattr(started_command, "is_here", lambda uri: uri in BOTH.values())
    monkeypatch.setenv("ROSOPS_REVISION", "0a1b2c3d")
    return world


def launched(world: World, clock: Clock | None = None, here: Any = None, **more: Any) -> str:
    settings = {"expect_node": False, "launch": "overlap", "app": "base", "here": BOTH if here is None else here}
    return started(world, clock, **{**settings, **more})


def owe_both(monkeypatch: pytest.MonkeyPatch) -> None:
    topics = {
        "/out": {"type": "std_msgs/String", "md5sum": None, "publishers": {OWN: {"rate": 100.0}}},
        "/map": {"type": "", "md5sum": None, "publishers": {OTHER: {"rate": None}}},
    }
    owe(monkeypatch, nodes=[OWN, OTHER], topics=topics)


def test_a_launch_file_is_started_when_nothing_more_is_registered(two_nodes: World) -> None:
    clock = Clock()
    assert launched(two_nodes, clock) == ""
    assert started_command.SETTLE_LAUNCH <= clock.at <= started_command.SETTLE_LAUNCH + 0.2
    assert kept.load_state(OWN) == State()  # which node it is has to be looked up each time


@pytest.mark.parametrize(
    ("connected", "here", "line"),
    [
        (True, {**BOTH, "/rostopic_12_1700000000000": "http://127.0.0.1:40010/"}, ""),  # a tool is none of its nodes
        (True, {}, "not ready: node base: none is registered from this pod's address"),
        (False, BOTH, f"not ready: edge {OTHER} -> /map -> {SUBSCRIBER}: {SUBSCRIBER} is not connected to {OTHER}"),
    ],
)
def test_every_node_of_a_launch_file_has_to_be_connected(
    two_nodes: World, connected: bool, here: dict[str, str], line: str
) -> None:
    if not connected:
        two_nodes.replies(OTHER, bus=bus())
    assert launched(two_nodes, here=here, failed=True) == line


def test_all_that_the_version_before_had_is_waited_for(two_nodes: World, monkeypatch: pytest.MonkeyPatch) -> None:
    owe_both(monkeypatch)
    clock = Clock()
    assert launched(two_nodes, clock) == ""
    assert clock.at == 0  # the contract says what there has to be
    words = f"topic /map: {OTHER} is registered, but down: not asked; node {OWN}: as the version before: "
    assert f"{words}does not start {OTHER}" in launched(two_nodes, here={OWN: URI}, failed=True)
    topics = {"/map": {"type": "", "md5sum": None, "publishers": {OWN: {"rate": None}}}}
    owe(monkeypatch, nodes=[OWN, OTHER], topics=topics)  # what one node had another one does not give
    assert f"topic /map: {OWN} lives, but does not publish it" in launched(two_nodes, failed=True)
    owe_both(monkeypatch)
    two_nodes.hz["/out"] = 50.0
    assert "rate /out: 50.0 Hz" in launched(two_nodes, failed=True)


def test_private_names_of_this_version_alone_are_on_their_way(two_nodes: World) -> None:
    two_nodes.publishers[f"{OTHER}/status"], two_nodes.subscribers[f"{OTHER}/status"] = [OTHER], []
    two_nodes.services[f"{OTHER}/get_loggers"] = [OTHER]
    words = f"topic {OTHER}/status: is private to this version, and has to move to the name that others know"
    assert launched(two_nodes, failed=True) == f"not ready: {words}"
    assert launched(two_nodes, launch="replace", failed=True).startswith("not ready: topic") is False


@pytest.mark.parametrize(
    ("alive", "code", "respawn", "words"),
    [
        (False, 3, False, "cannot become ready: node /arm/lidar: ended with exit code 3, and is not started again"),
        (False, -11, False, "cannot become ready: node /arm/lidar: ended with signal SIGSEGV, and is not started"),
        (False, 3, True, "not ready: node /arm/lidar: ended with exit code 3"),
        (False, 0, False, ""),  # it has done its work
    ],
)
def test_a_process_that_crashed_is_said(
    two_nodes: World, alive: bool, code: int | None, respawn: bool, words: str
) -> None:
    """roslaunch goes on without it, and the graph does not know of it."""
    child = Child("arm/lidar-3", "127.0.0.1", alive, code, respawn, False, 1)
    said = launched(two_nodes, children=[child])
    assert said.startswith(words) if words else not said
    # the address of the host is that of others, too
    assert launched(two_nodes, children=[child], host_network=True) == ""


def test_a_node_that_crashed_is_the_first_and_only_thing_that_is_said(
    two_nodes: World, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What others lack for it, as its topics, follows from that; and waiting does not help."""
    clock, child = Clock(), Child("arm/lidar-3", "127.0.0.1", False, 1, False, False, 1)
    owe(monkeypatch, nodes=[OWN, OTHER, "/arm/lidar"], subscriptions={"/scan": {"type": "", "peers": []}})
    said = launched(two_nodes, clock=clock, children=[child])
    assert said.startswith("cannot become ready: node /arm/lidar: ended with exit code 1")
    assert (OWN in said, clock.at < 1.0) == (False, True)


def test_a_contract_counts_for_whoever_names_his_nodes_himself(
    two_nodes: World, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert started(two_nodes, expect_node=False, here=BOTH) == ""
    assert two_nodes.asked == []
    owe_both(monkeypatch)
    assert "does not start" in started(two_nodes, expect_node=False, app="base", here={OWN: URI})


# ---- a version that no step has brought


UNPUBLISHED = "topic /out: /talker_0a1b2c3d_5 lives, but does not publish it"
BEFORE = "node /talker_0a1b2c3d_5: as the version before: "
POD, OLD, OLD_URI = "/talker_0a1b2c3d_5", "/talker_0a1b2c3d_4", "http://127.0.0.2:40001/"


class Beside(World):
    """The pod of `kubectl rollout restart`, and the one that it is to replace, which has all that the world has."""

    def __init__(self) -> None:
        super().__init__()
        for part in (self.publishers, self.subscribers, self.services):
            for nodes in part.values():
                nodes[:] = [OLD if node == OWN else node for node in nodes]
        known = self.answers.pop(OWN)
        self.answers[OLD] = replace(known, uri=OLD_URI)
        self.answers[PUBLISHER] = replace(self.answers[PUBLISHER], bus=bus(("/in", OLD), ("/in", POD)))
        self.answers[POD] = replace(known, publications=[], subscriptions=[], bus=bus(("/out", SUBSCRIBER)))
        self.probes["/add"] = replace(self.probes["/add"], provider=OLD)
        self.publishers["/rosout"].append(POD)

    me, version = POD, "_5"

    def offer(self, *what: str) -> None:
        """What the new pod's node has registered."""
        for topic in {*what} & {*self.publishers}:
            (self.subscribers if topic == "/in" else self.publishers)[topic].append(POD)
        if "/add" in what:
            self.services["/add"], self.probes["/add"] = [POD], replace(self.probes["/add"], provider=POD)


@pytest.fixture
def beside(monkeypatch: pytest.MonkeyPatch) -> Beside:
    monkeypatch.setenv("ROSOPS_REVISION", "0a1b2c3d")
    monkeypatch.setenv("ROSOPS_TEMPLATE_HASH", "5")
    monkeypatch.setattr(started_command, "load_owed", lambda *_: Owed(None, "ffffffff", ("/debug",)))
    return Beside()


def renewed(world: World, clock: Clock | None = None, **more: Any) -> str:
    """As after a call in vain: fewer looks."""
    return started(world, clock, failed=True, **{"node": POD, **more})


@pytest.mark.parametrize(
    ("offered", "lacking"),
    [
        (("/out", "/in", "/add"), ""),
        ((), f"{UNPUBLISHED}; {BEFORE}does not subscribe to /in; does not offer the service /add"),
    ],
)
def test_a_version_that_others_bring_owes_what_the_pod_before_has(
    beside: Beside, offered: tuple[str, ...], lacking: str
) -> None:
    """A node that is still loading what it works with has registered nothing but its log for long."""
    beside.publishers["/debug"] = [OLD]  # the inventory lets it go
    beside.offer(*offered)
    assert renewed(beside) == (f"not ready: {lacking}" if lacking else "")


def test_it_owes_the_rates_that_were_measured_of_the_pod_before(beside: Beside) -> None:
    beside.offer("/out", "/in", "/add")

    def measured(graph: Graph, nodes: Sequence[str]) -> Graph:
        assert list(nodes) == [OLD]
        key = graph.node(OLD).key
        return graph.measured({"/out": Rate(200.0, 200, 1.0, by={key: Rate(200.0, 200, 1.0, known=200.0)})}, {})

    assert "/out: 100 Hz" in renewed(beside, measured=measured).replace("100.0 Hz", "100 Hz")
    beside.hz["/out"] = 190.0
    assert renewed(beside, measured=measured) == ""


def test_what_it_offers_has_to_be_connected_as_the_pod_before_is(beside: Beside) -> None:
    beside.offer("/out", "/in", "/add")
    beside.replies(POD, bus=bus())
    assert renewed(beside, clock := Clock()).startswith(f"not ready: edge {POD} -> /out -> ")
    assert clock.at > PATIENCE  # its subscriber lives, and has the pod before


@pytest.mark.parametrize(
    ("why", "settings"),
    [
        ("it is down", {}),
        ("it is the version on trial beside this one", {}),
        ("clients say what it has", {"on_demand": True}),
        ("another app's", {}),
    ],
)
def test_it_owes_nothing(beside: Beside, monkeypatch: pytest.MonkeyPatch, why: str, settings: dict[str, Any]) -> None:
    if why == "it is down":
        beside.replies(OLD, error="nothing listens there", refused=True)
    if why.startswith("it is the version"):
        monkeypatch.setattr(started_command, "load_owed", lambda *_: Owed(other="0a1b2c3d"))
    if why == "another app's":
        monkeypatch.setenv("ROSOPS_TEMPLATE_HASH", "7")  # so that the node is none with a version behind its name
    clock = Clock()
    assert renewed(beside, clock, **settings) == ""
    assert clock.at >= started_command.SETTLE


def test_a_launch_file_owes_all_that_the_pod_before_has_started_but_what_waits_for_its_end(
    beside: Beside, monkeypatch: pytest.MonkeyPatch
) -> None:
    beside.offer("/out", "/in", "/add")
    for name in ("/map", "/arm"):
        beside.publishers[name] = [f"{name}_node_0a1b2c3d_4"]
        beside.answers[f"{name}_node_0a1b2c3d_4"] = NodeAnswer(OLD_URI.replace("40001", f"4{len(name)}"), 9, bus=bus())
    of_old = {name: answer.uri for name, answer in beside.answers.items() if name.endswith("_4")}
    pod: dict[str, Any] = {"expect_node": False, "launch": "overlap", "held": ["arm_node"], "here": {POD: URI}}
    pod["places"] = {**of_old, POD: URI, SUBSCRIBER: "http://127.0.0.1:40003/", "/rqt_1": OLD_URI}
    lacking = renewed(beside, **pod)
    assert "topic /map: /map_node_0a1b2c3d_5 is not registered with the master" in lacking
    assert f"{BEFORE}does not start /map_node_0a1b2c3d_5" in lacking
    monkeypatch.setattr(started_command, "is_here", lambda uri: uri.startswith("http://127.0.0.1"))
    beside.publishers["/map"].append("/map_node_0a1b2c3d_5")
    beside.answers["/map_node_0a1b2c3d_5"] = NodeAnswer(URI.replace("40001", "40007"), 10, bus=bus())
    pod["here"]["/map_node_0a1b2c3d_5"] = URI.replace("40001", "40007")
    assert renewed(beside, **pod) == ""


def test_the_record_calls_nodes_by_their_revisions(beside: Beside, monkeypatch: pytest.MonkeyPatch) -> None:
    """The own ones, whatever other pod of the revision there is, and those of another app of the same step."""
    beside.offer("/out", "/in", "/add")
    member = "/heard_99999999"
    owe(monkeypatch, edges=[[OWN, "/out", SUBSCRIBER], [OWN, "/out", member]], members=[OWN, member])
    assert f"edge {POD} -> /out -> {member}: {member} is not registered with the master" in renewed(beside)
    beside.subscribers["/out"].append(f"{member}_4")
    beside.answers[f"{member}_4"] = NodeAnswer("http://127.0.0.1:40009/", 9, bus=[])
    assert f"edge {POD} -> /out -> {member}_4: {member}_4 is not connected to {POD}" in renewed(beside)
    beside.replies(POD, bus=bus(("/out", SUBSCRIBER), ("/out", f"{member}_4")))
    beside.hz["/out"] = 100.0
    assert renewed(beside) == ""


ENVIRON = {"ROSOPS_REVISION": "0a1b2c3d"}


@pytest.mark.parametrize(
    ("changes", "counts", "other"),
    [
        ({}, True, ""),
        ({"until": 99}, True, ""),  # seconds since 1970: no clock lets a version in, whoever's it is
        ({"proven": False, "ignore": ["/debug/*"]}, True, ""),
        ({"proven": True, "ignore": ["/debug/*"]}, False, ""),
        ({"soak": 120.0}, False, ""),  # the keeper looks at it
        ({"revision": "ffffffff"}, False, "ffffffff"),
        ({"revision": "ffffffff", "proven": True}, False, ""),
        ({"revision": ""}, False, ""),
        ({"nodes": []}, False, ""),  # nothing was there before that answered
    ],
)
def test_a_contract_means_one_revision_until_it_is_proven(
    tmp_path: Path, changes: dict[str, Any], counts: bool, other: str
) -> None:
    contract = {"revision": "0a1b2c3d", "nodes": ["/r1/a_0a1b2c3d"], "ready_timeout": 120, "apps": ["a"], **changes}
    (tmp_path / "contract.json").write_text(json.dumps(contract))
    found = started_command.load_owed(load_settings(ENVIRON), tmp_path)
    assert found == Owed(Contract.from_dict(contract) if counts else None, other, tuple(changes.get("ignore", ())))


def test_without_a_contract_nothing_is_owed(tmp_path: Path) -> None:
    assert started_command.load_owed(load_settings(ENVIRON), tmp_path) == Owed()


def test_main_prints_one_line_and_keeps_it(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.setattr(started_command, "load_settings", lambda _environ: SETTINGS)
    monkeypatch.setattr(started_command, "started", lambda *_: "not ready: x")
    assert started_command.main([]) == 1
    assert capsys.readouterr().out == "not ready: x\n"
    assert kept.load_state(OWN) == State(failed=True)
    monkeypatch.setattr(started_command, "started", lambda *_: "")
    assert started_command.main([]) == 0
    assert capsys.readouterr().out == ""


def test_a_master_that_was_begun_anew_is_waited_for_until_it_has_been_given_all_back() -> None:
    """Else a peer of the app that it does not know yet would be taken for one that has gone."""
    world, clock = World(), Clock()
    assert started(world, clock, whole_since=4.0) == ""
    assert 4.0 <= clock.at < 4.3
    assert started(World(), whole_since=60.0) == f"not ready: master {world.uri}: {FORGETFUL}"


def test_main_asks_the_keeper_where_there_is_one(monkeypatch: pytest.MonkeyPatch) -> None:
    ages, seen = list[float](), list[started_command.Outside]()
    monkeypatch.setattr(KeeperCalls, "is_whole", lambda _calls, age: ages.append(age))
    monkeypatch.setattr(started_command, "started", lambda *words: seen.append(words[-1]) or "")
    for keeper in (None, "http://127.0.0.1:1"):
        monkeypatch.setattr(
            started_command, "load_settings", lambda _environ, uri=keeper: replace(SETTINGS, keeper=uri)
        )
        assert started_command.main([]) == 0
    assert [outside.is_whole(time.monotonic() - 5.0) for outside in seen] == [True, None]
    assert ages == [pytest.approx(5.0, abs=1.0)]


@pytest.mark.parametrize(
    ("lost", "told"), [(OWN, (SUBSCRIBER, "/out", "http://127.0.0.1:40003/")), (PUBLISHER, (OWN, "/in", URI))]
)
def test_a_subscriber_that_missed_its_publisher_is_told_of_it(lost: str, told: tuple[str, str, str]) -> None:
    """rospy connects to who registered in the moment of the subscriber's own registration only when told once more."""
    world, clock = World(), Clock()
    connected = world.answers[lost]
    world.replies(lost, bus=bus())
    calls: list[tuple[float, tuple[str, str, str]]] = []

    def introduce(subscribers: Any) -> None:
        calls.extend((clock.at, (node.name, gap.topic, node.uri)) for gap, node in subscribers.items())
        world.answers[lost] = connected

    assert started(world, clock, introduce=introduce) == ""
    assert [call for _at, call in calls] == [told]
    assert calls[0][0] == pytest.approx(started_command.MISSED, abs=0.2)


def test_one_that_does_not_answer_is_not_told_and_one_that_does_only_once() -> None:
    world, calls = World(), []
    world.replies(OWN, bus=bus())
    assert started(world, introduce=calls.append).startswith(UNHEARD)
    assert len(calls) == 1
    world.replies(SUBSCRIBER, error="it does not answer")
    assert started(world, introduce=calls.append) == ""
    assert len(calls) == 1


# ---- the app's command


@pytest.mark.parametrize(
    ("command", "reason"),
    [
        (["true"], ""),
        (["sh", "-c", "echo fine"], ""),
        (["false"], "readiness.command exited with 1"),
        (["sh", "-c", "echo warming up; echo no fix yet >&2; exit 3"], "readiness.command exited with 3: no fix yet"),
        (["sh", "-c", "kill -9 $$"], "readiness.command was ended by signal 9"),
        (["/nowhere/ready"], "readiness.command cannot be run: /nowhere/ready: No such file or directory"),
        (["sh", "-c", "yes 2>/dev/null | head -c 300000; exit 1"], "readiness.command exited with 1: y"),
    ],
)
def test_a_commands_word(command: list[str], reason: str) -> None:
    assert started_command.run_command(command, 5.0) == reason


def test_a_command_that_does_not_end_is_ended_with_its_children(tmp_path: Path) -> None:
    mark = tmp_path / "mark"
    began = time.monotonic()
    script = f"(sleep 4; echo late > {mark}) & sleep 60"
    assert started_command.run_command(["sh", "-c", script], 0.2) == "readiness.command did not end within 0.2 s"
    assert time.monotonic() - began < 4
    time.sleep(4.5)
    assert not mark.exists()


def test_a_child_that_keeps_the_output_open_keeps_nobody_waiting() -> None:
    began = time.monotonic()
    assert started_command.run_command(["sh", "-c", "sleep 8 & exit 0"], 20.0) == ""
    assert time.monotonic() - began < 8
