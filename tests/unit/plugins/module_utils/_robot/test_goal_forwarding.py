# SPDX-License-Identifier: GPL-3.0-or-later
"""Goals held and handed over on loopback, between clients, servers and a master that are not ROS's."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from ansible_collections.rosops.fleet.plugins.module_utils._robot import goal_forwarding as forwarding
from ansible_collections.rosops.fleet.plugins.module_utils._robot import goal_rules as rules
from ansible_collections.rosops.fleet.plugins.module_utils._robot import memory
from ansible_collections.rosops.fleet.plugins.module_utils._ros import raw_node
from ansible_collections.rosops.fleet.plugins.module_utils._ros.keeper_client import KeeperCalls
from ansible_collections.rosops.fleet.plugins.module_utils._ros.raw_node import Slave
from ansible_collections.rosops.fleet.plugins.module_utils._ros.registrar import Registrar
from ansible_collections.rosops.fleet.tests.unit.plugins.fake_action import (
    ACTION,
    KEEPER,
    FakeClient,
    FakeMaster,
    FakeServer,
)
from ansible_collections.rosops.fleet.tests.unit.plugins.fake_ros import Peers, until

SERVER = "/worker"


@pytest.fixture(autouse=True)
def _quick(monkeypatch: pytest.MonkeyPatch) -> None:
    """The same order of things in less time."""
    for module, name, seconds in (
        (forwarding, "TICK", 0.01), (forwarding, "LOOK", 0.02), (forwarding, "AGAIN", 0.02), (forwarding, "AWAY", 0.02),
        (forwarding, "INTRODUCE", 0.2), (forwarding, "FIRST", 2.0), (rules, "LINGER", 0.1), (rules, "GRACE", 0.05),
        (rules, "RECALL", 0.2), (rules, "PATIENCE", 2.0), (raw_node, "POLL", 0.01),
    ):  # fmt: skip
        monkeypatch.setattr(module, name, seconds)


class Stage:
    """A master, a server with a client, and a keeper beside them."""

    def __init__(self) -> None:
        self.peers = Peers()
        self.master = FakeMaster(self.peers)
        self.client = FakeClient(self.master)
        self.server = FakeServer(self.master)
        self.nodes: list[Slave] = [self.client, self.server]
        self.said: list[str] = []
        self.record: list[Any] = []
        self.unproven = False
        self.asked: list[tuple[str, str]] = []
        self.keeper = self.start_keeper()

    def start_keeper(self) -> forwarding.GoalForwarding:
        node = Slave(KEEPER, "127.0.0.1", 0, self.master.uri)
        self.nodes.append(node)
        ros = Registrar(self.master.uri, 2.0, KEEPER)
        made = forwarding.GoalForwarding(ros, node, self.write, self.said.append, self.stays)
        node.register(made.calls)
        made.resume(self.record[-1] if self.record else [])
        node.start()
        return made

    def write(self, content: Any) -> bool:
        self.record.append(content)
        return True

    def stays(self, action: str, server: str) -> bool:
        self.asked.append((action, server))
        return not self.unproven

    def replace(self) -> FakeServer:
        """The old server ends, and a new one of its name comes at another address."""
        self.server.end(self.master)
        self.server = FakeServer(self.master)
        self.nodes.append(self.server)
        return self.server

    def held(self) -> list[str]:
        state = self.keeper.state()[2]
        return list(state[ACTION]["held"]) if ACTION in state else []

    def end(self) -> None:
        for one in list(self.keeper.forwarders.values()):
            one.over = True
        for node in self.nodes:
            if isinstance(node, FakeServer):
                node.ended.set()
            node.stop()
        self.peers.close()


@pytest.fixture
def stage() -> Iterator[Stage]:
    made = Stage()
    until(lambda: made.client.callers(f"{ACTION}/goal") == [SERVER])
    yield made
    made.end()


def hold_one(stage: Stage) -> None:
    """A goal that came while its server is held."""
    stage.keeper.hold(ACTION, SERVER, 60.0)
    stage.client.send("one")
    until(lambda: stage.held() == ["one"])


def handed_over(stage: Stage) -> FakeServer:
    """The next server, when the hold has ended."""
    new = stage.replace()
    until(lambda: not stage.keeper.state()[2])
    return new


def test_a_server_is_replaced_and_no_goal_is_lost(stage: Stage) -> None:
    assert stage.client.send("before") == [SERVER]
    until(lambda: stage.server.got == ["before"])
    assert stage.keeper.hold(ACTION, SERVER, 60.0) == [1, "", 1]
    # the keeper has taken the server's place, and listens in its own name, too
    until(lambda: sorted(stage.client.callers(f"{ACTION}/goal")) == [KEEPER, SERVER])
    stage.client.send("one")
    stage.client.send("two")
    until(lambda: stage.held() == ["one", "two"])
    old, new = stage.server, stage.replace()
    until(lambda: not stage.keeper.state()[2])
    assert (old.got, new.got) == (["before"], ["one", "two"])
    assert KEEPER not in [name for nodes in stage.master.publishers.values() for name in nodes]
    until(lambda: stage.record[-1] == [])
    until(lambda: stage.client.callers(f"{ACTION}/goal") == [SERVER])  # the new one, by itself
    stage.client.send("after")
    until(lambda: new.got == ["one", "two", "after"])
    assert "goals of /work: let go, 2 forwarded" in stage.said


def test_a_server_that_may_go_back_gets_no_goal_and_its_successor_gets_them_all(stage: Stage) -> None:
    """A version that is refused later would take the goals that it got with it."""
    hold_one(stage)
    stage.unproven = True
    refused = stage.replace()
    until(lambda: stage.keeper.state()[2][ACTION]["server"] == refused.uri)
    asked = len(stage.asked)
    until(lambda: len(stage.asked) > asked + 1)
    stage.client.send("two")
    until(lambda: stage.held() == ["one", "two"])
    stage.unproven = False  # so is the one that comes back
    good = stage.replace()
    until(lambda: not stage.keeper.state()[2])
    assert (refused.got, good.got) == ([], ["one", "two"])


def test_without_goals_it_never_stands_in_the_graph(stage: Stage) -> None:
    stage.keeper.hold(ACTION, SERVER, 60.0)
    new = handed_over(stage)
    assert (new.got, KEEPER in stage.master.nodes) == ([], False)


def test_a_release_hands_them_to_the_server_that_was_there_all_along(stage: Stage) -> None:
    hold_one(stage)
    assert stage.server.got == []
    assert stage.keeper.release(ACTION) == [1, "", 1]
    assert stage.server.got == ["one"]
    assert stage.keeper.release(ACTION) == [1, "no goals of /work are held", 0]


def test_it_lets_go_when_the_clients_connection_to_the_server_stands_and_no_sooner(stage: Stage) -> None:
    """A subscriber calls itself connected before it is: what its client sends until then reaches nobody else."""
    stage.keeper.hold(ACTION, SERVER, 60.0)
    stage.server.way.clear()
    threading.Thread(target=stage.keeper.release, args=(ACTION,), daemon=True).start()
    until(lambda: stage.server.begun)
    end = time.monotonic() + 4 * (rules.LINGER + rules.GRACE)
    until(lambda: not stage.keeper.state()[2] or time.monotonic() > end)
    stage.client.send("one")
    stage.server.way.set()
    until(lambda: stage.server.got == ["one"])
    until(lambda: not stage.keeper.state()[2])
    stage.client.send("two")
    until(lambda: stage.server.got == ["one", "two"])


def test_a_server_that_did_not_hear_of_the_keeper_is_told_again(stage: Stage) -> None:
    """The master tells it once, and rospy tries a connection once: on a robot whose network is away, that is lost."""
    hold_one(stage)
    stage.master.silent = True
    stage.keeper.release(ACTION)
    until(lambda: stage.server.got == ["one"])
    until(lambda: not stage.keeper.state()[2])


def test_what_was_cancelled_meanwhile_is_cancelled_at_the_new_server(stage: Stage) -> None:
    hold_one(stage)
    stage.client.cancel("one")
    until(lambda: any("was cancelled while it is held" in line for line in stage.said))
    new = handed_over(stage)
    assert new.got == ["-one", "one"]


# whoever wanted it before a boot may be gone, for hours: a robot does not set out by itself
@pytest.mark.parametrize(("boot", "got"), [("", ["one"]), ("another", [])])
def test_a_keeper_that_is_started_anew_goes_on(
    stage: Stage, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, boot: str, got: list[str]
) -> None:
    stage.keeper.hold(ACTION, SERVER, 60.0)
    stage.client.send("one")
    until(lambda: bool(stage.record) and stage.record[-1] and stage.record[-1][0]["goals"])
    saved = stage.record[-1]
    for one in list(stage.keeper.forwarders.values()):
        one.over = True
        one.join(60)
    stage.record.append(saved)  # a process that is killed takes nothing back
    if boot:
        (tmp_path / "boot_id").write_text(boot)
        monkeypatch.setattr(memory, "BOOT", tmp_path / "boot_id")
    stage.keeper = stage.start_keeper()
    assert any(line.startswith("goals of /work: 1 goals ") for line in stage.said)
    assert handed_over(stage).got == got


def test_a_full_disk_ends_no_hold_and_is_made_good(stage: Stage, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(forwarding, "RETRY", 0.02)
    full, write = [True], stage.keeper.write
    tried: list[Any] = []

    def no_space(content: Any) -> bool:
        tried.append(content)
        return not full and write(content)

    stage.keeper.write = no_space
    assert stage.keeper.hold(ACTION, SERVER, 60.0) == [1, "", 1]
    stage.client.send("one")
    until(lambda: stage.held() == ["one"])
    assert handed_over(stage).got == ["one"]
    assert stage.record == []
    until(lambda: tried[-5:] == [[]] * 5)  # that it is all over is owed, too
    full.clear()
    until(lambda: stage.record == [[]])


def test_a_look_that_fails_ends_no_hold(stage: Stage, monkeypatch: pytest.MonkeyPatch) -> None:
    hold_one(stage)
    with monkeypatch.context() as broken:
        broken.setattr(stage.keeper.forwarders[ACTION], "sight", lambda _now: dict[str, Any]()["it"])
        until(lambda: "goals of /work: error: KeyError: 'it'" in stage.said)
    stage.master.away = True
    until(lambda: any("the master is away" in line for line in stage.said))
    stage.master.away = False
    assert handed_over(stage).got == ["one"]


@pytest.mark.parametrize("jump", [-86400.0, 86400.0])
def test_a_wall_clock_that_jumps_neither_ends_a_hold_nor_makes_it_last(
    stage: Stage, monkeypatch: pytest.MonkeyPatch, jump: float
) -> None:
    hold_one(stage)
    wall = time.time
    monkeypatch.setattr(time, "time", lambda: wall() + jump)
    assert 50 < stage.keeper.state()[2][ACTION]["seconds"] <= 60
    assert stage.keeper.release(ACTION) == [1, "", 1]
    assert stage.server.got == ["one"]


def test_the_seconds_to_go_are_on_record_although_nothing_happens(
    stage: Stage, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A keeper that is started again and again would hold for ever otherwise."""
    monkeypatch.setattr(forwarding, "KEEP", 0.02)
    stage.keeper.hold(ACTION, SERVER, 60.0)
    first = stage.record[-1][0]["seconds"]
    until(lambda: stage.record[-1][0]["seconds"] < first - 0.05)


