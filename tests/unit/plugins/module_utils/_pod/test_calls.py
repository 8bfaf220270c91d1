# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Service calls under way, as this machine's kernel shows the sockets of a server and its clients."""

from __future__ import annotations

import socket
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


def test_what_the_kernel_refuses_is_an_error(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(calls, "_BY_FAMILY", 9999)
    with pytest.raises(OSError, match="Invalid argument"):
        calls_under_way({1})
