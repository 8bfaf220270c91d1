# SPDX-License-Identifier: GPL-3.0-or-later
"""Latched messages taken from nodes on loopback, and given to others."""

from __future__ import annotations

import select
import socket
from collections.abc import Iterator
from pathlib import Path

import pytest
from ansible_collections.rosops.fleet.plugins.module_utils._common.errors import RosError
from ansible_collections.rosops.fleet.plugins.module_utils._ros import latched, raw_node
from ansible_collections.rosops.fleet.plugins.module_utils._ros.latched import Ear, give, take
from ansible_collections.rosops.fleet.plugins.module_utils._ros.raw_node import Publication, Slave
from ansible_collections.rosops.fleet.tests.unit.plugins.latching import HEADER, TOPIC, LatchingTopic, latching_node

LARGE = bytes(range(256)) * 2000  # more than one piece


@pytest.fixture
def topic() -> LatchingTopic:
    return LatchingTopic()


@pytest.fixture
def node(topic: LatchingTopic, monkeypatch: pytest.MonkeyPatch) -> Iterator[Slave]:
    monkeypatch.setattr(raw_node, "POLL", 0.01)
    monkeypatch.setattr(latched, "NOTHING", 0.05)
    made = latching_node("/dock", topic, Publication("/other", HEADER))
    yield made
    made.stop()


def any_size(_topic: str, _size: int) -> None:
    pass


def test_what_is_taken_is_given_byte_for_byte(node: Slave, topic: LatchingTopic, tmp_path: Path) -> None:
    topic.publish(LARGE)
    asked: list[tuple[str, int]] = []
    file = tmp_path / "1"
    header = take(TOPIC, node.uri, "/us", file, lambda *said: asked.append(said), 2.0)
    assert header == HEADER
    assert asked == [(TOPIC, len(LARGE))]
    ours, theirs = socket.socketpair()
    with ours, theirs:
        ours.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, 2 * len(LARGE))
        give(file, ours, 2.0)
        ours.shutdown(socket.SHUT_WR)
        assert b"".join(iter(lambda: theirs.recv(1 << 20), b"")) == len(LARGE).to_bytes(4, "little") + LARGE


def test_where_nothing_is_latched_nothing_is_taken(node: Slave, tmp_path: Path) -> None:
    file = tmp_path / "1"
    assert take(TOPIC, node.uri, "/us", file, any_size, 2.0) is None  # it latches, and has not yet
    assert take("/other", node.uri, "/us", file, any_size, 2.0) is None
    assert not file.exists()
    with pytest.raises(RosError, match="does not publish"):
        take("/nothing", node.uri, "/us", file, any_size, 2.0)


def test_what_there_is_no_room_for_is_not_read(node: Slave, topic: LatchingTopic, tmp_path: Path) -> None:
    def full(_topic: str, size: int) -> None:
        raise RosError(f"{size} are too many")

    topic.publish(LARGE)
    with pytest.raises(RosError, match="512000 are too many"):
        take(TOPIC, node.uri, "/us", tmp_path / "1", full, 2.0)
    assert list(tmp_path.iterdir()) == []


def listen(ear: Ear, news: int) -> None:
    """Until it has heard of so many messages."""
    while ear.news < news or not ear.heard:
        assert select.select([ear.sock], [], [], 5)[0]
        assert ear.listen()


def test_one_that_was_latched_before_is_heard_and_is_no_news(node: Slave, topic: LatchingTopic) -> None:
    topic.publish(b"before")
    ear = Ear(TOPIC, node.uri, "/us", 2.0)
    listen(ear, 0)
    assert (ear.heard, ear.news, ear.md5sum) == (True, 0, HEADER["md5sum"])
    topic.publish(LARGE)
    listen(ear, 1)
    topic.publish(b"and")
    listen(ear, 2)
    ear.sock.close()


def test_the_first_one_is_news_where_nothing_was_latched_before(
    node: Slave, topic: LatchingTopic, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(latched, "AT_ONCE", 0.0)  # it comes later than that
    ear = Ear(TOPIC, node.uri, "/us", 2.0)
    assert ear.listen()
    assert (ear.heard, ear.news) == (False, 0)
    while not topic.callers():
        pass
    topic.publish(b"now")
    listen(ear, 1)
    ear.sock.close()
    other = Ear("/other", node.uri, "/us", 2.0)
    while not node.callers("/other"):
        pass
    node.publish("/other", b"not latched")
    listen(other, 1)
    other.sock.close()


def test_the_end_of_a_publisher_is_noticed(node: Slave) -> None:
    ear = Ear(TOPIC, node.uri, "/us", 2.0)
    node.unadvertise(TOPIC)
    assert select.select([ear.sock], [], [], 5)[0]
    assert not ear.listen()
    ear.sock.close()
