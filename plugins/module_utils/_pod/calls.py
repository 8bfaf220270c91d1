# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""How many service calls are under way at ports of this pod, as the kernel's sockets show it.

No node tells of its service connections. But in TCPROS whoever serves speaks last: on a connection whose client sent
something that is not answered yet, a call is under way; a persistent client that rests, and a topic's subscriber, wait
for the server to speak. The kernel says for every connection who spoke last (sock_diag(7), struct tcp_info of
linux/tcp.h).
"""

from __future__ import annotations

import os
import socket
import struct
from typing import Iterator

_NETLINK_SOCK_DIAG = 4
_BY_FAMILY, _REQUEST_DUMP = 20, 0x301
_ERROR, _DONE = 2, 3
_ESTABLISHED = 1 << 1
_WITH_INFO, _INFO = 1 << 1, 2  # inet_diag_req_v2.idiag_ext, and the attribute that it brings
_HEADER = struct.Struct("=LHHLL")
_QUESTION = struct.Struct("=BBBxL48x")
_MESSAGE = struct.Struct("!4x2H40x4x")  # the ports; after them come expires, rqueue, wqueue, uid, inode
_QUEUE = struct.Struct("=4xL12x")
_ATTRIBUTE = struct.Struct("=HH")
# ms since the last data went, and came, and since the peer last acknowledged any; segments of data that came and went
_SPOKE = struct.Struct("=44xL4x2L92x2L")
TIMEOUT = 1.0  # s for the kernel's answer


def calls_under_way(ports: set[int]) -> int:
    """Connections to these ports whose client waits for an answer; OSError where the kernel does not tell."""
    return sum(
        _is_asking(info, unread)
        for family in (socket.AF_INET, socket.AF_INET6)
        for port, unread, info in _connections(family)
        if port in ports
    )


def _is_asking(info: bytes, unread: int) -> bool:
    if unread:
        return True
    if len(info) < _SPOKE.size:
        raise OSError("the kernel tells too little of its connections")
    since_sent, since_received, since_acknowledged, segments_in, segments_out = _SPOKE.unpack_from(info)
    if since_sent != since_received:
        return bool(since_received < since_sent)
    # Within one tick of the kernel's clock. What the peer acknowledged later than it last spoke is our answer.
    if since_acknowledged < since_received:
        return False
    # Small messages are one segment each. Who got large ones may have asked again at once, so is waited for; except a
    # topic's subscriber, who sends its header and nothing more.
    return bool(segments_in > segments_out or 1 < segments_in < segments_out)


def _connections(family: int) -> Iterator[tuple[int, int, bytes]]:
    """Own port, bytes that nobody has read, and tcp_info of every connection."""
    question = _QUESTION.pack(family, socket.IPPROTO_TCP, _WITH_INFO, _ESTABLISHED)
    with socket.socket(socket.AF_NETLINK, socket.SOCK_DGRAM, _NETLINK_SOCK_DIAG) as sock:
        sock.settimeout(TIMEOUT)
        sock.sendall(_HEADER.pack(_HEADER.size + len(question), _BY_FAMILY, _REQUEST_DUMP, 1, 0) + question)
        while True:
            reply = sock.recv(1 << 16)
            while reply:
                length, kind, _flags, _sequence, _port = _HEADER.unpack_from(reply)
                if kind == _DONE:
                    return
                if kind == _ERROR:
                    (number,) = struct.unpack_from("=i", reply, _HEADER.size)
                    raise OSError(-number, os.strerror(-number))
                yield _parsed(reply[_HEADER.size : length])
                reply = reply[(length + 3) & ~3 :]


def _parsed(message: bytes) -> tuple[int, int, bytes]:
    port, _peer = _MESSAGE.unpack_from(message)
    (unread,) = _QUEUE.unpack_from(message, _MESSAGE.size)
    rest = message[_MESSAGE.size + _QUEUE.size :]
    while len(rest) >= _ATTRIBUTE.size:
        length, kind = _ATTRIBUTE.unpack_from(rest)
        if kind == _INFO:
            return port, unread, rest[_ATTRIBUTE.size : length]
        rest = rest[max((length + 3) & ~3, _ATTRIBUTE.size) :]
    return port, unread, b""
