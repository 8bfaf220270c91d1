# SPDX-License-Identifier: GPL-3.0-or-later
"""The registrar against peers that are late, gone or refuse."""

from __future__ import annotations

import pytest
from ansible_collections.rosops.fleet.plugins.module_utils._common.errors import RosError
from ansible_collections.rosops.fleet.plugins.module_utils._ros.registrar import Registrar
from ansible_collections.rosops.fleet.plugins.module_utils._ros.registrations import ALIVE, DEAD, UNKNOWN, Call, Entry
from ansible_collections.rosops.fleet.tests.unit.plugins.fake_ros import Peers


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
    answers = Registrar("http://127.0.0.1:1/", 0.5).ask(entries)
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
        Registrar(uri).apply([Call("publisher", "/n", "/t", "x/T", "http://n:1/")])


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
    Registrar(uri).apply([Call("subscriber", "/n", "/t", "x/T", node)])
    assert told == [["http://h/p:1/"], ["http://h/p:1/", "http://h/q:1/"]]


def test_no_master() -> None:
    with pytest.raises(RosError, match="does not answer"):
        Registrar("http://127.0.0.1:1/", 0.5).snapshot()
