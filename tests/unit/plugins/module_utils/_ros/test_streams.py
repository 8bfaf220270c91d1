# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Counting what comes over streams."""

from __future__ import annotations

import socket
import struct
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
        rate = count_messages({("/scan", "/lidar"): stream}, {"/scan": 0.1})["/scan", "/lidar"]
    assert rate.messages == 1000
    assert rate.hz <= 501
    assert rate.seconds == pytest.approx(2.1, abs=0.1)
