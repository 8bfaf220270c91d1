# SPDX-License-Identifier: GPL-3.0-or-later
"""Latched messages kept over the end of their node, on loopback, between nodes and a master that are not ROS's."""

from __future__ import annotations

import queue
import selectors
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from ansible_collections.rosops.fleet.plugins.module_utils._common.errors import RosError
from ansible_collections.rosops.fleet.plugins.module_utils._robot import latched_topics, memory
from ansible_collections.rosops.fleet.plugins.module_utils._robot.latched import EXPIRES, SETTLE
from ansible_collections.rosops.fleet.plugins.module_utils._robot.latched_topics import LatchedTopics
from ansible_collections.rosops.fleet.plugins.module_utils._robot.memory import KeptFiles
from ansible_collections.rosops.fleet.plugins.module_utils._ros import latched, raw_node
from ansible_collections.rosops.fleet.plugins.module_utils._ros.keeper_client import KeeperCalls
from ansible_collections.rosops.fleet.plugins.module_utils._ros.raw_node import Publication, Slave
from ansible_collections.rosops.fleet.plugins.module_utils._ros.registrar import Registrar
from ansible_collections.rosops.fleet.plugins.module_utils._ros.streams import TopicStream
from ansible_collections.rosops.fleet.tests.unit.plugins.fake_action import KEEPER, FakeMaster
from ansible_collections.rosops.fleet.tests.unit.plugins.fake_ros import Peers, until
from ansible_collections.rosops.fleet.tests.unit.plugins.latching import (
    HEADER,
    TOPIC,
    LatchingTopic,
    latching_node,
    subscriptions,
)

OLD, NEW = "/dock_0000000a", "/dock_0000000b"


