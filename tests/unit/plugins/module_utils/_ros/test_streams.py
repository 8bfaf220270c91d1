# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Counting what comes over streams."""

from __future__ import annotations

import socket
import struct
import threading
import time

import pytest
from ansible_collections.rosops.fleet.plugins.module_utils._ros.rpc import TimedSocket
from ansible_collections.rosops.fleet.plugins.module_utils._ros.streams import count_messages


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


def test_nor_does_it_make_a_topic_slower() -> None:
    """What may be expected of a publisher is told by the time in which its stream was read."""
    ours, theirs = socket.socketpair()
    stream = TimedSocket(fileno=ours.detach())
    stream.opened = time.monotonic() - 2.0
    frame, over = struct.pack("<I", 8) + bytes(8), threading.Event()
    theirs.sendall(frame * 1000)

    def publish() -> None:
        began, sent = time.monotonic(), 0
        while not over.wait(0.01):
            due = int((time.monotonic() - began) * 500)
            theirs.sendall(frame * (due - sent))
            sent = due

    publisher = threading.Thread(target=publish)
    publisher.start()
    with theirs:
        rate = count_messages({("/scan", "/lidar"): (stream, {})}, {"/scan": 1.0})["/scan", "/lidar"]
        over.set()
        publisher.join()
    assert rate.known == pytest.approx(500, rel=0.08)


@pytest.mark.parametrize(("latching", "known"), [("1", None), ("0", None)])
def test_a_latched_message_is_no_rate_and_nobody_waits_for_the_next_one(latching: str, known: float | None) -> None:
    ours, theirs = socket.socketpair()
    stream = TimedSocket(fileno=ours.detach())
    stream.opened = time.monotonic()
    theirs.sendall(struct.pack("<I", 8) + bytes(8))
    with theirs:
        counted = count_messages({("/map", "/slam"): (stream, {"latching": latching})}, {"/map": 0.05}, patient=True)
    rate = counted["/map", "/slam"]
    assert (rate.messages, rate.latched, rate.few, rate.known) == (1, latching == "1", True, known)
    assert rate.seconds < 3


def test_a_patient_look_goes_on_until_a_slow_rate_is_known() -> None:
    ours, theirs = socket.socketpair()
    stream = TimedSocket(fileno=ours.detach())
    stream.opened = time.monotonic()
    over = threading.Event()

    def publish() -> None:
        while not over.wait(0.2):
            theirs.sendall(struct.pack("<I", 8) + bytes(8))

    publisher = threading.Thread(target=publish)
    publisher.start()
    with theirs:
        key, header = ("/scan", "/lidar"), {"latching": "0"}
        rate = count_messages({key: (stream, header)}, {"/scan": 0.3}, patient=True)[key]
        over.set()
        publisher.join()
    assert rate.messages >= 6
    assert rate.known is None or rate.known == pytest.approx(5, rel=0.2)
