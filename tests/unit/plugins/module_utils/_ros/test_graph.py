# SPDX-License-Identifier: GPL-3.0-or-later
"""The graph, what of it is asked for, and its JSON."""

from __future__ import annotations

import json
from typing import Any

import pytest
from ansible_collections.rosops.fleet.plugins.module_utils._ros.graph import (
    Graph,
    Handshake,
    Node,
    NodeKey,
    Rate,
    ServiceProbe,
    StatusReading,
    Topic,
)
from ansible_collections.rosops.fleet.plugins.module_utils._ros.graph_json import graph_data, graph_from
from ansible_collections.rosops.fleet.plugins.module_utils._ros.replies import build
from ansible_collections.rosops.fleet.tests.unit.plugins.fake_ros import DEAD, recorded_answers, recorded_state

REVISION, STATUS = "/cam_1a2b3c4d", StatusReading(((3,), (3, 1)))
DEAD_NODE = {
    "uri": "http://127.0.0.1:9/", "pid": None, "reachable": False, "error": "nothing listens at http://127.0.0.1:9/",
    "refused": True, "publications": ["/rosout"], "subscriptions": ["/chatter"],
    "services": [f"{DEAD}/get_loggers", f"{DEAD}/set_logger_level"],
}  # fmt: skip
RELAYED = {
    "type": "std_msgs/String", "md5sum": None, "publishers": ["/relay"], "subscribers": ["/listener_relay"],
    "connections": [{"publisher": "/relay", "subscriber": "/listener_relay"}], "rate": None, "rates": {},
    "unsteady": {}, "latched": [], "rate_error": "",
}  # fmt: skip
WORK = {
    "type": "actionlib/TestAction", "servers": ["/worker"], "clients": ["/asker"], "up": True, "busy": True,
    "goals": {"ACTIVE": 1, "SUCCEEDED": 1},
}  # fmt: skip


def test_the_graph_as_json() -> None:
    statuses = {"/work": {"/worker": STATUS}}
    probes = {
        "/trigger": ServiceProbe("rosrpc://h:1", "/helper", "std_srvs/Trigger", md5sum="93"),
        "/relay/get_loggers": ServiceProbe("rosrpc://h:2", error="nothing listens at rosrpc://h:2"),
    }
    graph = build(recorded_state(), recorded_answers(), probes, statuses)
    a, b = (graph.node(name).key for name in ("/talker_a", "/talker_b"))
    by = {a: Rate(51.0, 50, 1.0, known=49.98765), b: Rate(error="gone")}
    by[NodeKey("/talker_c")] = Rate(1.0, 1, 1.0, latched=True, few=True)
    by[NodeKey("/talker_d")] = Rate(20.0, 20, 1.0)
    rates = {
        "/chatter": Rate(99.98765, 100, 1.0, by=by),
        "/rosout": Rate(error="/x: gone"),
        "/work/status": Rate(2.0, 2, 1.0, few=True),
    }
    said = {"/chatter": Handshake(b, "99", True, "text"), "/chatter_relay": Handshake(graph.node("/relay").key)}
    measured = graph.measured(rates, said)
    data = json.loads(json.dumps(graph_data(measured)))
    assert graph_data(graph_from(data)) == data
    told = json.loads(json.dumps(graph_data(measured, definitions=True)))
    assert told["topics"]["/chatter"] == {**data["topics"]["/chatter"], "definition": "text"}
    assert graph_data(graph_from(told), definitions=True) == told
    topics, services = data["topics"], data["services"]
    assert (data["nodes"][DEAD], topics["/chatter_relay"], data["actions"]["/work"]) == (DEAD_NODE, RELAYED, WORK)
    chatter, few = topics["/chatter"], topics["/work/status"]
    assert (chatter["rate"], chatter["rates"], chatter["md5sum"]) == (99.988, {"/talker_a": 49.988}, "99")
    assert chatter["unsteady"] == {"/talker_d": 20.0}
    assert chatter["latched"] == ["/talker_b", "/talker_c"]
    assert (few["rate"], few["rate_error"]) == (None, "2 messages in 1.0 s")  # which is not 2 Hz
    assert (topics["/rosout"]["rate"], topics["/rosout"]["rate_error"]) == (None, "/x: gone")
    asked = services["/trigger"]
    assert (asked["md5sum"], asked["up"]) == ("93", True)
    assert services["/relay/get_loggers"]["up"] is False
    assert services["/rosout/get_loggers"]["up"] is False


def test_the_graph_by_the_names_of_revisions() -> None:
    """Where it has two pods of one these are two nodes of one name."""
    plain = json.dumps(graph_data(build(recorded_state(), recorded_answers(), {}, {"/work": {"/worker": STATUS}})))
    for name, version in (("/talker_a", "1a2b3c4d"), ("/worker", "99999999")):
        plain = plain.replace(f'"{name}', f'"{name}_{version}')
    of_pods = plain.replace("_1a2b3c4d", "_1a2b3c4d_79d9c6f8b5").replace("_99999999", "_99999999_4")
    assert graph_data(graph_from(json.loads(of_pods)).by_revision()) == json.loads(plain)
    one, two = (Node(f"/cam_1a2b3c4d_{number}", f"http://{number}/", 7) for number in (4, 5))
    topic = Topic("/image", publishers=(one.key, two.key), rates={two.key: 5.0})
    found = Graph({node.key: node for node in (one, two)}, {"/image": topic}).by_revision()
    assert [(node.name, node.uri) for node in found.named("/cam_1a2b3c4d")] == [
        (REVISION, one.uri),
        (REVISION, two.uri),
    ]
    assert found.topics["/image"].rates == {NodeKey(REVISION, two.uri): 5.0}


def test_two_nodes_may_have_one_name() -> None:
    """In ROS 2, or where the master has not yet told the old one to go."""
    old, new = Node("/cam", "uri1"), Node("/cam", "uri2", 7, True)
    topic = Topic("/image", publishers=(old.key, new.key), connections=((old.key, NodeKey("/view")),))
    graph = Graph({node.key: node for node in (old, new)}, {"/image": topic})
    assert (graph.named("/cam"), graph.node("/cam"), graph.names) == ((new, old), new, ["/cam"])
    assert [graph.at(key).pid for key in topic.publishers] == [None, 7]
    assert topic.connects("/cam", "/view")
    assert graph.unreached("/image", new.key, [NodeKey("/view")]) is None
    assert graph_data(graph)["nodes"]["/cam"]["uri"] == "uri2"
    assert graph_data(graph)["topics"]["/image"]["publishers"] == ["/cam"]
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
    pod = NodeKey("/a_1a2b3c4d_4")
    of_pod = Graph({}, {"/heard": Topic("/heard", publishers=(pod,), connections=((pod, c),))})
    assert of_pod.heard(["/a_1a2b3c4d"]).topics == of_pod.topics
    alone = graph.published_by({"/heard": ["/b"], "/none": ["/a"]}).topics
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
        graph_from(data)