@pytest.fixture(autouse=True)
def _quick(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(raw_node, "POLL", 0.01)
    monkeypatch.setattr(latched, "NOTHING", 0.05)


class Stage:
    """A master, nodes with a latched topic, and a keeper whose looks a test makes. Its clock stands still."""

    def __init__(self, directory: Path) -> None:
        self.directory, self.at = directory, 1000.0
        self.peers = Peers()
        self.master = FakeMaster(self.peers)
        self.nodes: list[Slave] = []
        self.streams: list[TopicStream] = []
        self.said: list[str] = []
        self.selector = selectors.DefaultSelector()
        self.slave, self.keeper = self.start_keeper()

    def start_keeper(self) -> tuple[Slave, LatchedTopics]:
        node = Slave(KEEPER, "127.0.0.1", 0, self.master.uri)
        self.nodes.append(node)
        made = LatchedTopics(
            Registrar(self.master.uri, 2.0, KEEPER),
            node,
            KeptFiles(str(self.directory), self.said.append),
            self.said.append,
            lambda: self.at,
        )
        made._begin = lambda: None  # type: ignore[method-assign] # a test looks by itself
        node.register({"keep_latched": made.keep})
        made.resume()
        node.start()
        return node, made

    def again(self) -> None:
        """The keeper's process ends, whatever it had open with it, and comes again."""
        self.slave.stop()
        for key in list(self.keeper.ears):
            self.keeper._close(self.selector, key)
        self.slave, self.keeper = self.start_keeper()

    def node(self, name: str, *topics: Publication) -> Slave:
        made = latching_node(name, *topics)
        self.nodes.append(made)
        self.master.nodes[name] = made.uri
        for topic in made.publications:
            self.master.publishers.setdefault(topic, []).append(name)
        return made

    def end_of(self, node: Slave) -> None:
        self.master.forget(node.name)
        node.stop()

    def hook(self, node: Slave) -> str:
        return KeeperCalls(self.slave.uri, "/hook").keep_latched(node.name, node.uri, 4.0)

    def look(self, later: float = 0.0) -> None:
        self.at += later
        self.keeper.look(self.selector)

    def subscriber(self, name: str, publisher: Slave) -> queue.Queue[bytes]:
        """What it gets; registered at an address of its own."""
        got: queue.Queue[bytes] = queue.Queue()
        self.master.nodes[name] = f"http://{name[1:]}:1/"
        self.master.subscribers.setdefault(TOPIC, []).append(name)
        self.connect(name, publisher, got)
        return got

    def connect(self, name: str, publisher: Slave, got: queue.Queue[bytes]) -> TopicStream:
        stream = TopicStream(name, TOPIC, publisher.uri, got.put)
        stream.connect(2.0)
        self.streams.append(stream)
        until(lambda: name in publisher.callers(TOPIC))
        return stream

    def offered(self) -> bool:
        return KEEPER in self.master.publishers.get(TOPIC, [])

    def files(self) -> list[str]:
        return sorted(file.name for file in (self.directory / "latched").glob("*"))

    def end(self) -> None:
        for stream in self.streams:
            stream.close()
        for key in list(self.keeper.ears):
            self.keeper._close(self.selector, key)
        self.selector.close()
        for node in self.nodes:
            node.stop()
        self.peers.close()


@pytest.fixture
def stage(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Stage]:
    (tmp_path / "boot_id").write_text("this one\n")
    monkeypatch.setattr(memory, "BOOT", tmp_path / "boot_id")
    # whom the master tells of a publisher is none of these tests' business
    monkeypatch.setattr(FakeMaster, "introduce", lambda _self, _topic: None)
    made = Stage(tmp_path)
    yield made
    made.end()


def followed(stage: Stage, old: Slave) -> Slave:
    """The next publisher, in whose place the keeper gives what the old one had latched."""
    assert stage.hook(old) == ""
    stage.look()
    stage.end_of(old)
    new = stage.node(NEW)
    stage.look()
    assert not stage.offered()
    stage.look(SETTLE)
    assert stage.offered()
    return new


def kept(stage: Stage) -> Slave:
    """The same, of one that nobody listened to."""
    topic = LatchingTopic()
    old = stage.node(OLD, topic)
    topic.publish(b"at the charger")
    return followed(stage, old)


def test_who_comes_later_gets_it_until_the_next_publisher_speaks(stage: Stage) -> None:
    new = kept(stage)
    late = stage.subscriber("/late", stage.slave)
    assert late.get(timeout=60) == b"at the charger"
    until(lambda: new.callers(TOPIC))
    new.publish(TOPIC, b"on the way")
    while stage.offered():
        stage.keeper.hear(stage.selector, 5.0)
    assert not stage.slave.publications
    assert not stage.streams[0].open or not stage.slave.callers(TOPIC)
    stage.look()
    assert (stage.keeper.values, stage.keeper.ears, stage.files()) == ({}, {}, [])
    assert stage.keeper._is_done()
    assert "has its own" in stage.said[-1]


def test_who_had_it_does_not_get_it_again_unless_it_subscribes_anew(stage: Stage) -> None:
    topic = LatchingTopic()
    old = stage.node(OLD, topic)
    topic.publish(b"go there")
    early = stage.subscriber("/early", old)
    assert early.get(timeout=60) == b"go there"
    followed(stage, old)
    stream = stage.connect("/early", stage.slave, early)
    assert stage.subscriber("/late", stage.slave).get(timeout=60) == b"go there"  # it has nothing to wait for
    assert early.empty()
    stream.close()
    until(lambda: "/early" not in stage.slave.callers(TOPIC))
    until(lambda: "/early" not in next(iter(stage.keeper.values.values())).had)
    stage.connect("/early", stage.slave, early)
    assert early.get(timeout=60) == b"go there"


def test_another_definition_of_the_type_needs_none(stage: Stage) -> None:
    topic = LatchingTopic()
    old = stage.node(OLD, topic)
    topic.publish(b"old")
    stage.node(NEW, LatchingTopic(md5sum="0" * 32))
    assert stage.hook(old) == ""
    stage.look()
    assert stage.keeper.values == {}


def test_what_others_have_latched_beside_it_leaves_it(stage: Stage) -> None:
    """/tf_static: each of its publishers latches a part of the whole."""
    other = LatchingTopic()
    stage.node("/other", other)
    other.publish(b"mine")
    kept(stage)
    ear = next(ear for (_topic, uri), ear in stage.keeper.ears.items() if uri == stage.master.nodes["/other"])
    while not ear.heard:
        stage.keeper.hear(stage.selector, 5.0)
    stage.look()
    assert stage.offered()


def test_without_a_next_publisher_it_is_not_given_and_goes_in_the_end(stage: Stage) -> None:
    new = kept(stage)
    stage.end_of(new)
    stage.look()
    assert not stage.offered()
    stage.look(EXPIRES - 1)
    assert stage.files()
    stage.look(1)
    assert (stage.keeper.values, stage.files()) == ({}, [])
    assert "nobody came in its place" in stage.said[-1]


def test_it_goes_on_after_a_restart_of_the_keeper(stage: Stage) -> None:
    kept(stage)
    late = stage.subscriber("/late", stage.slave)
    assert late.get(timeout=60) == b"at the charger"
    stage.look()
    stage.again()
    assert stage.said[-1] == f"still keeps what was latched on {TOPIC}"
    stage.look()
    stage.look(SETTLE)
    stage.connect("/late", stage.slave, late)
    assert stage.subscriber("/last", stage.slave).get(timeout=60) == b"at the charger"
    assert late.empty()


def test_a_boot_of_the_host_ends_it(stage: Stage) -> None:
    """Whatever node is started then knows of no event either. What the master has of it goes."""
    kept(stage)
    (stage.directory / "boot_id").write_text("another one\n")
    stage.again()
    assert (stage.keeper.values, stage.files()) == ({}, [])
    assert not stage.keeper._is_done()
    stage.look()
    assert not stage.offered()
    assert stage.keeper._is_done()


def test_a_file_that_is_not_whole_is_not_given(stage: Stage) -> None:
    kept(stage)
    (stage.directory / "latched" / stage.files()[0]).write_bytes(b"half")
    stage.again()
    assert (stage.keeper.values, stage.files()) == ({}, [])


def test_a_master_that_is_away_or_was_restarted_takes_nothing_from_it(stage: Stage) -> None:
    kept(stage)
    stage.master.away = True
    with pytest.raises(RosError):
        stage.look()
    stage.master.away = False
    stage.master.publishers[TOPIC].remove(KEEPER)
    stage.look()
    assert stage.offered()


def test_what_could_not_be_unregistered_is_so_at_the_next_look(stage: Stage, monkeypatch: pytest.MonkeyPatch) -> None:
    new = kept(stage)
    until(lambda: new.callers(TOPIC))
    new.publish(TOPIC, b"on the way")

    def away(_self: Registrar, _requests: Any) -> list[Any]:
        raise RosError("the master does not answer")

    with monkeypatch.context() as patched:
        patched.setattr(Registrar, "calls", away)
        with pytest.raises(RosError):
            while True:
                stage.keeper.hear(stage.selector, 5.0)
    assert stage.offered()
    assert not stage.keeper._is_done()
    stage.look()
    assert not stage.offered()
    assert stage.keeper._is_done()


def test_what_is_too_large_or_too_much_is_said_and_not_kept(stage: Stage, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(latched_topics, "MESSAGE", 100)
    monkeypatch.setattr(latched_topics, "TOTAL", 150)
    large, small, more = LatchingTopic("/large"), LatchingTopic("/small"), LatchingTopic("/more")
    large.publish(b"x" * 101)
    small.publish(b"x" * 100)
    more.publish(b"x" * 60)
    first, second = stage.node(OLD, large, small), stage.node("/second", more)
    assert "/large: 101 bytes, of 100 for a message" in stage.hook(first)
    assert [topic for topic, _node in stage.keeper.values] == ["/small"]
    assert "/more: 60 bytes" in stage.hook(second)
    assert len(stage.files()) == 1


def test_what_comes_too_late_takes_no_room(stage: Stage, monkeypatch: pytest.MonkeyPatch) -> None:
    late: list[Any] = []

    def in_vain(tasks: Any, _seconds: float, failed: Any) -> Any:
        late.extend(tasks.values())
        return {topic: failed(topic, TimeoutError()) for topic in tasks}

    topic = LatchingTopic()
    old = stage.node(OLD, topic)
    topic.publish(b"at the charger")
    monkeypatch.setattr(latched_topics, "in_parallel", in_vain)
    assert "no answer" in stage.hook(old)
    with pytest.raises(RosError, match="too late"):
        late[0]()
    assert (stage.keeper.taking, stage.files()) == ({}, [])


def test_whatever_a_node_is_called_its_files_are_counted(stage: Stage) -> None:
    topic = LatchingTopic()
    topic.publish(b"at the charger")
    uri = stage.node(OLD, topic).uri
    odd: Any = 5
    for _call in range(2):
        stage.keeper.keep(odd, uri, 4.0)
    assert len(stage.files()) == len(stage.keeper.values) == 1


def test_an_actions_topics_and_those_that_nobody_latched_are_left_out(stage: Stage) -> None:
    status, quiet, plain = LatchingTopic("/work/status"), LatchingTopic("/quiet"), Publication("/plain", HEADER)
    status.publish(b"no goals")
    node = stage.node("/worker", status, quiet, plain)
    node.server.methods.update(subscriptions("/work/goal"))
    assert stage.hook(node) == ""
    assert (stage.keeper.values, stage.files()) == ({}, [])
    assert stage.keeper._is_done()


def test_a_node_that_has_gone_is_said(stage: Stage) -> None:
    node = stage.node(OLD)
    uri = node.uri
    node.stop()
    assert f"nothing listens at {uri}" in KeeperCalls(stage.slave.uri, "/hook").keep_latched(OLD, uri, 4.0)


def test_the_loop_looks_and_ends_when_nothing_is_kept(stage: Stage, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(latched_topics, "LOOK", 0.01)
    monkeypatch.setattr(latched_topics, "SHARE", 0)
    topic = LatchingTopic()
    old = stage.node(OLD, topic)
    topic.publish(b"at the charger")
    del stage.keeper._begin  # the thread of its own
    stage.keeper.now = time.monotonic
    monkeypatch.setattr("ansible_collections.rosops.fleet.plugins.module_utils._robot.latched.SETTLE", 0.05)
    stage.master.away = True  # which ends no thread
    assert stage.hook(old) == ""
    thread = stage.keeper.thread
    stage.end_of(old)
    new = stage.node(NEW)
    stage.master.away = False
    until(stage.offered)
    until(lambda: new.callers(TOPIC))
    new.publish(TOPIC, b"on the way")
    assert thread is not None
    thread.join(10)
    assert not thread.is_alive()
    assert (stage.keeper.thread, stage.offered(), stage.files()) == (None, False, [])
