# SPDX-License-Identifier: GPL-3.0-or-later
"""A process that waits for another one of its node's name: masters that answer, keep silent, and hang up."""

from __future__ import annotations

import socket
import threading

import pytest
from ansible_collections.rosops.fleet.plugins.module_utils._pod import namesake
from ansible_collections.rosops.fleet.tests.unit.plugins.fake_ros import Peers
from ansible_collections.rosops.fleet.tests.unit.plugins.pod_graph import Clock

NODE = "/planner"


class Master:
    """A ROS master that knows of one node at most."""

    def __init__(self, peers: Peers) -> None:
        self.uri = ""
        self.calls = peers.calls
        self.address = peers.api("master", {"lookupNode": self.look_up})

    def look_up(self, node: str) -> list[object]:
        return [1, "node api", self.uri] if self.uri and node == NODE else [-1, "unknown node", ""]


@pytest.fixture
def master(peers: Peers) -> Master:
    return Master(peers)


class Waiting:
    """The call, in a thread."""

    def __init__(self, master: str, own: str = "10.42.0.9") -> None:
        self.thread = threading.Thread(target=namesake.wait_for_its_end, args=(master, NODE, own), daemon=True)
        self.thread.start()

    def over(self, seconds: float) -> bool:
        self.thread.join(seconds)
        return not self.thread.is_alive()


def registered(master: Master) -> socket.socket:
    """Another process that has the name."""
    made = socket.create_server(("127.0.0.1", 0))
    master.uri = f"http://127.0.0.1:{made.getsockname()[1]}/"
    return made


def test_the_process_that_has_the_name_is_waited_for(master: Master) -> None:
    """To its very end: it leaves the graph before."""
    with registered(master) as old:
        waiting = Waiting(master.address)
        line, _address = old.accept()
        master.uri = ""
        assert not waiting.over(0.3)
    line.close()
    assert waiting.over(5)


def test_one_that_hangs_up_and_lives_is_waited_for_still(master: Master) -> None:
    with registered(master) as old:
        waiting = Waiting(master.address)
        for _time in range(2):
            old.accept()[0].close()
        assert not waiting.over(0.3)


def test_the_name_of_a_dead_one_is_free(master: Master) -> None:
    registered(master).close()
    assert Waiting(master.address).over(5)
    assert not namesake.outlasts("a..b", 1)  # whatever somebody has registered


def test_the_containers_own_last_life_is_nobody(master: Master) -> None:
    """Another process of the pod may have its port by now."""
    with registered(master):
        assert Waiting(master.address, own="127.0.0.1").over(5)


def test_a_name_given_up_in_silence_is_free(master: Master, monkeypatch: pytest.MonkeyPatch) -> None:
    """A host that loses its power closes no connection."""
    monkeypatch.setattr(namesake, "LOOK", 0.1)
    with registered(master) as old:
        waiting = Waiting(master.address)
        old.accept()
        assert not waiting.over(0.3)
        master.uri = ""
        assert waiting.over(5)


def test_a_master_that_answers_nothing_is_not_waited_for_for_ever(peers: Peers) -> None:
    clock = Clock()
    namesake.wait_for_its_end(f"http://127.0.0.1:{peers.dead()}", NODE, "", clock.now, clock.sleep)
    assert clock.at == pytest.approx(namesake.PATIENCE, abs=1)


def test_a_command_that_is_not_there_shows_at_once(master: Master, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("ROS_MASTER_URI", master.address)
    namesake.wait(NODE, "/nowhere/server")
    assert master.calls == []
    namesake.wait(NODE, "sh")
    assert len(master.calls) == 1
