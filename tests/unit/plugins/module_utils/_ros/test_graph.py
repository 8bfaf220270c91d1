# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
from __future__ import annotations

import json
from dataclasses import replace
from typing import Any

import pytest
from ansible_collections.rosops.fleet.plugins.module_utils._common.errors import RefusalError, RosError
from ansible_collections.rosops.fleet.plugins.module_utils._ros.graph import (
    Connection,
    Extras,
    Handshake,
    MasterState,
    Rate,
    ServiceProbe,
    StatusReading,
    action_names,
    action_of,
    around,
    everything,
)
from ansible_collections.rosops.fleet.plugins.module_utils._ros.replies import (
    NodeAnswer,
    build,
    bus_stats,
    connections,
    master_state,
    shared_uris,
    topic_types,
    unwrap,
)
from ansible_collections.rosops.fleet.tests.unit.plugins.fake_ros import (
    DEAD,
    recorded,
    recorded_answers,
    recorded_state,
)

NODES = recorded("nodes")
MASTER = recorded("master")


# ---- replies


def test_unwrap_takes_the_value_of_every_recorded_success() -> None:
    assert unwrap(MASTER["getPid"]) > 0
    assert unwrap(NODES["/relay"]["getPid"]) > 0
    assert unwrap(NODES["/talker_a"]["lookupNode"]).startswith("http://")


@pytest.mark.parametrize(
    ("reply", "message"),
    [
        (MASTER["lookupNode unknown"], "unknown node"),
        (MASTER["lookupService unknown"], "no provider"),
        (NODES["/talker_a"]["requestTopic unknown"], "Not a publisher"),
        ([0, "", 7], "code 0"),
        ([True, "", 7], "not \\[code"),
        ([1, "short"], "not \\[code"),
        ("text", "not \\[code"),
        (None, "not \\[code"),
        (NODES["/relay"]["getBusStats"], "not \\[code"),  # roscpp's bare list
    ],
)
def test_unwrap_refuses_what_is_no_success(reply: Any, message: str) -> None:
    with pytest.raises(RosError, match=message):
        unwrap(reply)


def test_bus_stats_of_rospy_and_of_roscpp() -> None:
    publishers, subscribers = bus_stats(NODES["/talker_a"]["getBusStats"])
    assert [row[0] for row in publishers] == ["/rosout", "/chatter"]
    assert subscribers == []
    publishers, subscribers = bus_stats(NODES["/relay"]["getBusStats"])
    assert [row[0] for row in publishers] == ["/rosout", "/chatter_relay"]
    assert [row[0] for row in subscribers] == ["/chatter"]


@pytest.mark.parametrize("reply", [[0, "no", []], [1, "", []], [1, "", 5], [], "x"])
def test_bus_stats_that_make_no_sense(reply: Any) -> None:
    with pytest.raises(RosError):
        bus_stats(reply)


def test_bus_info_of_rospy() -> None:
    rows = connections(NODES["/talker_a"]["getBusInfo"][2])
    assert Connection("/chatter", "/relay", "o", "TCPROS", True) in rows
    assert {row.peer for row in rows if row.topic == "/chatter"} == {"/listener_a", "/listener_b", "/relay"}
    incoming = connections(NODES["/listener_a"]["getBusInfo"][2])
    assert {row.peer for row in incoming if row.direction == "i"} == {
        NODES["/talker_a"]["lookupNode"][2],
        NODES["/talker_b"]["lookupNode"][2],
    }


def test_an_edge_counts_whatever_carries_it() -> None:
    """roscpp connects by UDPROS where a subscriber asks for it (`TransportHints().udp()`)."""
    (edge,) = connections([[1, "/viewer", "o", "UDPROS", "/image", True]])
    assert (edge.topic, edge.peer, edge.direction, edge.connected) == ("/image", "/viewer", "o", True)


