# SPDX-License-Identifier: GPL-3.0-or-later
"""From the recorded graph's answers to what a scrape shows."""

from __future__ import annotations

import socket
import xmlrpc.client
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import pytest
from ansible_collections.rosops.fleet.plugins.module_utils._common.errors import RefusalError, RosError
from ansible_collections.rosops.fleet.plugins.module_utils._exporter.families import families
from ansible_collections.rosops.fleet.plugins.module_utils._exporter.snapshot import (
    CALLER,
    FORGET_POLLS,
    History,
    Numbers,
    Snapshot,
    master_away,
    next_poll,
    reason,
)
from ansible_collections.rosops.fleet.plugins.module_utils._ros import bus_stats
from ansible_collections.rosops.fleet.plugins.module_utils._ros.backend import MasterState
from ansible_collections.rosops.fleet.plugins.module_utils._ros.graph import ServiceProbe, Stats, StatusReading
from ansible_collections.rosops.fleet.plugins.module_utils._ros.replies import NodeAnswer, build
from ansible_collections.rosops.fleet.plugins.module_utils._ros.roslaunch import Child
from ansible_collections.rosops.fleet.tests.unit.plugins.fake_ros import (
    DEAD,
    recorded,
    recorded_answers,
    recorded_state,
)

STATE = recorded_state()
Answers = dict[str, NodeAnswer]


def answers(**changes: Any) -> Answers:
    sent = {name: bus_stats.stats(replies["getBusStats"]) for name, replies in recorded("nodes").items()}
    found = {name: replace(answer, stats=sent.get(name)) for name, answer in recorded_answers().items()}
    return {**found, **changes}


def grown(by: int) -> Answers:
    """All counts of all connections grown."""

    def more(stats: Stats) -> Stats:
        links = {key: bus_stats.Count(n.messages + by, n.bytes + 100 * by) for key, n in stats.links.items()}
        return replace(stats, links=links)

    return {name: replace(one, stats=one.stats and more(one.stats)) for name, one in answers().items()}


HUNG = NodeAnswer("http://x:1/", error="no answer")


def poll(
    told: Answers, memory: History | None = None, wrong: Sequence[str] = (), launched: Sequence[Child] = (), **more: Any
) -> tuple[Numbers, History]:
    """Of a registered node that is not `told` of, nobody has registered anything either."""
    state = MasterState(*(
        {name: tuple(one for one in nodes if one in told) for name, nodes in part.items()}
        for part in (STATE.publishers, STATE.subscribers, STATE.services)
    ))  # fmt: skip
    return next_poll(build(state, told, **more), wrong, memory or History(), launched)


def samples(ros: Numbers, name: str, **labels: str) -> list[float]:
    found = [family for family in families(Snapshot(ros)) if family.name == name]
    return [number for family in found for had, number in family.samples if labels.items() <= had.items()]


def two_polls(by: int = 40) -> tuple[Numbers, History]:
    _ros, memory = poll(answers())
    return poll(grown(by), memory, ["refused"])


def test_the_recorded_graph() -> None:
    ros, memory = two_polls()
    assert samples(ros, "ros_master_up") == [1]
    assert samples(ros, "ros_node_up", node=DEAD) == [0]
    assert samples(ros, "ros_node_up", node="/relay") == [1]
    # three subscribers, each message once; and by roscpp, which has one of two connections in its reply
    assert samples(ros, "ros_topic_messages_total", topic="/chatter", node="/talker_a") == [40]
    assert samples(ros, "ros_topic_bytes_total", topic="/chatter", node="/talker_a") == [3 * 4000]
    assert samples(ros, "ros_topic_messages_total", topic="/chatter", node="/listener_a", direction="in") == [80]
    assert samples(ros, "ros_topic_messages_total", topic="/chatter", node="/relay", direction="in") == [40]
    assert samples(ros, "ros_topic_publishers", topic="/chatter") == [2]
    assert samples(ros, "ros_topic_subscribers", topic="/chatter") == [4]
    assert samples(ros, "ros_topic_connections", topic="/chatter", node="/talker_a", direction="out") == [3]
    assert samples(ros, "ros_topic_connections", topic="/chatter", node="/relay", direction="in") == [2]
    assert samples(ros, "ros_topic_connections", topic="/rosout_agg", node="/rosout") == [0]
    assert (memory.polls, memory.errors["refused"]) == (2, 1)
    own = ["ros_exporter_scrape_errors_total", "ros_exporter_polls_total"]  # all that is said before the first poll
    assert [one.name for one in families(Snapshot()) if one.samples] == own


def test_services_and_goals() -> None:
    probes = {"/trigger": ServiceProbe("rosrpc://x:1", "/helper")}
    statuses = {"/work": {"/worker": StatusReading(((1, 3, 3),))}}
    ros, memory = poll(answers(), probes=probes, statuses=statuses)
    assert [*ros["ros_service_up"]] == [("/trigger", "/helper")]  # and not those two that every node has
    assert samples(ros, "ros_service_up", service="/trigger", node="/helper") == [1]
    assert samples(ros, "ros_action_goals", action="/work", state="active") == [1]
    assert samples(ros, "ros_action_goals", action="/work", state="succeeded") == [2]
    assert samples(ros, "ros_action_goals", action="/work", state="pending") == [0]
    assert len(samples(ros, "ros_action_goals")) == 10
    late = ServiceProbe("rosrpc://x:1", error="no answer")
    gone, _memory = poll(answers(), memory, probes={"/trigger": late}, statuses={"/work": {"/worker": StatusReading()}})
    assert samples(gone, "ros_service_up", service="/trigger") == [0]
    assert samples(gone, "ros_action_goals") == []


