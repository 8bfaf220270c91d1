# SPDX-License-Identifier: GPL-3.0-or-later
"""The minimal node on loopback, and streams of what it publishes."""

from __future__ import annotations

import http.client
import socket
import time
import xmlrpc.client
from collections.abc import Iterator, Mapping

import pytest
from ansible_collections.rosops.fleet.plugins.module_utils._ros import raw_node
from ansible_collections.rosops.fleet.plugins.module_utils._ros.raw_node import Said, Slave
from ansible_collections.rosops.fleet.plugins.module_utils._ros.streams import TopicStream
from ansible_collections.rosops.fleet.tests.unit.plugins.fake_ros import until
from ansible_collections.rosops.fleet.tests.unit.plugins.latching import HEADER


@pytest.fixture
def slave(monkeypatch: pytest.MonkeyPatch) -> Iterator[Slave]:
    monkeypatch.setattr(raw_node, "POLL", 0.01)
    made = Slave("/me", "127.0.0.1", 0, "http://127.0.0.1:1/")
    made.register({"twice": lambda number: 2 * number})
    made.start()
    yield made
    made.stop()


def test_messages_go_from_publication_to_stream(slave: Slave) -> None:
    slave.advertise("/t", HEADER)
    got: list[bytes] = []
    stream = TopicStream("/you", "/t", slave.uri, got.append)
    stream.connect(2.0)
    assert stream.header["md5sum"] == HEADER["md5sum"]
    until(lambda: slave.callers("/t"))
    assert slave.publish("/t", b"one") == ["/you"]
    assert slave.publish("/t", b"two") == ["/you"]
    until(lambda: got == [b"one", b"two"])
    assert xmlrpc.client.ServerProxy(slave.uri).getBusInfo("/x")[2] == [[0, "/you", "o", "TCPROS", "/t", True, ""]]  # type: ignore[index]
    stream.close()
    until(lambda: not slave.callers("/t") and not stream.open)
    assert slave.publish("/t", b"three") == []


def test_who_comes_while_the_publication_ends_is_hung_up_on_and_gets_the_next_one(
    slave: Slave, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Left connected to what nobody publishes on any more, it would not come again: ROS nodes connect once."""
    checked = raw_node.Publication.refusal

    def ends_meanwhile(publication: raw_node.Publication, fields: Mapping[str, str]) -> str:
        slave.unadvertise("/t")
        return checked(publication, fields)

    slave.advertise("/t", HEADER)
    with monkeypatch.context() as patched:
        patched.setattr(raw_node.Publication, "refusal", ends_meanwhile)
        late = TopicStream("/you", "/t", slave.uri, lambda _: None)
        late.connect(2.0)
    slave.advertise("/t", HEADER)
    until(lambda: not late.open)
    assert slave.callers("/t") == []
    TopicStream("/you", "/t", slave.uri, lambda _: None).connect(2.0)
    until(lambda: slave.callers("/t") == ["/you"])


def test_another_md5sum_is_refused(slave: Slave) -> None:
    slave.advertise("/t", HEADER)
    publication = slave.publications["/t"]
    assert publication.refusal({"md5sum": "other"})
    assert not publication.refusal({"md5sum": "*"})
    assert not publication.refusal({})


def test_its_own_calls_and_its_pages(slave: Slave) -> None:
    assert xmlrpc.client.ServerProxy(slave.uri).twice(21) == 42
    slave.show("/ready", lambda _asked: Said(503))
    slave.show("/v1/", lambda asked: Said(200, repr((asked.method, asked.path, asked.query, asked.body)).encode()))
    slave.show("/v1/bad", lambda _asked: Said(200, b"".join(["no"])))  # type: ignore[list-item] # that is what is bad
    for method, path, status, said in (
        ("GET", "/ready", 503, ""),
        ("GET", "/other", 404, ""),
        ("GET", "/v1/app?name=a", 200, "('GET', '/v1/app', {'name': 'a'}, b'')"),
        ("POST", "/v1/app", 200, "('POST', '/v1/app', {}, b'x')"),
        ("GET", "/v1/bad", 500, "TypeError: sequence item 0: expected a bytes-like object, str found"),
    ):
        link = http.client.HTTPConnection("127.0.0.1", slave.server.server_address[1], timeout=60)
        link.request(method, path, b"x" if method == "POST" else None)
        answer = link.getresponse()
        assert (answer.status, answer.read().decode()) == (status, said)
        link.close()


@pytest.mark.parametrize("length", ["-1", str(raw_node.MAX_CALL + 1), "9" * 50, "x", "0x10", "²"])
def test_a_call_without_an_end_is_not_read(slave: Slave, length: str) -> None:
    link = http.client.HTTPConnection("127.0.0.1", slave.server.server_address[1], timeout=60)
    link.request("POST", "/", b"", {"Content-Length": length})
    response = link.getresponse()
    assert f"a call has 0 to {raw_node.MAX_CALL} bytes" in response.read().decode()
    assert response.will_close
    link.close()


def knock(port: int, address: str = "127.0.0.1") -> socket.socket:
    return socket.create_connection(("127.0.0.1", port), 60, (address, 0))


@pytest.mark.parametrize("door", ["http", "tcpros"])
def test_nobody_takes_the_place_of_all(slave: Slave, door: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """A connection costs a thread: who has too many is hung up on at once, and others are served."""
    monkeypatch.setattr(raw_node, "MOST_OF_ONE", 3)
    monkeypatch.setattr(raw_node, "MOST", 4)
    port = int(slave.server.server_address[1] if door == "http" else slave.tcpros[2])
    guests = (slave.server if door == "http" else slave.listener).guests
    there = [knock(port) for _one in range(3)]
    until(lambda: len(guests) == 3)
    assert knock(port).recv(1) == b""
    other = knock(port, "127.0.0.2")
    until(lambda: len(guests) == 4)
    assert knock(port, "127.0.0.3").recv(1) == b""
    for one in (*there, other):
        one.close()
    until(lambda: not guests)


@pytest.mark.parametrize("sent", [b"", b"GET /ready HTTP/1.1\r\n", b"POST / HTTP/1.1\r\nContent-Length: 9\r\n\r\nx"])
def test_who_drips_is_hung_up_on(slave: Slave, sent: bytes, monkeypatch: pytest.MonkeyPatch) -> None:
    """However often a byte comes: in the line, in the headers, in the body."""
    monkeypatch.setattr(raw_node._Handler, "timeout", 0.3)
    link = knock(int(slave.server.server_address[1]))
    link.sendall(sent)
    link.settimeout(0.02)
    ended = time.monotonic() + 60
    while time.monotonic() < ended:
        try:
            if not link.recv(1 << 16):
                return
        except TimeoutError:
            link.sendall(b"x")
        except ConnectionError:
            return
    pytest.fail("it is listened to for ever")