def test_bus_info_of_roscpp() -> None:
    rows = connections(NODES["/relay"]["getBusInfo"][2])
    assert Connection("/chatter_relay", "/listener_relay", "o", "TCPROS", True) in rows
    assert len([row for row in rows if row.topic == "/chatter" and row.direction == "i"]) == 2


@pytest.mark.parametrize(
    ("raw", "expected"),
    [
        (None, 0),
        ("text", 0),
        ([None, 5, "abcdef", [], [1, "/a", "o"]], 0),
        ([[1, 7, "o", "TCPROS", "/t", 1]], 0),
        ([[1, "/a", "o", "TCPROS", "/t"]], 1),
        ([[1, "/a", "o", "TCPROS", "/t", 0, "more", "and more"]], 1),
    ],
)
def test_bus_info_leaves_out_rows_that_make_no_sense(raw: Any, expected: int) -> None:
    assert len(connections(raw)) == expected


def test_the_far_end_of_a_connection_is_kept() -> None:
    rows = connections(recorded("nodes")["/relay"]["getBusInfo"][2])
    assert rows[0].info == "TCPROS connection on port 40307 to [127.0.0.1:53886 on socket 11]"
    assert connections([[1, "/b", "o", "TCPROS", "/t"]])[0].info == ""
    assert connections([[1, "/b", "o", "TCPROS", "/t", 1, 5]])[0].info == ""


def test_a_row_says_itself_whether_it_is_connected() -> None:
    rows = connections([[1, "/a", "o", "TCP", "/t", 0], [2, "/b", "o", "TCP", "/t", 1], [3, "/c", "o", "TCP", "/t"]])
    assert [row.connected for row in rows] == [False, True, True]


def test_the_masters_state() -> None:
    state = recorded_state()
    assert state.publishers["/chatter"] == ("/talker_a", "/talker_b")
    assert state.subscribers["/chatter"] == ("/listener_a", "/listener_b", DEAD, "/relay")
    assert state.services["/trigger"] == ("/helper",)
    assert state.types["/chatter"] == "std_msgs/String"
    assert {*NODES, DEAD} == set(state.nodes())


@pytest.mark.parametrize("raw", [None, [], [[], []], "state", 7])
def test_a_state_that_is_none(raw: Any) -> None:
    with pytest.raises(RosError):
        master_state(raw)


def test_registrations_that_make_no_sense_are_left_out() -> None:
    publishers = [["/t", ["/a", 5, None]], ["/u", "x"], [7, ["/a"]], "junk"]
    state = master_state([publishers, [], "junk"], [["/t", "a/B"], [1, 2]])
    assert state == MasterState({"/t": ("/a",)}, {}, {}, {"/t": "a/B"})
    assert topic_types("junk") == {}


# ---- graph


def test_the_recorded_graph() -> None:
    graph = build(recorded_state(), recorded_answers())
    assert graph.nodes["/relay"].reachable
    assert graph.nodes["/relay"].publications == ("/chatter_relay", "/rosout")
    assert graph.nodes["/relay"].own_types == {
        "/rosout": "rosgraph_msgs/Log",
        "/chatter_relay": "std_msgs/String",
        "/chatter": "*",
    }
    assert not graph.nodes[DEAD].reachable
    assert graph.nodes[DEAD].connections is None
    assert graph.topics["/chatter_relay"].connections == (("/relay", "/listener_relay"),)
    assert ("/talker_b", "/relay") in graph.topics["/chatter"].connections
    assert graph.topics["/work/goal"].connections == (("/asker", "/worker"),)


def test_edges_come_from_publishers_only() -> None:
    """The subscribers' rows say "connected" before any handshake; with no word of a publisher there is no edge."""
    answers = recorded_answers()
    for talker in ("/talker_a", "/talker_b"):
        answers[talker] = replace(answers[talker], bus=[])
    graph = build(recorded_state(), answers)
    assert any(row.topic == "/chatter" and row.connected for row in graph.nodes["/listener_a"].connections or ())
    assert graph.topics["/chatter"].connections == ()


