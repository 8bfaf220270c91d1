# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""The minimal node and the writer on loopback, against each other and against peers that misbehave."""

from __future__ import annotations

import http.client
import time
import xmlrpc.client
from typing import Any, Callable, Iterator

import pytest
from ansible_collections.rosops.fleet.plugins.module_utils._common.errors import RosError
from ansible_collections.rosops.fleet.plugins.module_utils._ros.raw_node import Slave, Stream
from ansible_collections.rosops.fleet.plugins.module_utils._ros.registrar import RosWriter
from ansible_collections.rosops.fleet.plugins.module_utils._ros.registrations import ALIVE, DEAD, UNKNOWN, Call, Entry
from ansible_collections.rosops.fleet.tests.unit.plugins.fake_ros import Peers

HEADER = {
    "type": "std_msgs/String",
    "md5sum": "992ce8a1687cec8c8bd883ec73ca41d1",
    "message_definition": "string data\n",
}


@pytest.fixture
def slave() -> Iterator[Slave]:
    made = Slave("/me", "127.0.0.1", 0, "http://127.0.0.1:1/", {"twice": lambda number: 2 * number})
    made.start()
    yield made
    made.stop()


@pytest.fixture
def peers() -> Iterator[Peers]:
    made = Peers()
    yield made
    made.close()


def until(true: Callable[[], Any]) -> None:
    end = time.monotonic() + 5
    while not true():
        assert time.monotonic() < end
        time.sleep(0.005)


def test_messages_go_from_publication_to_stream(slave: Slave) -> None:
    slave.advertise("/t", HEADER)
    got: list[bytes] = []
    stream = Stream("/you", "/t", slave.uri, got.append)
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


def test_the_end_of_a_publication_ends_its_streams(slave: Slave) -> None:
    slave.advertise("/t", HEADER)
    stream = Stream("/you", "/t", slave.uri, lambda _: None)
    stream.connect(2.0)
    until(lambda: slave.callers("/t"))
    slave.unadvertise("/t")
    until(lambda: not stream.open)
    with pytest.raises(RosError, match="does not publish"):
        Stream("/you", "/t", slave.uri, lambda _: None).connect(2.0)


def test_another_md5sum_is_refused(slave: Slave) -> None:
    slave.advertise("/t", HEADER)
    publication = slave.publications["/t"]
    assert publication.refusal({"md5sum": "other"})
    assert not publication.refusal({"md5sum": "*"})
    assert not publication.refusal({})


def test_its_own_calls_and_the_probe(slave: Slave) -> None:
    assert xmlrpc.client.ServerProxy(slave.uri).twice(21) == 42
    for path, status in (("/ready", 200), ("/other", 404)):
        link = http.client.HTTPConnection("127.0.0.1", slave.server.server_address[1], timeout=2)
        link.request("GET", path)
        assert link.getresponse().status == status
        link.close()


# ---- the writer


def test_who_is_dead_and_who_is_only_late(peers: Peers) -> None:
    node = peers.api("node", {"getPid": [1, "", 7], "getPublications": [1, "", [["/a", "x/A"]]]})
    uris = {
        "/alive": node,
        "/dead": f"http://127.0.0.1:{peers.dead()}/",
        "/hung": f"http://127.0.0.1:{peers.hung()}/",
        "/nameless": "http://no-such-name.invalid:1/",
        "/odd": peers.api("odd", {"getPid": [1, "", "seven"]}),
    }
    entries = {name: Entry(uri) for name, uri in uris.items()}
    answers = RosWriter("http://127.0.0.1:1/", 0.5).ask(entries)
    assert {name: answer.verdict for name, answer in answers.items()} == {
        "/alive": ALIVE,
        "/dead": DEAD,
        "/hung": UNKNOWN,
        "/nameless": UNKNOWN,
        "/odd": UNKNOWN,
    }
    # it does not know getSubscriptions: that says nothing of its subscriptions
    assert (answers["/alive"].pid, answers["/alive"].publications) == (7, frozenset({"/a"}))
    assert answers["/alive"].subscriptions is None


def test_a_call_that_the_master_refuses(peers: Peers) -> None:
    uri = peers.api("master", {"registerPublisher": [-1, "no", 0]}, multicall=True)
    with pytest.raises(RosError, match="refused registerPublisher /n /t"):
        RosWriter(uri).apply([Call("publisher", "/n", "/t", "x/T", "http://n:1/")])


def test_a_subscriber_is_told_until_the_list_stays_the_same(peers: Peers) -> None:
    """A publisher came while the first list was on its way."""
    told: list[list[str]] = []
    node = peers.api("node", {"publisherUpdate": lambda _topic, uris: told.append(uris) or [1, "", 0]})
    publishers = iter([["/p"], ["/p", "/q"], ["/p", "/q"]])
    replies = {
        "registerSubscriber": [1, "", []],
        "getSystemState": lambda: [1, "", [[["/t", next(publishers)]], [], []]],
        "getTopicTypes": [1, "", []],
        "lookupNode": lambda name: [1, "", f"http://h{name}:1/"],
    }
    uri = peers.api("master", replies, multicall=True)
    RosWriter(uri).apply([Call("subscriber", "/n", "/t", "x/T", node)])
    assert told == [["http://h/p:1/"], ["http://h/p:1/", "http://h/q:1/"]]


def test_no_master() -> None:
    with pytest.raises(RosError, match="does not answer"):
        RosWriter("http://127.0.0.1:1/", 0.5).snapshot()
