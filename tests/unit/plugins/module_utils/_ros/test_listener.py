# SPDX-License-Identifier: GPL-3.0-or-later
"""Conditions on messages, heard from nodes on loopback that are not ROS's."""

from __future__ import annotations

import struct
import threading
from collections.abc import Iterable, Iterator
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from types import SimpleNamespace
from typing import Any

import pytest
from ansible_collections.rosops.fleet.plugins.module_utils._common.errors import RosError
from ansible_collections.rosops.fleet.plugins.module_utils._common.poll import FAIL, PASS, WAIT
from ansible_collections.rosops.fleet.plugins.module_utils._ros import listener as listener_module
from ansible_collections.rosops.fleet.plugins.module_utils._ros import raw_node
from ansible_collections.rosops.fleet.plugins.module_utils._ros.backend import MasterState
from ansible_collections.rosops.fleet.plugins.module_utils._ros.conditions import ValueCondition
from ansible_collections.rosops.fleet.plugins.module_utils._ros.listener import Listener
from ansible_collections.rosops.fleet.plugins.module_utils._ros.raw_node import Slave
from ansible_collections.rosops.fleet.tests.unit.plugins.fake_ros import Peers, until

BATTERY = {"type": "demo/Battery", "md5sum": "0" * 32, "message_definition": "float32 percentage\n"}
FULL = ValueCondition("/battery", "percentage", above=0.5)


class Master:
    """Where everybody is."""

    caller, timeout = "/listener", 0.5

    def __init__(self) -> None:
        self.uris: dict[str, Any] = {}

    def look_up(self, nodes: Iterable[str]) -> tuple[dict[str, Any], dict[str, Any]]:
        return {node: self.uris[node] for node in nodes}, {}


class Stage:
    """Nodes that publish their batteries, and a listener."""

    def __init__(self, peers: Peers) -> None:
        self.peers, self.master, self.nodes = peers, Master(), dict[str, Slave]()

    def start(self, name: str, **header: str) -> Slave:
        node = self.nodes[name] = Slave(name, "127.0.0.1", 0, "http://127.0.0.1:1/")
        node.advertise("/battery", {**BATTERY, **header})
        node.start()
        self.master.uris[name] = node.uri
        return node

    def listener(self, *conditions: ValueCondition) -> Listener:
        return Listener(self.master, conditions)  # type: ignore[arg-type]

    def seen(self, listener: Listener) -> list[tuple[str, str]]:
        state = MasterState({"/battery": tuple(sorted(self.master.uris))} if self.master.uris else {}, {}, {})
        return [(check.verdict, check.reason) for check in listener.checks(state.graph)]

    def say(self, node: Slave, percentage: float, listener: Listener) -> None:
        """Said once it is heard: a publisher knows its subscriber a moment after that does, who may be late itself."""
        until(lambda: self.seen(listener) and node.publish("/battery", struct.pack("<f", percentage)))


@pytest.fixture
def stage(peers: Peers, monkeypatch: pytest.MonkeyPatch) -> Iterator[Stage]:
    monkeypatch.setattr(raw_node, "POLL", 0.01)
    made = Stage(peers)
    yield made
    for node in made.nodes.values():
        node.stop()


def test_nobody_speaks_and_then_somebody_does(stage: Stage) -> None:
    listener = stage.listener(FULL)
    assert stage.seen(listener) == [(WAIT, "nobody publishes it")]
    node = stage.start("/driver")
    ((verdict, reason),) = stage.seen(listener)  # it is given a moment
    assert verdict == WAIT
    assert reason.startswith("no message in ")
    stage.say(node, 0.75, listener)
    until(lambda: stage.seen(listener) == [(PASS, "is 0.75")])
    stage.say(node, 0.25, listener)
    until(lambda: stage.seen(listener) == [(WAIT, "is 0.25, not above 0.5")])


def test_each_publisher_is_heard_once_from_look_to_look(stage: Stage) -> None:
    one, two = stage.start("/one"), stage.start("/two")
    listener = stage.listener(FULL, ValueCondition("/battery", quiet=60.0))
    for _look in range(3):
        assert stage.seen(listener)[1][0] == WAIT
    assert (one.callers("/battery"), two.callers("/battery")) == (["/listener"], ["/listener"])
    stage.say(two, 1.0, listener)
    until(lambda: stage.seen(listener)[0] == (PASS, "is 1"))
    assert "since {'percentage': 1.0} came" in stage.seen(listener)[1][1]


def test_what_a_node_said_that_is_gone_counts_no_more(stage: Stage) -> None:
    node = stage.start("/driver")
    listener = stage.listener(FULL)
    stage.seen(listener)
    stage.say(node, 1.0, listener)
    until(lambda: stage.seen(listener) == [(PASS, "is 1")])
    stage.master.uris.clear()
    assert stage.seen(listener) == [(WAIT, "nobody publishes it")]
    until(lambda: node.callers("/battery") == [])


