# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Rates by the publishers' own counts, against peers on loopback that answer as either client library does."""

from __future__ import annotations

from typing import Any

import pytest
from ansible_collections.rosops.fleet.plugins.module_utils._ros.client import Ros1Client
from ansible_collections.rosops.fleet.plugins.module_utils._ros.counters import sent
from ansible_collections.rosops.fleet.plugins.module_utils._ros.graph import Graph, Node, Rate, Topic
from ansible_collections.rosops.fleet.tests.unit.plugins.fake_ros import Peers

WINDOW = 0.5


def rospy(topic: str, *links: tuple[int, int]) -> Any:
    """(connection, messages) of one publisher."""
    return [1, "", [[[topic, 0, [[number, 8 * count, count, True] for number, count in links]]], [], []]]


def roscpp(topic: str, *links: tuple[int, int]) -> Any:
    return [[[topic, [[number, 12, 8, count, 0] for number, count in links]]], [], []]


class Counting:
    """A node whose counts go on from reply to reply."""

    def __init__(self, peers: Peers, *replies: Any) -> None:
        self.replies = list(replies)
        self.uri = peers.api("node", {"getBusStats": lambda *_: self.replies.pop(0)})


def measured(peers: Peers, **uris: str) -> Rate | None:
    """The rate of /scan that these nodes publish. Only getBusStats is answered: whoever subscribes would be refused."""
    nodes = {node.key: node for node in (Node(f"/{name}", uri, 1, True) for name, uri in uris.items())}
    graph = Graph(nodes, {"/scan": Topic("/scan", publishers=tuple(nodes))})
    ros = Ros1Client("http://127.0.0.1:9/", 2.0)
    found = sent(ros, graph, ["/scan"], WINDOW)
    assert {method for _label, method in peers.calls} <= {"getBusStats"}
    return found.get("/scan")


@pytest.mark.parametrize("library", [rospy, roscpp])
def test_a_publisher_with_two_subscribers(peers: Peers, library: Any) -> None:
    node = Counting(peers, library("/scan", (1, 1000), (2, 70)), library("/scan", (1, 1010), (2, 80)))
    rate = measured(peers, lidar=node.uri)
    assert rate is not None
    assert (rate.messages, rate.few, rate.known) == (10, False, None)
    assert rate.seconds >= WINDOW
    assert rate.hz == pytest.approx(10 / rate.seconds)
    assert {(key.name, one.messages, one.hz) for key, one in rate.by.items()} == {("/lidar", 10, rate.hz)}


def test_two_publishers_are_summed(peers: Peers) -> None:
    one = Counting(peers, rospy("/scan", (1, 5)), rospy("/scan", (1, 10)))
    two = Counting(peers, roscpp("/scan", (1, 0)), roscpp("/scan", (1, 7)))
    rate = measured(peers, one=one.uri, two=two.uri)
    assert rate is not None
    assert rate.messages == 12


def test_a_latched_message_to_somebody_who_came_meanwhile_is_no_rate(peers: Peers) -> None:
    node = Counting(peers, roscpp("/scan", (1, 4)), roscpp("/scan", (1, 4), (2, 1)))
    rate = measured(peers, slam=node.uri)
    assert rate is not None
    assert (rate.messages, rate.few) == (0, True)


def test_too_few_messages_are_no_rate(peers: Peers) -> None:
    node = Counting(peers, rospy("/scan", (1, 4)), rospy("/scan", (1, 6)))
    rate = measured(peers, slam=node.uri)
    assert rate is not None
    assert (rate.messages, rate.few) == (2, True)


def test_nobody_listens_so_nothing_is_counted(peers: Peers) -> None:
    node = Counting(peers, rospy("/scan"), rospy("/scan"))
    assert measured(peers, camera=node.uri) is None


def test_a_count_that_wrapped(peers: Peers) -> None:
    node = Counting(peers, roscpp("/scan", (1, 2**31 - 3)), roscpp("/scan", (1, -(2**31) + 7)))
    rate = measured(peers, lidar=node.uri)
    assert rate is not None
    assert rate.messages == 10


def test_a_publisher_that_does_not_tell(peers: Peers) -> None:
    gone = f"http://127.0.0.1:{peers.dead()}/"
    rate = measured(peers, gone=gone)
    assert rate is not None
    assert rate.error == f"/gone: nothing listens at {gone}"
    node = Counting(peers, rospy("/scan", (1, 5)), rospy("/scan", (1, 10)))
    both = measured(peers, gone=gone, lidar=node.uri)
    assert both is not None
    assert (both.error, both.messages) == ("", 5)
