# SPDX-License-Identifier: GPL-3.0-or-later
"""Counts out of getBusStats: what rospy and roscpp really answer, wraps, resets, copies to several subscribers."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import pytest
from ansible_collections.rosops.fleet.plugins.module_utils._common.errors import RosError
from ansible_collections.rosops.fleet.plugins.module_utils._ros import bus_stats
from ansible_collections.rosops.fleet.plugins.module_utils._ros.bus_stats import (
    IN,
    OUT,
    Count,
    Counted,
    Stats,
    advance,
    stats,
)
from ansible_collections.rosops.fleet.plugins.module_utils._ros.client import Ros1Client
from ansible_collections.rosops.fleet.plugins.module_utils._ros.graph import Graph, Node, Rate, Topic
from ansible_collections.rosops.fleet.tests.unit.plugins.fake_ros import Peers, recorded

NODES = recorded("nodes")
ME = ("http://127.0.0.1:1/", 7)
TALK = ("/chatter", OUT)
HEAR = ("/chatter", IN)


def raw(library: str, links: Iterable[tuple[int, int]], way: str, topic: str, size: int) -> Any:
    """What a node answers of one topic, with (connection, messages) of each of its links."""
    if way == IN:
        entry: list[Any] = [topic, [[number, size * count, count, -1, True] for number, count in links]]
    elif library == "rospy":
        entry = [topic, 0, [[number, size * count, count, True] for number, count in links]]
    else:
        entry = [topic, [[number, size * count, 0, count, 0] for number, count in links]]
    value = [[entry], []] if way == OUT else [[], [entry]]
    return [1, "", [*value, []]] if library == "rospy" else value


def rospy(*links: tuple[int, int], way: str = OUT, topic: str = "/chatter", size: int = 8) -> Stats:
    return stats(raw("rospy", links, way, topic, size))


def roscpp(*links: tuple[int, int], way: str = OUT, size: int = 8) -> Stats:
    return stats(raw("roscpp", links, way, "/chatter", size))


def after(*replies: Stats, fresh: bool = False) -> Counted:
    counted: Counted | None = None
    for reply in replies:
        counted = advance(counted, ME, reply, fresh)
    assert counted is not None
    return counted


# ---- the recorded replies


def test_what_both_libraries_answer() -> None:
    found = stats(NODES["/talker_a"]["getBusStats"])
    assert (found.wraps, found.links[("/chatter", OUT, 1)]) == (False, Count(34, 602))
    assert {link for link in found.links if link[0] == "/chatter"} == {("/chatter", OUT, i) for i in (1, 3, 5)}
    found = stats(NODES["/listener_a"]["getBusStats"])
    assert found.links[("/chatter", IN, 2)] == Count(7, 256)
    assert ("/rosout", OUT) in found.flows  # without a connection
    found = stats(NODES["/relay"]["getBusStats"])
    assert found.wraps
    assert found.links == {
        ("/rosout", OUT, 0): Count(1, 147),
        ("/chatter_relay", OUT, 2): Count(36, 468),
        ("/chatter", IN, 3): Count(15, 135),
    }
    assert ("/rosout_agg", OUT) in stats(NODES["/rosout"]["getBusStats"]).flows


@pytest.mark.parametrize("reply", [None, 7, [], [1, ""], [1, "", 7], [1, "", []], [0, "no", []], "x", [[]]])
def test_what_is_no_reply_is_an_error(reply: Any) -> None:
    with pytest.raises(RosError):
        stats(reply)


@pytest.mark.parametrize(
    "entry",
    [7, [], ["/a"], [7, []], ["/a", 7], ["/a", [7]], ["/a", [[1, 2]]], ["/a", [["x", 1, 1, True]]], ["/a", [None]]],
)
def test_rows_without_sense_are_left_out(entry: Any) -> None:
    assert stats([1, "", [[entry], [entry], []]]).links == {}


# ---- counting


@pytest.mark.parametrize(
    ("replies", "flow", "messages"),
    [
        # a restarted exporter must not count again
        ([rospy((1, 500))], TALK, 0),
        ([rospy((1, 500)), rospy((1, 510))], TALK, 10),
        # a message to three subscribers is one, messages of two publishers are two
        ([rospy((1, 0), (2, 0), (3, 0)), rospy((1, 10), (2, 9), (3, 10))], TALK, 10),
        ([rospy((1, 5), (2, 5), way=IN), rospy((1, 9), (2, 9), way=IN)], HEAR, 8),
        # a late subscriber adds nothing that others had
        ([rospy((1, 100)), rospy((1, 150), (2, 20))], TALK, 50),
        # the fastest connection leaves: what is left goes on from its own count, nothing falls back
        ([rospy((1, 100), (2, 10)), rospy((1, 150), (2, 60)), rospy((2, 70)), rospy((2, 75))], TALK, 50 + 10 + 5),
        # a connection that comes back is another
        ([rospy((1, 100)), rospy(), rospy((4, 3)), rospy((4, 8))], TALK, 8),
        # of two publishers roscpp shows the last one's connection; when that ends the first one's, which is not new
        ([roscpp(row, way=IN) for row in ((1, 5000), (1, 5010), (4, 20), (4, 50), (1, 9000), (1, 9007))], HEAR, 67),
        # rospy's counts do not wrap
        ([rospy((1, 100)), rospy((1, 40))], TALK, 40),
    ],
)
def test_how_many_messages_there_were(replies: list[Stats], flow: tuple[str, str], messages: int) -> None:
    assert after(*replies).totals[flow].messages == messages


def test_bytes_are_those_of_all_connections() -> None:
    before, now = rospy((1, 0), (2, 0)), rospy((1, 10), (2, 9), size=10)
    assert after(before, now).totals[TALK] == Count(10, 190)
    # a node that is younger than the last look counts whole
    assert after(rospy((1, 500), size=18), fresh=True).totals[TALK] == Count(500, 9000)


def test_another_process_counts_from_nothing() -> None:
    before = after(rospy((1, 100)), rospy((1, 150)))
    found = advance(before, (ME[0], 8), rospy((1, 140)), fresh=True)
    assert found.totals[TALK].messages == 50 + 140
    # the same id and a greater count, but of another process: no continuation of the old one
    found = advance(before, (ME[0], 8), rospy((1, 160)), fresh=True)
    assert found.totals[TALK].messages == 50 + 160


@pytest.mark.parametrize(
    ("before", "now", "step"),
    [
        (2**31 - 10, -(2**31) + 10, 20),  # past the sign
        (-10, 15, 25),  # past zero
        (-(2**31), -(2**31) + 5, 5),
        (100, 130, 30),
        (2000, 30, 30),  # began anew: a wrap would be 4 GB in one interval
        (-100, -90, 10),
    ],
)
def test_roscpps_counts_wrap(before: int, now: int, step: int) -> None:
    found = after(roscpp((1, before), size=1), roscpp((1, now), size=1))
    assert found.totals[TALK] == Count(step, step)


def test_who_has_no_connection_counts_nothing_and_our_own_are_not_the_nodes() -> None:
    assert after(rospy(), rospy()).totals == {TALK: Count(0, 0)}
    assert after(rospy((1, 5)), rospy(topic="/other")).totals == {("/other", OUT): Count()}
    found = advance(after(rospy()), ME, rospy((9, 7)), False, ignored=[9])
    assert found.totals[TALK] == Count(0, 0)


# ---- rates, of nodes on loopback that answer as either client library does


class Clock:
    """Time passes while somebody sleeps."""

    now = 0.0

    def monotonic(self) -> float:
        return self.now

    def sleep(self, seconds: float) -> None:
        self.now += seconds


def measured(peers: Peers, monkeypatch: pytest.MonkeyPatch, *uris: str) -> Rate | None:
    """The rate of /scan that these nodes publish. Only getBusStats is answered: whoever subscribes would be refused."""
    monkeypatch.setattr(bus_stats, "time", Clock())
    nodes = {one.key: one for one in (Node(f"/n{number}", uri, 1, True) for number, uri in enumerate(uris))}
    graph = Graph(nodes, {"/scan": Topic("/scan", publishers=tuple(nodes))})
    found = bus_stats.rates(Ros1Client("http://127.0.0.1:9/", 2.0), graph, ["/scan"], 0.5)
    assert {method for _label, method in peers.calls} <= {"getBusStats"}
    return found.get("/scan")


def node(peers: Peers, library: str, *looks: list[tuple[int, int]]) -> str:
    replies = [raw(library, links, OUT, "/scan", 1) for links in looks]
    return peers.api("node", {"getBusStats": lambda *_: replies.pop(0)})


@pytest.mark.parametrize(
    ("nodes", "messages", "few"),
    [
        ([("rospy", [(1, 1000), (2, 70)], [(1, 1010), (2, 80)])], 10, False),
        ([("roscpp", [(1, 1000), (2, 70)], [(1, 1010), (2, 80)])], 10, False),
        ([("rospy", [(1, 5)], [(1, 10)]), ("roscpp", [(1, 0)], [(1, 7)])], 12, False),
        # a latched message to somebody who came meanwhile is no rate, and so few are none
        ([("roscpp", [(1, 4)], [(1, 4), (2, 1)])], 0, True),
        ([("rospy", [(1, 4)], [(1, 6)])], 2, True),
        ([("roscpp", [(1, 2**31 - 3)], [(1, -(2**31) + 7)])], 10, False),
    ],
)
def test_rates(peers: Peers, monkeypatch: pytest.MonkeyPatch, nodes: list[Any], messages: int, few: bool) -> None:
    rate = measured(peers, monkeypatch, *(node(peers, *one) for one in nodes))
    assert rate is not None
    assert (rate.messages, rate.few, rate.known, rate.seconds, rate.hz) == (messages, few, None, 0.5, 2.0 * messages)
    assert [one.messages for one in rate.by.values()] in ([messages], [5, 7])


def test_nobody_listens_so_nothing_is_counted(peers: Peers, monkeypatch: pytest.MonkeyPatch) -> None:
    assert measured(peers, monkeypatch, node(peers, "rospy", [], [])) is None


def test_a_publisher_that_does_not_tell(peers: Peers, monkeypatch: pytest.MonkeyPatch) -> None:
    gone = f"http://127.0.0.1:{peers.dead()}/"
    rate = measured(peers, monkeypatch, gone)
    assert rate is not None
    assert rate.error == f"/n0: nothing listens at {gone}"
    both = measured(peers, monkeypatch, gone, node(peers, "rospy", [(1, 5)], [(1, 10)]))
    assert both is not None
    assert (both.error, both.messages, [one.messages for one in both.by.values()]) == ("", 5, [5, 0])
