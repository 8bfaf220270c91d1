# SPDX-License-Identifier: GPL-3.0-or-later
"""Counting what comes over streams."""

from __future__ import annotations

import socket
import struct
from typing import Any

import pytest
from ansible_collections.rosops.fleet.plugins.module_utils._ros import streams
from ansible_collections.rosops.fleet.plugins.module_utils._ros.graph import NodeKey, Rate
from ansible_collections.rosops.fleet.plugins.module_utils._ros.rpc import TimedSocket
from ansible_collections.rosops.fleet.plugins.module_utils._ros.streams import count_messages
from ansible_collections.rosops.fleet.tests.unit.plugins.fake_ros import until
from ansible_collections.rosops.fleet.tests.unit.plugins.latching import TOPIC, LatchingTopic, latching_node


class Publisher:
    """Sends messages of eight bytes at a steady rate, in a time that passes while the reader sleeps."""

    def __init__(self, hz: float, monkeypatch: pytest.MonkeyPatch) -> None:
        ours, self.theirs = socket.socketpair()
        self.ours = TimedSocket(fileno=ours.detach())
        self.ours.opened, self._hz, self._now, self._sent = 0.0, hz, 0.0, 0
        monkeypatch.setattr(streams, "time", self)

    def monotonic(self) -> float:
        return self._now

    def sleep(self, seconds: float) -> None:
        self._now += seconds
        self.send(int(self._now * self._hz) - self._sent)

    def send(self, messages: int) -> None:
        self._sent += messages
        self.theirs.sendall((struct.pack("<I", 8) + bytes(8)) * messages)

    def counted(self, seconds: float, patient: bool = False, **header: str) -> Rate:
        key = ("/scan", NodeKey("/lidar"))
        with self.theirs:
            return count_messages({key: (self.ours, header)}, {"/scan": seconds}, patient)[key]


def test_what_waited_while_other_streams_were_opened_makes_no_topic_faster_or_slower(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """A dead peer takes its time-out of 2 s; meanwhile a 500 Hz stream, opened before, piles up.

    What may be expected of a publisher is told by the time in which its stream was read.
    """
    publisher = Publisher(500, monkeypatch)
    publisher.sleep(2.0)
    rate = publisher.counted(1.0)
    assert (rate.messages, rate.seconds) == (pytest.approx(1500, abs=20), pytest.approx(3.0, abs=0.1))
    assert 490 < rate.hz <= 501
    assert rate.known == pytest.approx(500, rel=0.05)


@pytest.mark.parametrize("latching", ["1", "0"])
def test_a_latched_message_is_no_rate_and_nobody_waits_for_the_next_one(
    latching: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    publisher = Publisher(0, monkeypatch)
    publisher.send(2)
    rate = publisher.counted(0.05, patient=True, latching=latching)
    assert (rate.messages, rate.latched, rate.few, rate.known) == (2, latching == "1", True, None)
    assert rate.seconds < 3


def test_a_patient_look_goes_on_until_a_slow_rate_is_known(monkeypatch: pytest.MonkeyPatch) -> None:
    rate = Publisher(5, monkeypatch).counted(0.3, patient=True, latching="0")
    assert rate.messages >= 6
    assert rate.known == pytest.approx(5, rel=0.1)


def test_a_stream_that_opens_when_nobody_listens_any_more_is_closed(monkeypatch: pytest.MonkeyPatch) -> None:
    late: list[Any] = []

    def in_vain(tasks: Any, _seconds: float, failed: Any) -> Any:
        late.extend(tasks.values())
        return {source: failed(source, TimeoutError()) for source in tasks}

    monkeypatch.setattr(streams, "in_parallel", in_vain)
    node = latching_node("/talker", LatchingTopic())
    try:
        heard = streams.Streams("/us", 2.0, lambda *_: None)
        assert heard.keep([(TOPIC, "/talker", node.uri)])
        heard.keep(())
        late[0]()
        until(lambda: not node.callers(TOPIC))
    finally:
        node.stop()
