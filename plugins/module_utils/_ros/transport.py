# SPDX-License-Identifier: GPL-3.0-or-later
"""Connections that carry ROS 1's data: a topic's messages, a service's handshake. None of them is registered.

Nobody's list of subscribers changes, and no service is called.
"""

from __future__ import annotations

import time
from typing import Mapping

from .._common.errors import RosError
from .rpc import Api, Deadline, TimedSocket, address_of, connect
from .tcpros import STATUS_TYPE, decode_header, decode_status, encode_header

MAX_HEADER = 1024 * 1024  # a handshake carries the message definition
MAX_STATUS = 4 * 1024 * 1024


def read_exactly(sock: TimedSocket, size: int) -> bytes:
    data = bytearray()
    while len(data) < size:
        part = sock.recv(min(size - len(data), 1 << 16))
        if not part:
            raise RosError("the connection was closed" + (" in the middle of a message" if data else ""))
        data += part
    return bytes(data)


def read_frame(sock: TimedSocket, limit: int) -> bytes:
    size = int.from_bytes(read_exactly(sock, 4), "little")
    if size > limit:
        raise RosError(f"a message of {size} bytes, more than {limit}")
    return read_exactly(sock, size)


def handshake(sock: TimedSocket, fields: Mapping[str, str]) -> dict[str, str]:
    """Send our header and read the peer's. A peer that does not know what we ask for says so in a field `error`."""
    sock.sendall(encode_header(fields))
    reply = decode_header(read_frame(sock, MAX_HEADER))
    if "error" in reply:
        raise RosError(f"refused: {reply['error'][:200]}")
    return reply


def greet(service: str, uri: str, caller: str, deadline: Deadline) -> dict[str, str]:
    """Shake hands as a client does before a call; the service's header. The service itself is not called."""
    with connect(*address_of(uri, "rosrpc"), deadline) as sock:
        return handshake(sock, {"callerid": caller, "service": service, "md5sum": "*", "probe": "1"})


def subscribe(topic: str, uri: str, caller: str, deadline: Deadline) -> tuple[TimedSocket, dict[str, str]]:
    """A connection on which the node at `uri` sends the topic's messages from now on, and its header."""
    with Api(uri, caller, deadline) as api:
        transport = api.call("requestTopic", topic, [["TCPROS"]])
    if not (isinstance(transport, list) and transport[:1] == ["TCPROS"] and len(transport) >= 3):
        raise RosError(f"it offers no TCPROS for {topic}")
    host, port = transport[1:3]
    if not isinstance(host, str) or not isinstance(port, int) or not 0 < port < 65536:
        raise RosError(f"it offers {topic} at {host!r}, port {port!r}")
    sock = connect(host, port, deadline)
    try:
        fields = {"callerid": caller, "topic": topic, "md5sum": "*", "type": "*", "tcp_nodelay": "1"}
        header = handshake(sock, fields)
        sock.opened = time.monotonic()
        return sock, header
    except BaseException:
        sock.close()
        raise


def subscribe_status(action: str, uri: str, caller: str, deadline: Deadline) -> TimedSocket:
    """A connection on which an action server sends its status: the latched one, and then 5 a second."""
    sock, header = subscribe(f"{action}/status", uri, caller, deadline)
    found = header.get("type", STATUS_TYPE)
    if found != STATUS_TYPE:
        sock.close()
        raise RosError(f"{action}/status carries {found}, not {STATUS_TYPE}")
    return sock


def read_states(sock: TimedSocket) -> tuple[int, ...]:
    """The goals' states in the next status."""
    return tuple(state for _goal, state in decode_status(read_frame(sock, MAX_STATUS)))
