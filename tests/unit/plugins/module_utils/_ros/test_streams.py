# SPDX-License-Identifier: GPL-3.0-or-later
"""Counting what comes over streams."""

from __future__ import annotations

import socket
import struct
import time

import pytest
from ansible_collections.rosops.fleet.plugins.module_utils._ros import streams
from ansible_collections.rosops.fleet.plugins.module_utils._ros.rpc import TimedSocket
from ansible_collections.rosops.fleet.plugins.module_utils._ros.streams import count_messages


class Publisher:
    """Sends messages of eight bytes at a steady rate, in a time that passes while the reader sleeps."""

    def __init__(self, hz: float) -> None:
        ours, self.theirs = socket.socketpair()
        self.ours = TimedSocket(fileno=ours.detach())
        self.ours.opened, self._hz, self._now, self._sent = 0.0, hz, 0.0, 0

    def monotonic(self) -> float:
        return self._now

    def sleep(self, seconds: float) -> None:
        self._now += seconds
        due = int(self._now * self._hz)
        self.theirs.sendall((struct.pack("<I", 8) + bytes(8)) * (due - self._sent))
        self._sent = due


def test_what_waited_while_other_streams_were_opened_makes_no_topic_faster() -> None:
    """A dead peer takes its time-out of 2 s; meanwhile a 500 Hz stream, opened before, piles up."""
    ours, theirs = socket.socketpair()
    stream = TimedSocket(fileno=ours.detach())
    stream.opened = time.monotonic() - 2.0
    theirs.sendall((struct.pack("<I", 8) + bytes(8)) * 1000)
    with theirs:
        rate = count_messages({("/scan", "/lidar"): (stream, {})}, {"/scan": 0.1})["/scan", "/lidar"]
    assert rate.messages == 1000
    assert rate.hz <= 501
    assert rate.seconds == pytest.approx(2.1, abs=0.1)


def test_nor_does_it_make_a_topic_slower(monkeypatch: pytest.MonkeyPatch) -> None:
    """What may be expected of a publisher is told by the time in which its stream was read."""
    publisher = Publisher(500)
    monkeypatch.setattr(streams, "time", publisher)
    publisher.sleep(2.0)
    with publisher.theirs:
        rate = count_messages({("/scan", "/lidar"): (publisher.ours, {})}, {"/scan": 1.0})["/scan", "/lidar"]
    assert rate.known == pytest.approx(500, rel=0.05)


@pytest.mark.parametrize("latching", ["1", "0"])
def test_a_latched_message_is_no_rate_and_nobody_waits_for_the_next_one(latching: str) -> None:
    ours, theirs = socket.socketpair()
    stream = TimedSocket(fileno=ours.detach())
    stream.opened = time.monotonic()
    theirs.sendall(2 * (struct.pack("<I", 8) + bytes(8)))
    with theirs:
        counted = count_messages({("/map", "/slam"): (stream, {"latching": latching})}, {"/map": 0.05}, patient=True)
    rate = counted["/map", "/slam"]
    assert (rate.messages, rate.latched, rate.few, rate.known) == (2, latching == "1", True, None)
    assert rate.seconds < 3


def test_a_patient_look_goes_on_until_a_slow_rate_is_known(monkeypatch: pytest.MonkeyPatch) -> None:
    publisher = Publisher(5)
    monkeypatch.setattr(streams, "time", publisher)
    with publisher.theirs:
        key, header = ("/scan", "/lidar"), {"latching": "0"}
        rate = count_messages({key: (publisher.ours, header)}, {"/scan": 0.3}, patient=True)[key]
    assert rate.messages >= 6
    assert rate.known == pytest.approx(5, rel=0.1)
