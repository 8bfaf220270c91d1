# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""The stand-in's bytes and its account, and what it tells rospy to do; on ROS itself it is run in tests/ros."""

from __future__ import annotations

import itertools
import json
import socket
import struct
import threading
from collections.abc import Iterator
from types import SimpleNamespace
from typing import Any

import pytest
from ansible_collections.rosops.fleet.plugins.module_utils._pod import stand_in
from ansible_collections.rosops.fleet.plugins.module_utils._ros.tcpros import decode_header, encode_header
from ansible_collections.rosops.fleet.tests.unit.plugins.fake_ros import Peers
from hypothesis import given
from hypothesis import strategies as st

OWN = {"steps": [], "code": "I", "own": True}
SHARED = {"steps": [4, 8, -1], "code": "Q", "own": False}


def numbered(number: int, frame: bytes = b"base") -> bytes:
    """A message with a header and a number that versions share."""
    return struct.pack("<IIII", number % 7, 0, 0, len(frame)) + frame + struct.pack("<Qd", number, 0.0)


def account(numbers: Any, place: dict[str, Any] | None = None, publisher: str = "/a") -> dict[str, Any]:
    made = stand_in.Account(SHARED if place is None else place)
    for number in numbers:
        made.take(publisher, numbered(number) if place is None else struct.pack("<I", number), 0.0, 0.0)
    return made.told()


@given(st.lists(st.integers(0, 60), min_size=1))
def test_numbers_that_versions_share(numbers: list[int]) -> None:
    found = account(numbers)
    there = set(numbers)
    assert found["messages"] == len(numbers)
    assert found["missing"] == max(there) - min(there) + 1 - len(there)
    assert found["twice"] == len(numbers) - len(there)


def test_two_versions_in_turn_are_one_account() -> None:
    made = stand_in.Account(SHARED)
    for number in range(100, 200):
        made.take("/sensor_a", numbered(number, b""), 0.0, 0.0)
    for number in range(195, 300):
        made.take("/sensor_b", numbered(number), 0.0, 0.0)
    assert made.told() == {
        **made.told(),
        "messages": 205,
        "missing": 0,
        "twice": 5,
        "publishers": ["/sensor_a", "/sensor_b"],
    }


@pytest.mark.parametrize(
    ("numbers", "missing"),
    [((5, 6, 7), 0), ((5, 8, 9), 2), ((5, 6, 1, 2), 0), ((5, 6, 1, 4), 2), ((5,), 0), ((), 0), ((7, 7), 0)],
)
def test_numbers_of_each_publisher_s_own(numbers: tuple[int, ...], missing: int) -> None:
    found = account(numbers, OWN)
    assert (found["missing"], found["twice"], found["messages"]) == (missing, 0, len(numbers))


def test_publishers_of_one_topic_are_numbered_each_for_itself() -> None:
    made = stand_in.Account(OWN)
    for publisher, number in (("/a", 1), ("/b", 50), ("/a", 2), ("/b", 52), ("/a", 3)):
        made.take(publisher, struct.pack("<I", number), 0.0, 0.0)
    assert made.told()["missing"] == 1


def test_messages_without_a_number() -> None:
    made = stand_in.Account(None)
    made.take("/a", b"", 0.0, 0.0)
    made.take("/a", b"123", 0.0, 0.0)
    assert made.told() == {**made.told(), "messages": 2, "missing": None, "publishers": ["/a"]}
    short = stand_in.Account(SHARED)
    short.take("/a", b"123", 0.0, 0.0)
    assert short.told()["missing"] == 0


def test_the_longest_silences() -> None:
    made = stand_in.Account(None)
    at = 0.0
    for number in range(100):
        at += 3.0 if number in (30, 60) else 0.5 + number / 1000
        made.take("/a", b"", at, 1000 + at)
    gaps = made.told()["gaps"]
    assert len(gaps) == stand_in.KEPT
    assert [seconds for _wall, seconds in gaps].count(3.0) == 2
    assert gaps == sorted(gaps)
    assert min(seconds for _wall, seconds in gaps) >= 0.58


@pytest.mark.parametrize("place", [None, OWN, SHARED])
def test_what_is_sent_is_of_its_size_and_has_its_number(place: dict[str, Any] | None) -> None:
    for number in (0, 1, 2**31 - 1):
        body = stand_in.blank(32, place, number)
        assert len(body) == 32
        assert place is None or stand_in.number_at(body, place) == number
    signed = {"steps": [], "code": "i", "own": False}
    assert stand_in.number_at(stand_in.blank(4, signed, 2**31 + 3), signed) == 3