def test_what_launch_files_started() -> None:
    lidar = Child("arm/lidar-3", "10.42.0.7", True, None, True, False, 5)
    gone = Child("map-1", "10.42.0.7", False, None, False, False, 1)
    before = replace(lidar, host="10.42.0.6", alive=False, spawned=9)  # of the pod that it takes the place of
    for launched in ([lidar, gone, before], [before, gone, lidar]):
        ros, _memory = poll(answers(), launched=launched)
        assert samples(ros, "ros_launch_process_up") == [1, 0]
        assert samples(ros, "ros_launch_process_up", node="/map") == [0]
        assert samples(ros, "ros_launch_process_starts_total", node="/arm/lidar") == [5]
    assert samples(poll(answers())[0], "ros_launch_process_up") == []


def test_a_master_that_is_away_has_no_nodes() -> None:
    _ros, memory = two_polls()
    ros, memory = master_away(memory, "refused")
    shown = {family.name for family in families(Snapshot(ros, memory)) if family.samples}
    assert shown == {
        "ros_master_up",
        "ros_exporter_scrape_errors_total",
        "ros_exporter_polls_total",
        "ros_exporter_poll_duration_seconds",
        "ros_exporter_last_poll_timestamp_seconds",
    }
    assert samples(ros, "ros_master_up") == [0]
    # and when it is back, counting goes on
    ros, _memory = poll(grown(90), memory)
    assert samples(ros, "ros_topic_messages_total", topic="/chatter", node="/talker_a") == [90]


def test_a_node_that_hangs_keeps_its_counts_for_later() -> None:
    _ros, memory = two_polls(40)
    hung, memory = poll(answers(**{"/talker_a": HUNG}), memory)
    assert samples(hung, "ros_node_up", node="/talker_a") == [0]
    assert samples(hung, "ros_topic_messages_total", node="/talker_a") == []
    back, _memory = poll(grown(70), memory)
    assert samples(back, "ros_topic_messages_total", topic="/chatter", node="/talker_a") == [70]


def test_a_node_that_overflows_is_up_without_counts() -> None:
    _ros, memory = two_polls()
    over = replace(answers()["/talker_a"], stats=None)
    ros, memory = poll(answers(**{"/talker_a": over}), memory, ["overflow"])
    assert samples(ros, "ros_node_up", node="/talker_a") == [1]
    assert samples(ros, "ros_topic_messages_total", node="/talker_a") == []
    assert samples(ros, "ros_topic_connections", topic="/chatter", node="/talker_a") == [3]
    assert memory.errors["overflow"] == 1


def test_a_new_node_counts_from_its_beginning_and_an_old_one_does_not() -> None:
    first = answers()
    late = first.pop("/talker_b")
    _ros, memory = poll({**first, "/talker_a": HUNG})
    ros, _memory = poll(answers(**{"/talker_b": late}), memory)
    assert samples(ros, "ros_topic_messages_total", topic="/chatter", node="/talker_b") == [267]
    assert samples(ros, "ros_topic_messages_total", topic="/chatter", node="/talker_a") == [0]


def test_our_own_look_at_a_status_is_none_of_a_nodes_connections() -> None:
    rows = [[9, CALLER, "o", "TCPROS", "/chatter", True], [1, "/listener_a", "o", "TCPROS", "/chatter", True]]
    counts = bus_stats.stats([1, "", [[["/chatter", 0, [[9, 700, 7, True], [1, 50, 5, True]]]], [], []]])
    told = replace(answers()["/talker_a"], bus=rows, stats=counts)
    ros, _memory = poll(answers(**{"/talker_a": told}), History(seen=frozenset()))
    assert samples(ros, "ros_topic_connections", node="/talker_a") == [1]
    assert samples(ros, "ros_topic_bytes_total", node="/talker_a") == [50]


def test_who_is_long_gone_is_forgotten() -> None:
    _ros, memory = two_polls()
    rest = answers()
    del rest["/talker_a"]
    for _poll in range(FORGET_POLLS):
        _ros, memory = poll(rest, memory)
    assert "/talker_a" in memory.counted
    _ros, memory = poll(rest, memory)
    assert "/talker_a" not in memory.counted
    assert "/talker_b" in memory.counted


def because(cause: Exception) -> RosError:
    """As the client says it of a master that does not answer."""
    error = RosError("the ROS master does not answer")
    error.__cause__ = cause
    return error


@pytest.mark.parametrize(
    ("error", "word"),
    [
        (TimeoutError("timed out"), "timeout"),
        (TimeoutError(), "timeout"),
        (ConnectionRefusedError(), "refused"),
        (ConnectionResetError(), "unreachable"),
        (socket.gaierror(-2, "no name"), "unreachable"),
        (OSError(113, "No route to host"), "unreachable"),
        (xmlrpc.client.Fault(1, "<class 'OverflowError'>:int exceeds XML-RPC limits"), "overflow"),
        (xmlrpc.client.Fault(-1, "unknown method name"), "fault"),
        (RefusalError("unknown node"), "fault"),
        (RosError("refused: no such service"), "fault"),
        (RosError("the reply to getPid is not plain XML-RPC"), "malformed"),
        (KeyError("x"), "malformed"),
        (because(TimeoutError()), "timeout"),
    ],
)
def test_reasons(error: BaseException, word: str) -> None:
    assert reason(error) == word
