# SPDX-License-Identifier: GPL-3.0-or-later
"""Nodes on loopback that latch."""

from __future__ import annotations

import socket
import struct
from typing import Any

from ansible_collections.rosops.fleet.plugins.module_utils._ros.raw_node import Publication, Slave

TOPIC = "/docked"
HEADER = {"type": "std_msgs/String", "md5sum": "992ce8a1687cec8c8bd883ec73ca41d1", "message_definition": "string data"}


class LatchingTopic(Publication):
    """What was published last is sent to whoever comes."""

    def __init__(self, topic: str = TOPIC, **fields: str) -> None:
        super().__init__(topic, {**HEADER, "latching": "1", **fields})
        self.last: bytes | None = None

    def publish(self, body: bytes) -> list[str]:
        self.last = body
        return super().publish(body)

    def welcome(self, sock: socket.socket, caller: str) -> None:  # noqa: ARG002 - to anybody
        if self.last is not None:
            sock.sendall(struct.pack("<I", len(self.last)) + self.last)


def latching_node(name: str, *topics: Publication) -> Slave:
    node = Slave(name, "127.0.0.1", 0, "http://127.0.0.1:1/")
    for topic in topics or (LatchingTopic(),):
        node.add(topic)
    node.start()
    return node


def subscriptions(*topics: str) -> dict[str, Any]:
    """What such a node answers who subscribes to these."""
    return {"getSubscriptions": lambda _caller: [1, "", [[topic, "*"] for topic in topics]]}