class Rospy:
    """Writes down what is asked of it; it is shut down after so many looks."""

    AnyMsg = type("AnyMsg", (), {"_buff": None})
    ServiceException = type("ServiceException", (Exception,), {})

    def __init__(self, looks: int) -> None:
        self.looks = itertools.count()
        self.most = looks
        self.node = ""
        self.heard: dict[str, Any] = {}
        self.served: dict[str, Any] = {}
        self.sent: dict[str, list[bytes]] = {}
        self.kinds: dict[str, Any] = {}
        self.params: dict[str, str] = {}
        self.enough = threading.Event()
        self.uris: dict[str, str] = {}

    def init_node(self, name: str) -> None:
        self.node = name

    def is_shutdown(self) -> bool:
        return self.enough.is_set()

    def get_master(self) -> Any:
        return SimpleNamespace(lookupService=self._look_up)

    def _look_up(self, service: str) -> tuple[int, str, str]:
        if service == "/away":
            raise ConnectionRefusedError
        return (1, "", self.uris[service]) if service in self.uris else (-1, "no provider", "")

    def set_param(self, name: str, value: str) -> None:
        self.params[name] = value
        if next(self.looks) >= self.most:
            self.enough.set()

    def Subscriber(self, topic: str, kind: Any, got: Any) -> None:  # noqa: N802 - rospy's
        self.heard[topic] = (kind, got)

    def Service(self, name: str, kind: Any, handler: Any) -> None:  # noqa: N802
        self.served[name] = (kind, handler)

    def Publisher(self, topic: str, kind: Any, queue_size: int, latch: bool) -> Any:  # noqa: N802
        self.kinds[topic] = (kind, queue_size, latch)
        sent = self.sent.setdefault(topic, [])
        return SimpleNamespace(publish=lambda message: sent.append(message._buff))


TOPIC = {"type": "demo/Thing", "md5sum": "aa", "definition": "uint32 a", "place": OWN, "size": 4}
PLAN = {
    "name": "/arm/driver",
    "publishes": [
        {**TOPIC, "name": "/state", "latched": False, "rate": 500.0},
        {**TOPIC, "name": "/map", "latched": True, "rate": 0.0},
        {**TOPIC, "name": "/silent", "latched": False, "rate": 0.0},
    ],
    "subscribes": [{"name": "/odd", "type": "", "md5sum": "", "place": None}],
    "asks": [],
    "services": [{"name": "/arm/home", "type": "demo/Home", "md5sum": "bb"}],
}


def test_a_node(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(stand_in, "PERIOD", 0.02)
    rospy = Rospy(5)
    stand_in.Node(rospy, PLAN).play()
    assert rospy.node == "driver"
    kind, _got = rospy.heard["/odd"]
    assert (kind._type, kind._md5sum) == ("*", "*")
    assert rospy.sent["/map"] == [bytes(4)]
    assert rospy.sent["/silent"] == []
    numbers = [struct.unpack("<I", body)[0] for body in rospy.sent["/state"]]
    assert numbers == list(range(len(numbers)))
    assert len(numbers) > 1
    kind, _queue, latch = rospy.kinds["/map"]
    assert (kind._type, kind._md5sum, kind._full_text, latch) == ("demo/Thing", "aa", "uint32 a", True)
    kind, handler = rospy.served["/arm/home"]
    assert (kind._type, kind._md5sum, kind._request_class._md5sum) == ("demo/Home", "bb", "bb")
    with pytest.raises(rospy.ServiceException, match="no answer"):
        handler(None)


def test_the_account_is_a_parameter(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(stand_in, "PERIOD", 0.0)
    rospy = Rospy(0)
    node = stand_in.Node(rospy, PLAN)
    node.accounts["/odd"].take("/somebody", b"", 0.0, 0.0)
    node.play()
    assert list(rospy.params) == ["/rehearsal/arm/driver"]
    assert '"messages": 1' in rospy.params["/rehearsal/arm/driver"]


def header(**fields: str) -> bytes:
    return encode_header(fields)


@pytest.fixture
def peers() -> Iterator[Peers]:
    found = Peers()
    yield found
    found.close()


@pytest.mark.parametrize(
    ("reply", "answered"),
    [
        (header(callerid="/adder", md5sum="aa"), True),
        (header(error="not mine", callerid="/adder"), False),
        (b"", False),
        (b"\x05", False),
    ],
)
def test_a_greeting(peers: Peers, reply: bytes, answered: bool) -> None:
    asked: list[dict[str, str]] = []

    def talk(sock: socket.socket) -> None:
        size = struct.unpack("<I", sock.recv(4, socket.MSG_WAITALL))[0]
        asked.append(decode_header(sock.recv(size, socket.MSG_WAITALL)))
        sock.sendall(reply)

    uri = f"rosrpc://127.0.0.1:{peers.tcp(talk)}"
    assert stand_in.greet("/sum", uri, "/stats") is answered
    assert asked == [{"callerid": "/stats", "service": "/sum", "md5sum": "*", "probe": "1"}]


@pytest.mark.parametrize("uri", ["rosrpc://127.0.0.1:9", "nonsense"])
def test_nobody_to_greet(uri: str) -> None:
    assert stand_in.greet("/sum", uri, "/stats") is False


def test_greetings_are_part_of_the_account(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(stand_in, "PERIOD", 0.02)
    monkeypatch.setattr(stand_in, "PAUSE", 0.001)
    monkeypatch.setattr(
        stand_in, "greet", lambda service, uri, caller: (service, uri, caller) == ("/sum", "u", "/arm/driver")
    )
    rospy = Rospy(10)
    rospy.uris["/sum"] = "u"
    node = stand_in.Node(rospy, {**PLAN, "asks": ["/sum", "/nobody", "/away"]})
    node.play()
    told = json.loads(rospy.params["/rehearsal/arm/driver"])
    assert told["/sum"]["asked"] > 0
    assert told["/sum"]["refused"] == 0
    for service in ("/nobody", "/away"):
        assert told[service]["refused"] == told[service]["asked"] > 0