def test_a_node_nobody_asked_is_neither_up_nor_wrong() -> None:
    node = build(recorded_state(), {}).nodes["/talker_a"]
    assert (node.asked, node.reachable, node.error, node.uri) == (False, False, "", "")
    assert node.services == ("/talker_a/get_loggers", "/talker_a/set_logger_level")


def test_actions_of_the_recorded_graph() -> None:
    state = recorded_state()
    assert action_names(state) == ["/work"]
    action = action_of(state, "/work")
    assert (action.servers, action.clients, action.type) == (("/worker",), ("/asker",), "actionlib/TestAction")


def test_a_server_is_one_node_with_all_of_it() -> None:
    state = MasterState(
        {"/x/status": ("/a",), "/y/status": ("/a", "/b")},
        {"/x/goal": ("/b",), "/x/cancel": ("/b",), "/y/goal": ("/b",), "/y/cancel": ("/b", "/a")},
    )
    assert action_names(state) == ["/y"]
    assert action_of(state, "/y").servers == ("/b",)
    assert action_of(state, "/x").servers == ()


def test_two_names_at_one_address() -> None:
    assert shared_uris({"/a": "u1", "/b": "u2", "/c": "u1", "/d": "", "/e": ""}) == {"/a", "/c"}


def test_a_stale_registration_whose_port_another_node_took_is_down() -> None:
    """The dead node's address answers getPid, because an innocent node listens there now (ros_comm#2241)."""
    answers = recorded_answers()
    innocent = answers["/listener_relay"]
    answers[DEAD] = innocent
    graph = build(recorded_state(), answers)
    assert graph.nodes["/listener_relay"].reachable
    assert not graph.nodes[DEAD].reachable
    assert "another node answers" in graph.nodes[DEAD].error


def test_everything_asks_every_node_service_and_action() -> None:
    wanted = everything(recorded_state())
    assert set(wanted.nodes) == {*NODES, DEAD}
    assert set(wanted.nodes.values()) == {frozenset({"bus"})}
    assert "/trigger" in wanted.services
    assert wanted.actions == ("/work",)


def test_a_part_of_the_graph_asks_those_around_its_nodes() -> None:
    state = MasterState(
        {"/in": ("/far", "/b"), "/out": ("/a",), "/else": ("/c",), "/work/status": ("/w",)},
        {"/out": ("/b", "/d"), "/in": ("/a",), "/else": ("/e",), "/work/goal": ("/w",), "/work/cancel": ("/w",)},
        {"/a/s": ("/a",), "/b/s": ("/b",)},
    )
    wanted = around(state, ["/a", "/a", "/not_registered"])
    bus = frozenset({"bus"})
    assert wanted.nodes == {"/a": bus, "/far": bus, "/b": bus, "/d": frozenset()}
    assert (wanted.services, wanted.actions) == (("/a/s",), ("/work",))


