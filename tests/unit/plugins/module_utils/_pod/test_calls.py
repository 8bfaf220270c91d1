# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Service calls under way, as this machine's kernel shows the sockets of a server and its clients."""

from __future__ import annotations

import socket
import struct
import threading
from collections.abc import Iterator

import pytest
from ansible_collections.rosops.fleet.plugins.module_utils._pod import calls
from ansible_collections.rosops.fleet.plugins.module_utils._pod.calls import calls_under_way


class Client:
    """Both ends of a connection."""

    def __init__(self, listener: socket.socket) -> None:
        self.end = socket.create_connection(listener.getsockname()[:2])
        self.server = listener.accept()[0]

    def asks(self, read: bool = True) -> None:
        self.end.sendall(b"question")
        if read:
            self.server.recv(100)

    def gets(self) -> None:
        self.server.sendall(b"answer")
        self.end.recv(100)

    def close(self) -> None:
        self.end.close()
        self.server.close()


@pytest.fixture(params=["127.0.0.1", "::1"])
def listener(request: pytest.FixtureRequest) -> Iterator[socket.socket]:
    family = socket.AF_INET6 if ":" in request.param else socket.AF_INET
    with socket.create_server((request.param, 0), family=family) as made:
        yield made


def test_a_call_is_a_question_without_an_answer(listener: socket.socket) -> None:
    ports = {listener.getsockname()[1]}
    client = Client(listener)
    try:
        assert calls_under_way(ports) == 0  # somebody who has said nothing yet
        for read in (True, False):
            client.asks()
            client.gets()  # headers
            assert calls_under_way(ports) == 0  # a persistent client at rest, and a subscriber
            client.asks(read)
            assert calls_under_way(ports) == 1
            assert calls_under_way({1}) == 0
            client.gets()
            client.server.setblocking(False)
            if not read:
                client.server.recv(100)
            client.server.setblocking(True)
            assert calls_under_way(ports) == 0
        client.asks()
        client.gets()
        client.asks()
        client.end.close()  # it does not want the answer any more
        assert calls_under_way(ports) == 0
    finally:
        client.close()


def test_every_connection_counts(listener: socket.socket) -> None:
    clients = [Client(listener) for _number in range(40)]
    try:
        for client in clients[::2]:
            client.asks()
        assert calls_under_way({listener.getsockname()[1]}) == 20
    finally:
        for client in clients:
            client.close()


def spoke(sent: int, received: int, acknowledged: int, segments: tuple[int, int]) -> bytes:
    """A struct tcp_info: ms since each, and segments of data that came and went."""
    return struct.pack("=44xL4x2L92x2L", sent, received, acknowledged, *segments)


@pytest.mark.parametrize(
    ("sent", "received", "acknowledged", "segments", "asking"),
    [
        (9, 8, 8, (2, 1), True),
        (8, 9, 4, (2, 2), False),
        # all within one tick of the kernel's clock
        (104, 104, 104, (6, 5), True),
        (104, 104, 60, (6, 6), False),  # the answer was acknowledged, 40 ms later as is usual
        (0, 0, 0, (6, 6), False),
        (104, 104, 60, (34, 6), False),  # it asks with an image and rests: it was waited for as long as it was there
        (168, 168, 168, (34, 5), True),
        (168, 168, 168, (1, 1), False),
        (168, 168, 168, (1, 34), False),  # a subscriber of a latched map
        (4, 4, 4, (6, 29), True),  # it got a map, and asked again at once: that call was cut off
    ],
)
def test_who_spoke_last(sent: int, received: int, acknowledged: int, segments: tuple[int, int], asking: bool) -> None:
    assert calls._is_asking(spoke(sent, received, acknowledged, segments), 0) is asking
    assert calls._is_asking(spoke(sent, received, acknowledged, segments), 1)
    with pytest.raises(OSError, match="too little"):
        calls._is_asking(b"", 0)


def test_who_asks_again_as_soon_as_a_large_answer_is_there_is_asking(listener: socket.socket) -> None:
    client, size = Client(listener), 300_000

    def answer() -> None:
        client.server.recv(100)
        client.server.sendall(b"m" * size)
        client.server.recv(100)

    server = threading.Thread(target=answer)
    server.start()
    try:
        client.end.sendall(b"question")
        client.end.recv(size, socket.MSG_WAITALL)
        client.end.sendall(b"question")
        server.join(10)
        assert calls_under_way({listener.getsockname()[1]}) == 1
    finally:
        client.close()


def test_what_the_kernel_refuses_is_an_error(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(calls, "_BY_FAMILY", 9999)
    with pytest.raises(OSError, match="Invalid argument"):
        calls_under_way({1})