def test_a_client_that_hangs_is_told_and_holds_up_nobody(stage: Stage, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(forwarding, "FIRST", 0.3)
    stage.master.nodes["/hung"] = f"http://127.0.0.1:{stage.peers.hung()}/"
    stage.master.publishers[f"{ACTION}/goal"].append("/hung")
    assert stage.keeper.hold(ACTION, SERVER, 60.0) == [1, "1 of 2 clients are not connected", 1]
    stage.client.send("one")
    until(lambda: stage.held() == ["one"])


def test_what_is_not_wholly_held_yet_is_let_go(stage: Stage, monkeypatch: pytest.MonkeyPatch) -> None:
    """Whoever waited for a hold in vain lets go of it."""
    monkeypatch.setattr(forwarding, "FIRST", 0.3)
    stage.master.nodes["/hung"] = f"http://127.0.0.1:{stage.peers.hung()}/"
    stage.master.publishers[f"{ACTION}/goal"].append("/hung")
    threading.Thread(target=stage.keeper.hold, args=(ACTION, SERVER, 60.0), daemon=True).start()
    until(lambda: bool(stage.keeper.state()[2]))
    assert stage.keeper.release(ACTION)[0] == 1
    until(lambda: not stage.keeper.state()[2])


def test_no_server_comes(stage: Stage, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(rules, "KEEP", 0.1)
    hold_one(stage)
    stage.server.end(stage.master)
    assert stage.keeper.release(ACTION) == [1, "", 0]
    assert "goals of /work: gave up one: no server came" in stage.said


def test_no_master_to_ask_who_the_server_is(stage: Stage) -> None:
    stage.keeper.ros = Registrar("http://127.0.0.1:9/", 0.5, KEEPER)
    code, why, _none = stage.keeper.hold(ACTION, SERVER, 60.0)
    assert (code, "the ROS master does not answer" in why, stage.keeper.state()[2]) == (0, True, {})


def test_who_holds_what_has_no_name_keeps_nobody_from_seeing_what_is_held(stage: Stage) -> None:
    keeper = KeeperCalls(stage.nodes[-1].uri, "/us")
    keeper.hold(5, SERVER, 60.0)  # type: ignore[arg-type] # as anybody may say
    assert keeper.held().keys() <= {"5"}


def test_switched_off_it_says_so_and_takes_nobodys_name(stage: Stage) -> None:
    node = Slave(KEEPER, "127.0.0.1", 0, stage.master.uri)
    stage.nodes.append(node)
    node.register(forwarding.SWITCHED_OFF)
    node.start()
    keeper = KeeperCalls(node.uri, "/us")
    assert keeper.hold(ACTION, SERVER, 60.0) == f"the keeper refused: {forwarding.OFF}"
    assert (keeper.release(ACTION), keeper.held()) == ("", {})
    assert stage.client.callers(f"{ACTION}/goal") == [SERVER]
    assert stage.client.send("one") == [SERVER]
