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
    Graph,
    Handshake,
    MasterState,
    Node,
    NodeKey,
    Rate,
    ServiceProbe,
    StatusReading,
    Topic,
    around,
    everything,
    names_of,
)
from ansible_collections.rosops.fleet.plugins.module_utils._ros.replies import (
    NodeAnswer,
    build,
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
    assert graph.node("/relay").reachable
    assert graph.node("/relay").publications == ("/chatter_relay", "/rosout")
    assert graph.node("/relay").own_types == {
        "/rosout": "rosgraph_msgs/Log",
        "/chatter_relay": "std_msgs/String",
        "/chatter": "*",
    }
    assert not graph.node(DEAD).reachable
    assert graph.node(DEAD).connections is None
    assert [names_of(ends) for ends in graph.topics["/chatter_relay"].connections] == [["/relay", "/listener_relay"]]
    assert graph.topics["/chatter"].connects("/talker_b", "/relay")
    assert graph.topics["/work/goal"].connects("/asker", "/worker")


def test_edges_come_from_publishers_only() -> None:
    """The subscribers' rows say "connected" before any handshake; with no word of a publisher there is no edge."""
    answers = recorded_answers()
    for talker in ("/talker_a", "/talker_b"):
        answers[talker] = replace(answers[talker], bus=[])
    graph = build(recorded_state(), answers)
    assert any(row.topic == "/chatter" and row.connected for row in graph.node("/listener_a").connections or ())
    assert graph.topics["/chatter"].connections == ()


def test_a_node_nobody_asked_is_neither_up_nor_wrong() -> None:
    node = build(recorded_state(), {}).node("/talker_a")
    assert (node.asked, node.reachable, node.error, node.uri) == (False, False, "", "")
    assert node.services == ("/talker_a/get_loggers", "/talker_a/set_logger_level")


def test_actions_of_the_recorded_graph() -> None:
    [action] = recorded_state().graph.actions.values()
    assert (action.name, action.type) == ("/work", "actionlib/TestAction")
    assert (names_of(action.servers), names_of(action.clients)) == (["/worker"], ["/asker"])


def test_a_server_is_one_node_with_all_of_it() -> None:
    state = MasterState(
        {"/x/status": ("/a",), "/y/status": ("/a", "/b")},
        {"/x/goal": ("/b",), "/x/cancel": ("/b",), "/y/goal": ("/b",), "/y/cancel": ("/b", "/a")},
    )
    assert list(state.graph.actions) == ["/y"]
    assert (state.servers("/y"), state.servers("/x")) == (("/b",), ())


def test_two_names_at_one_address() -> None:
    assert shared_uris({"/a": "u1", "/b": "u2", "/c": "u1", "/d": "", "/e": ""}) == {"/a", "/c"}


def test_a_stale_registration_whose_port_another_node_took_is_down() -> None:
    """The dead node's address answers getPid, because an innocent node listens there now (ros_comm#2241)."""
    answers = recorded_answers()
    innocent = answers["/listener_relay"]
    answers[DEAD] = innocent
    graph = build(recorded_state(), answers)
    assert graph.node("/listener_relay").reachable
    assert not graph.node(DEAD).reachable
    assert "another node answers" in graph.node(DEAD).error


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
    a, b = (graph.node(name).key for name in ("/talker_a", "/talker_b"))
    by = {a: Rate(51.0, 50, 1.0, known=49.98765), b: Rate(error="gone")}
    by[NodeKey("/talker_c")] = Rate(0.0, 1, 1.0, latched=True, few=True)
    rates = {
        "/chatter": Rate(99.98765, 100, 1.0, by=by),
        "/rosout": Rate(error="/x: gone"),
        "/work/status": Rate(2.0, 2, 1.0, few=True),
    }
    said = {"/chatter": Handshake(b, "99", True, "text"), "/chatter_relay": Handshake(graph.node("/relay").key)}
    measured = graph.measured(rates, said, {"/trigger": 2})
    data = json.loads(json.dumps(measured.as_dict()))
    assert Graph.from_dict(data).as_dict() == data
    told = json.loads(json.dumps(measured.as_dict(definitions=True)))
    assert told["topics"]["/chatter"] == {**data["topics"]["/chatter"], "definition": "text"}
    assert Graph.from_dict(told).as_dict(definitions=True) == told
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
    assert graph.node("/gone").reachable


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
    p, silent, a, b = (graph.node(name).key for name in ("/p", "/silent", "/a", "/b"))
    assert graph.unreached("/t", p, [a, b]) == [b]
    assert graph.unreached("/t", silent, [a]) is None
    assert graph.unreached("/t", NodeKey("/nobody"), [a]) is None
    assert graph.unreached("/other", p, [a]) == [a]


# ---- which node is meant


def test_a_node_that_answers_later_takes_its_place_everywhere() -> None:
    state = MasterState(
        {"/t": ("/p", "/q"), "/x/status": ("/p",)},
        {"/t": ("/a",), "/x/goal": ("/p",), "/x/cancel": ("/p",)},
        {"/s": ("/p",)},
    )
    first = build(state, {"/q": NodeAnswer("http://q:1/", 1, bus=[[1, "/a", "o", "TCPROS", "/t", True]])})
    later = build(state, {name: NodeAnswer(f"http://{name[1:]}:1/", 2) for name in ("/p", "/a")})
    graph = first.answered(map(later.node, ("/p", "/a")))
    p, q, a = (NodeKey(f"/{name}", f"http://{name}:1/") for name in "pqa")
    assert set(graph.nodes) == {p, q, a}
    assert graph.topics["/t"] == Topic("/t", "", (p, q), (a,), ((q, a),))
    assert (graph.services["/s"].providers, graph.actions["/x"].servers) == ((p,), (p,))


def test_two_nodes_may_have_one_name() -> None:
    """In ROS 2, or where the master has not yet told the old one to go."""
    old, new = Node("/cam", "uri1"), Node("/cam", "uri2", 7, True)
    topic = Topic("/image", publishers=(old.key, new.key), connections=((old.key, NodeKey("/view")),))
    graph = Graph({node.key: node for node in (old, new)}, {"/image": topic})
    assert (graph.named("/cam"), graph.node("/cam"), graph.names) == ((new, old), new, ["/cam"])
    assert [graph.at(key).pid for key in topic.publishers] == [None, 7]
    assert topic.connects("/cam", "/view")
    assert graph.unreached("/image", new.key, [NodeKey("/view")]) is None
    assert graph.as_dict()["nodes"]["/cam"]["uri"] == "uri2"
    assert graph.as_dict()["topics"]["/image"]["publishers"] == ["/cam"]
    assert (graph.named("/view"), graph.node("/view").asked) == ((), False)


def test_who_is_listened_to() -> None:
    a, b, c = (NodeKey(name) for name in ("/a", "/b", "/c"))
    graph = Graph(
        {},
        {
            "/heard": Topic("/heard", publishers=(a, b), connections=((a, c), (b, c))),
            "/lazy": Topic("/lazy", publishers=(a,)),
        },
    )
    assert graph.heard() is graph
    assert {name: topic.publishers for name, topic in graph.heard(["/a"]).topics.items()} == {"/heard": (a,)}
    alone = graph.published_by({"/heard": [b], "/none": [a]}).topics
    assert {name: topic.publishers for name, topic in alone.items()} == {"/heard": (b,), "/lazy": (a,)}


@pytest.mark.parametrize(
    "data",
    [
        {"nodes": []},
        {"nodes": {"/n": "up"}},
        {"topics": {"/t": {"connections": [{}]}}},
        [],
        {"actions": {"/x": {"goals": {"NONE": 1}}}},
    ],
)
def test_what_is_no_graph(data: Any) -> None:
    with pytest.raises((AttributeError, KeyError, TypeError, ValueError)):
        Graph.from_dict(data)
