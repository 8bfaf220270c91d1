# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Counts out of getBusStats: what rospy and roscpp really answer, wraps, resets, copies to several subscribers."""

from __future__ import annotations

from typing import Any

import pytest
from ansible_collections.rosops.fleet.plugins.module_utils._common.errors import RosError
from ansible_collections.rosops.fleet.plugins.module_utils._ros.bus_stats import (
    IN,
    OUT,
    Count,
    Counted,
    Stats,
    advance,
    is_overflow,
    stats,
)
from ansible_collections.rosops.fleet.tests.unit.plugins.fake_ros import recorded

NODES = recorded("nodes")
ME = ("http://127.0.0.1:1/", 7)
TALK = ("/chatter", OUT)
HEAR = ("/chatter", IN)


def rospy(*rows: list[Any], topic: str = "/chatter") -> Stats:
    return stats([1, "", [[[topic, 0, list(rows)]], [], []]])


def roscpp(*rows: list[Any]) -> Stats:
    return stats([[["/chatter", list(rows)]], []])


def after(*replies: Stats, fresh: bool = False) -> Counted:
    counted: Counted | None = None
    for reply in replies:
        counted = advance(counted, ME, reply, fresh)
    assert counted is not None
    return counted


# ---- the recorded replies


def test_a_rospy_publisher() -> None:
    found = stats(NODES["/talker_a"]["getBusStats"])
    assert not found.wraps
    assert found.links[("/chatter", OUT, 1)] == Count(34, 602)
    assert {link for link in found.links if link[0] == "/chatter"} == {("/chatter", OUT, i) for i in (1, 3, 5)}


def test_a_rospy_subscriber() -> None:
    found = stats(NODES["/listener_a"]["getBusStats"])
    assert found.links[("/chatter", IN, 2)] == Count(7, 256)
    assert ("/rosout", OUT) in found.flows  # without a connection


def test_a_roscpp_node() -> None:
    found = stats(NODES["/relay"]["getBusStats"])
    assert found.wraps
    assert found.links == {
        ("/rosout", OUT, 0): Count(1, 147),
        ("/chatter_relay", OUT, 2): Count(36, 468),
        ("/chatter", IN, 3): Count(15, 135),
    }


def test_a_roscpp_topic_without_subscribers() -> None:
    assert ("/rosout_agg", OUT) in stats(NODES["/rosout"]["getBusStats"]).flows


@pytest.mark.parametrize("reply", [None, 7, [], [1, ""], [1, "", 7], [0, "no", []], "x"])
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


def test_counting_begins_at_the_first_look() -> None:
    """A restarted exporter must not count again."""
    assert after(rospy([1, 9000, 500, True])).totals[TALK] == Count(0, 0)
    assert after(rospy([1, 9000, 500, True]), rospy([1, 9100, 510, True])).totals[TALK] == Count(10, 100)


def test_a_node_that_is_younger_than_the_last_look_counts_whole() -> None:
    assert after(rospy([1, 9000, 500, True]), fresh=True).totals[TALK] == Count(500, 9000)


def test_a_message_to_three_subscribers_is_one() -> None:
    first = rospy([1, 0, 0, True], [2, 0, 0, True], [3, 0, 0, True])
    last = rospy([1, 100, 10, True], [2, 90, 9, True], [3, 100, 10, True])
    assert after(first, last).totals[TALK] == Count(10, 290)


def test_messages_of_two_publishers_are_two() -> None:
    def reply(messages: int) -> Stats:
        return stats([1, "", [[], [["/chatter", [[i, messages * 10, messages, -1, True] for i in (1, 2)]]], []]])

    assert after(reply(5), reply(9)).totals[HEAR] == Count(8, 80)


def test_a_late_subscriber_adds_nothing_that_others_had() -> None:
    found = after(rospy([1, 0, 100, True]), rospy([1, 0, 150, True], [2, 0, 20, True]))
    assert found.totals[TALK].messages == 50


def test_the_fastest_connection_leaves() -> None:
    """What is left goes on from its own count: nothing falls back."""
    found = after(
        rospy([1, 0, 100, True], [2, 0, 10, True]),
        rospy([1, 0, 150, True], [2, 0, 60, True]),
        rospy([2, 0, 70, True]),
        rospy([2, 0, 75, True]),
    )
    assert found.totals[TALK].messages == 50 + 10 + 5


def test_a_connection_that_comes_back_is_another() -> None:
    found = after(rospy([1, 0, 100, True]), rospy(), rospy([4, 0, 3, True]), rospy([4, 0, 8, True]))
    assert found.totals[TALK].messages == 8


def test_roscpp_names_now_this_connection_and_now_that() -> None:
    """Of two publishers it shows the last one's connection; when that ends, the first one's, which is not new."""

    def reply(connection: int, messages: int) -> Stats:
        return stats([[], [["/chatter", [[connection, messages * 9, messages, 0, 0]]]]])

    found = after(reply(1, 5000), reply(1, 5010), reply(4, 20), reply(4, 50), reply(1, 9000), reply(1, 9007))
    assert found.totals[HEAR].messages == 10 + 20 + 30 + 0 + 7


def test_another_process_counts_from_nothing() -> None:
    before = after(rospy([1, 0, 100, True]), rospy([1, 0, 150, True]))
    found = advance(before, (ME[0], 8), rospy([1, 0, 140, True]), fresh=True)
    assert found.totals[TALK].messages == 50 + 140
    # the same id and a greater count, but of another process: no continuation of the old one
    found = advance(before, (ME[0], 8), rospy([1, 0, 160, True]), fresh=True)
    assert found.totals[TALK].messages == 50 + 160


def test_rospys_counts_do_not_wrap() -> None:
    assert after(rospy([1, 0, 100, True]), rospy([1, 0, 40, True])).totals[TALK].messages == 40


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
    found = after(roscpp([1, before, 0, before, 0]), roscpp([1, now, 0, now, 0]))
    assert found.totals[TALK] == Count(step, step)


def test_a_wrap_twice() -> None:
    replies = [roscpp([1, value, 0, 0, 0]) for value in (2**31 - 1, -(2**31) + 99, -1, 99)]
    assert after(*replies).totals[TALK].bytes == 100 + (2**31 - 100) + 100


def test_topics_without_subscribers_count_nothing() -> None:
    assert after(rospy(), rospy()).totals == {TALK: Count(0, 0)}


def test_a_topic_that_is_gone_is_gone() -> None:
    assert after(rospy([1, 0, 5, True]), rospy(topic="/other")).totals == {("/other", OUT): Count()}


def test_our_own_connections_are_not_the_nodes() -> None:
    found = advance(after(rospy()), ME, rospy([9, 700, 7, True]), False, ignored=[9])
    assert found.totals[TALK] == Count(0, 0)


def test_overflow() -> None:
    assert is_overflow("<class 'OverflowError'>:int exceeds XML-RPC limits")
    assert not is_overflow("<class 'Exception'>:method \"getBusStats\" is not supported")