def test_a_stream_that_ends_is_opened_again(stage: Stage) -> None:
    node = stage.start("/driver")
    listener = stage.listener(ValueCondition("/battery", quiet=60.0))
    stage.seen(listener)
    until(lambda: node.callers("/battery"))
    node.unadvertise("/battery")
    until(lambda: stage.seen(listener)[0][1].endswith("does not publish /battery)"))
    node.advertise("/battery", BATTERY)
    until(lambda: stage.seen(listener)[0][1].endswith("since it is listened to"))
    until(lambda: node.callers("/battery") == ["/listener"])


def test_the_dead_are_silent_and_the_hung_may_say_anything(stage: Stage) -> None:
    """Of a node that is gone its registration may be left."""
    stage.master.uris["/dead"] = f"http://127.0.0.1:{stage.peers.dead()}/"
    listener = stage.listener(ValueCondition("/battery", quiet=0.001))
    until(lambda: stage.seen(listener)[0][0] == PASS)
    stage.master.uris["/hung"] = f"http://127.0.0.1:{stage.peers.hung()}/"
    ((verdict, reason),) = stage.seen(listener)
    assert verdict == WAIT
    assert "/hung (no answer from" in reason
    stage.master.uris["/hung"] = RosError("unknown node [/hung]")
    assert "/hung (unknown node [/hung])" in stage.seen(listener)[0][1]


def test_no_time_is_quiet_in_which_a_publisher_could_not_be_heard(stage: Stage) -> None:
    stage.master.uris["/driver"] = f"http://127.0.0.1:{stage.peers.hung()}/"
    listener = stage.listener(ValueCondition("/battery", quiet=0.3))
    assert "/driver (no answer from" in stage.seen(listener)[0][1]  # for longer than that
    stage.start("/driver")
    ((verdict, reason),) = stage.seen(listener)
    assert (verdict, reason) == (WAIT, "0.0 s of 0.3 s since it is listened to")
    until(lambda: stage.seen(listener)[0][0] == PASS)


def test_the_time_that_a_first_look_took_to_connect_is_no_quiet_time(
    stage: Stage, monkeypatch: pytest.MonkeyPatch
) -> None:
    """But for a second of it."""
    now = [0.0]
    monkeypatch.setattr(listener_module, "time", SimpleNamespace(monotonic=lambda: now[0]))
    stage.start("/driver")
    listener = stage.listener(ValueCondition("/battery", quiet=3.0))
    for later, calm in ((5.0, "1.0"), (1.5, "2.5")):
        now[0] += later
        assert stage.seen(listener) == [(WAIT, f"{calm} s of 3 s since it is listened to")]


DEEP = "".join(f"{'=' * 80}\nMSG: demo/A{number}\nA{number + 1} a\n" for number in range(2000))


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("Percentage percentage\n", "the definition of demo/Battery does not say what demo/Percentage is"),
        pytest.param(f"A0 a\n{DEEP}", "maximum recursion depth exceeded", id="deep"),
    ],
)
def test_a_definition_that_is_none_is_said(stage: Stage, text: str, words: str) -> None:
    """It is no silence, either."""
    node = stage.start("/driver", message_definition=text)
    listener = stage.listener(ValueCondition("/battery", quiet=0.001))
    stage.seen(listener)
    stage.say(node, 1.0, listener)
    until(lambda: stage.seen(listener)[0][0] == FAIL)
    assert words in stage.seen(listener)[0][1]


ANSWERS = {"/may": (204, b""), "/idle?of=arm": (200, b"at rest\nand more"), "/dock": (503, b"it is \x1bdocking")}


class Answers(BaseHTTPRequestHandler):
    def do_GET(self) -> None:
        if self.path == "/hangs":
            self.server.hung.wait(30)  # type: ignore[attr-defined]
        status, body = ANSWERS.get(self.path, (404, b""))
        self.send_response(status)
        self.end_headers()
        self.wfile.write(body)

    def log_message(self, *_arguments: Any) -> None:
        """Nobody reads it."""


@pytest.fixture
def url() -> Iterator[str]:
    server = ThreadingHTTPServer(("127.0.0.1", 0), Answers)
    server.hung = threading.Event()  # type: ignore[attr-defined]
    threading.Thread(target=server.serve_forever, daemon=True).start()
    yield f"http://127.0.0.1:{server.server_port}"
    server.hung.set()  # type: ignore[attr-defined]
    server.shutdown()
    server.server_close()


def test_a_server_says_by_its_status_whether_it_may_be(stage: Stage, url: str) -> None:
    wanted = {
        "/may": (PASS, "answers 204"),
        "/idle?of=arm": (PASS, "answers 200: at rest"),
        "/dock": (WAIT, "answers 503: it is \\x1bdocking"),
        "/away": (WAIT, "answers 404"),
    }
    listener = stage.listener(FULL, *(ValueCondition(url=url + path) for path in wanted))
    assert stage.seen(listener) == [(WAIT, "nobody publishes it"), *wanted.values()]


def test_a_server_that_does_not_answer_is_waited_for(stage: Stage, url: str) -> None:
    listener = stage.listener(ValueCondition(url=f"{url}/hangs"), ValueCondition(url="http://127.0.0.1:1/"))
    seen = stage.seen(listener)
    assert [verdict for verdict, _reason in seen] == [WAIT, WAIT]
    assert all(reason.startswith("it cannot be asked: ") for _verdict, reason in seen), seen
    assert "refused" in seen[1][1]