def test_the_graph_as_json() -> None:
    statuses = {"/work": {"/worker": StatusReading(((3,), (3, 1)))}}
    probes = {
        "/trigger": ServiceProbe("rosrpc://h:1", "/helper", "std_srvs/Trigger", md5sum="93"),
        "/relay/get_loggers": ServiceProbe("rosrpc://h:2", error="nothing listens at rosrpc://h:2"),
    }
    graph = build(recorded_state(), recorded_answers(), probes, statuses)
    by = {"/talker_a": Rate(51.0, 50, 1.0, known=49.98765), "/talker_b": Rate(error="gone")}
    by["/talker_c"] = Rate(0.0, 1, 1.0, latched=True, few=True)
    rates = {
        "/chatter": Rate(99.98765, 100, 1.0, by=by),
        "/rosout": Rate(error="/x: gone"),
        "/work/status": Rate(2.0, 2, 1.0, few=True),
    }
    handshakes = {"/chatter": Handshake("/talker_b", "99", latching=True), "/chatter_relay": Handshake("/relay")}
    data = json.loads(json.dumps(graph.as_dict(Extras(rates, handshakes, {"/trigger": 2}))))
    assert data["nodes"][DEAD] == {
        "uri": "http://127.0.0.1:9/",
        "pid": None,
        "reachable": False,
        "error": "nothing listens at http://127.0.0.1:9/",
        "refused": True,
        "publications": ["/rosout"],
        "subscriptions": ["/chatter"],
        "services": [f"{DEAD}/get_loggers", f"{DEAD}/set_logger_level"],
    }
    assert data["topics"]["/chatter_relay"] == {
        "type": "std_msgs/String",
        "md5sum": None,
        "publishers": ["/relay"],
        "subscribers": ["/listener_relay"],
        "connections": [{"publisher": "/relay", "subscriber": "/listener_relay"}],
        "rate": None,
        "rates": {},
        "latched": [],
        "rate_error": "",
    }
    assert data["topics"]["/chatter"]["rates"] == {"/talker_a": 49.988}
    assert data["topics"]["/chatter"]["latched"] == ["/talker_b", "/talker_c"]
    few = data["topics"]["/work/status"]
    assert (few["rate"], few["rate_error"]) == (None, "2 messages in 1.0 s")  # which is not 2 Hz
    assert data["topics"]["/chatter"]["md5sum"] == "99"
    assert (data["services"]["/trigger"]["md5sum"], data["services"]["/trigger"]["connections"]) == ("93", 2)
    assert data["services"]["/rosout/get_loggers"]["connections"] is None
    assert data["topics"]["/chatter"]["rate"] == 99.988
    assert (data["topics"]["/rosout"]["rate"], data["topics"]["/rosout"]["rate_error"]) == (None, "/x: gone")
    assert data["services"]["/trigger"]["up"] is True
    assert data["services"]["/relay/get_loggers"]["up"] is False
    assert data["services"]["/rosout/get_loggers"]["up"] is False  # not asked
    assert data["actions"]["/work"] == {
        "type": "actionlib/TestAction",
        "servers": ["/worker"],
        "clients": ["/asker"],
        "up": True,
        "busy": True,
        "goals": {"ACTIVE": 1, "SUCCEEDED": 1},
    }


def test_an_answer_of_a_node_the_master_no_longer_lists_still_stands_in_the_graph() -> None:
    graph = build(MasterState(), {"/gone": NodeAnswer("http://h:1/", 7)})
    assert graph.nodes["/gone"].reachable


def test_a_refusal_is_not_nonsense() -> None:
    assert unwrap([1, "", 7]) == 7
    with pytest.raises(RefusalError, match="unknown node"):
        unwrap([-1, "unknown node", ""])
    for nonsense in (None, [], ["x", "", 1], 7):
        with pytest.raises(RosError) as error:
            unwrap(nonsense)
        assert not isinstance(error.value, RefusalError)


def test_connected_is_what_the_publisher_says() -> None:
    state = MasterState({"/t": ("/p", "/silent")}, {"/t": ("/a", "/b")})
    answers = {
        "/p": NodeAnswer("http://p:1/", 1, bus=[[1, "/a", "o", "TCPROS", "/t", True]]),
        "/silent": NodeAnswer("http://s:1/", 2),
        # a subscriber's own word is worth nothing
        "/b": NodeAnswer("http://b:1/", 3, bus=[[1, "http://p:1/", "i", "TCPROS", "/t", True]]),
    }
    graph = build(state, answers)
    assert graph.unreached("/t", "/p") == ["/b"]
    assert graph.unreached("/t", "/p", ["/a"]) == []
    assert graph.unreached("/t", "/silent") is None
    assert graph.unreached("/t", "/nobody") is None
    assert graph.unreached("/other", "/p", ["/x"]) == ["/x"]
