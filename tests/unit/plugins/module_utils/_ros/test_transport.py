# SPDX-License-Identifier: GPL-3.0-or-later
"""Connections to peers on loopback that shake hands, or do not."""

from __future__ import annotations

import socket

import pytest
from ansible_collections.rosops.fleet.plugins.module_utils._common.errors import RosError
from ansible_collections.rosops.fleet.plugins.module_utils._ros.rpc import Deadline, connect
from ansible_collections.rosops.fleet.plugins.module_utils._ros.tcpros import encode_header
from ansible_collections.rosops.fleet.plugins.module_utils._ros.transport import handshake, read_frame, subscribe_status
from ansible_collections.rosops.fleet.tests.unit.plugins.fake_ros import Peers


def test_a_handshake(peers: Peers) -> None:
    seen: list[dict[str, str]] = []

    def answers(fields: dict[str, str]) -> list[bytes]:
        seen.append(fields)
        return [encode_header({"callerid": "/peer"}), b"\x03\x00\x00\x00abc"]

    with connect("127.0.0.1", peers.tcpros(answers), Deadline(5)) as sock:
        assert handshake(sock, {"callerid": "/us", "probe": "1"}) == {"callerid": "/peer"}
        assert read_frame(sock, 10) == b"abc"
    assert seen == [{"callerid": "/us", "probe": "1"}]


@pytest.mark.parametrize(
    ("data", "words"),
    [
        (encode_header({"error": "no such service"}), "refused: no such service"),
        (b"", "the connection was closed"),
        (b"\x10\x00\x00\x00abc", "in the middle of a message"),
        (b"\xff\xff\xff\xff", "a message of 4294967295 bytes"),
        (b"HTTP/1.1 400 Bad Request\r\n\r\n", "a message of"),
    ],
)
def test_a_handshake_that_fails(peers: Peers, data: bytes, words: str) -> None:
    def talk(sock: socket.socket) -> None:
        sock.recv(65536)
        sock.sendall(data)

    with connect("127.0.0.1", peers.tcp(talk), Deadline(5)) as sock, pytest.raises(RosError, match=words):
        handshake(sock, {"callerid": "/us"})


def test_a_topic_called_status_that_is_no_actions(peers: Peers) -> None:
    port = peers.tcpros(lambda _fields: [encode_header({"type": "std_msgs/String"})])
    node = peers.api("node", {"requestTopic": [1, "", ["TCPROS", "127.0.0.1", port]]})
    with pytest.raises(RosError, match="/work/status carries std_msgs/String, not actionlib_msgs/GoalStatusArray"):
        subscribe_status("/work", node, "/us", Deadline(5))
