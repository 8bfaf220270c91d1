# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
from __future__ import annotations

import json
from typing import Any

import pytest
from ansible_collections.rosops.fleet.plugins.module_utils._ros.conditions import EdgeCondition, conditions_from
from ansible_collections.rosops.fleet.plugins.module_utils._ros.contract import (
    Contract,
    Intended,
    is_tool,
    renamed,
)
from ansible_collections.rosops.fleet.plugins.module_utils._ros.contract import conditions as options
from ansible_collections.rosops.fleet.plugins.module_utils._ros.contract import record as recorded
from ansible_collections.rosops.fleet.plugins.module_utils._ros.graph import Graph, Rate, ServiceProbe, StatusReading
from ansible_collections.rosops.fleet.plugins.module_utils._ros.replies import build
from ansible_collections.rosops.fleet.tests.unit.plugins.fake_ros import recorded_answers, recorded_state

OLD, NEW = "/temperature_1a2b3c4d", "/temperature_5e6f7a8b"
STATS_OLD, STATS_NEW = "/stats_11111111", "/stats_22222222"
COOK = ("/cook/status", "/cook/feedback")
TOOL = "/rostopic_4711_1700000000000"


def record(of: dict[str, Any], *args: Any, **more: Any) -> dict[str, Any]:
    """The contract as it lies in the cluster, where every version of the collection reads these very keys."""
    made = recorded(Graph.from_dict(of), *args, **more)
    data: dict[str, Any] = json.loads(json.dumps(made.as_dict()))
    assert Contract.from_dict(data) == made
    return data


def conditions(contract: dict[str, Any], **more: Any) -> dict[str, Any]:
    return options(Contract.from_dict(contract), **more)


def node(reachable: bool = True) -> dict[str, Any]:
    return {"uri": "http://a:1/", "pid": 1 if reachable else None, "reachable": reachable}


def topic(
    publishers: list[str], subscribers: list[str], missing: tuple[str, ...] = (), rates: Any = None, kind: str = "a/B"
) -> dict[str, Any]:
    """A topic with every subscriber connected but the missing ones."""
    ends = [{"publisher": p, "subscriber": s} for p in publishers for s in subscribers if s not in missing]
    return {
        "type": kind,
        "md5sum": "5" * 32,
        "publishers": publishers,
        "subscribers": subscribers,
        "connections": ends,
        "rates": rates or {},
    }


def service(provider: str, up: bool = True) -> dict[str, Any]:
    return {"providers": [provider], "provider": provider if up else "", "type": "a/S", "md5sum": "6" * 32, "up": up}


def graph() -> dict[str, Any]:
    """A publisher and its statistics, both ours in some tests, with a foreign listener, a dead one and a tool."""
    everybody = [OLD, STATS_OLD, "/display", "/rosout", TOOL]
    return {
        "nodes": {**{name: node() for name in everybody}, "/dead": node(reachable=False)},
        "topics": {
            "/temperature": topic([OLD], [STATS_OLD, "/display", "/dead", TOOL], ("/dead",), {OLD: 499.8}),
            "/rosout": topic([OLD, STATS_OLD], ["/rosout"], rates={OLD: 3.0}),
            f"{OLD}/debug": topic([OLD], [STATS_OLD, "/display"], rates={OLD: 20.0}),
            "/config": topic(["/display"], [OLD, STATS_OLD]),
            "/latched": topic([OLD], [], kind="*"),
            "/mean": topic([STATS_OLD], ["/display"], rates={STATS_OLD: 10.0}),
            "/cook/status": topic([OLD], ["/display"], rates={OLD: 5.0}),
            "/cook/feedback": topic([OLD], ["/display"], rates={OLD: 50.0}),
        },
        "services": {
            "/calibrate": service(OLD),
            f"{OLD}/reset": service(OLD),
            f"{OLD}/get_loggers": service(OLD),
            "/broken": service(OLD, up=False),
            "/foreign": service("/display"),
        },
        "actions": {
            "/cook": {"servers": [OLD], "up": True},
            "/stuck": {"servers": [OLD], "up": False},
            "/other": {"servers": ["/display"], "up": True},
        },
    }


def test_a_publishers_contract_in_its_new_names() -> None:
    found = record(graph(), [OLD], {OLD: NEW}, "5e6f7a8b", 0.2)
    assert {key: found[key] for key in ("revision", "tolerance", "node", "nodes")} == {
        "revision": "5e6f7a8b",
        "tolerance": 0.2,
        "node": NEW,
        "nodes": [NEW],
    }
    assert found["topics"]["/temperature"] == {
        "type": "a/B",
        "md5sum": "5" * 32,
        "rate": 499.8,
        "publishers": {NEW: {"rate": 499.8}},
    }
    assert set(found["topics"]) == {
        "/temperature", f"{NEW}/debug", "/latched", "/cook/status", "/cook/feedback",
    }  # fmt: skip
    assert found["topics"]["/latched"] == {
        "type": "",
        "md5sum": "5" * 32,
        "rate": None,
        "publishers": {NEW: {"rate": None}},
    }
    assert found["subscriptions"] == {"/config": {"type": "a/B"}}
    both = {"type": "a/S", "md5sum": "6" * 32}
    assert found["services"] == {"/calibrate": both, f"{NEW}/reset": both}
    assert found["actions"] == ["/cook"]
    assert json.loads(json.dumps(found)) == found


def test_edges_have_our_end_renamed_and_leave_out_who_was_dead_or_is_a_tool() -> None:
    assert record(graph(), [OLD], {OLD: NEW})["edges"] == [
        ["/display", "/config", NEW],
        [NEW, "/cook/feedback", "/display"],
        [NEW, "/cook/status", "/display"],
        [NEW, "/temperature", "/display"],
        [NEW, "/temperature", STATS_OLD],
    ]


def test_edges_between_apps_that_are_updated_together_keep_both_ends() -> None:
    renames = {OLD: NEW, STATS_OLD: STATS_NEW}
    edges = record(graph(), [OLD], renames)["edges"]
    assert [NEW, "/temperature", STATS_NEW] in edges
    assert [NEW, f"{NEW}/debug", STATS_NEW] in edges  # a private topic follows, for whoever follows along
    assert [NEW, f"{NEW}/debug", "/display"] not in edges  # who asked for the old name goes on asking for it
    assert ["/display", "/config", STATS_NEW] not in edges  # the other app's own affair
    both = record(graph(), [OLD, STATS_OLD], renames)
    assert ["/display", "/config", STATS_NEW] in both["edges"]
    assert both["nodes"] == [NEW, STATS_NEW]
    assert both["topics"]["/mean"]["publishers"] == {STATS_NEW: {"rate": 10.0}}


def test_nothing_is_renamed_for_an_app_that_keeps_its_name() -> None:
    found = record(graph(), [OLD])
    assert (found["node"], f"{OLD}/debug" in found["topics"]) == (OLD, True)
    assert [OLD, f"{OLD}/debug", "/display"] in found["edges"]


@pytest.mark.parametrize("rate", [None, 0.9])
def test_what_a_rate_is_the_graph_knows(rate: float | None) -> None:
    of = graph()
    of["topics"]["/temperature"]["rates"] = {OLD: rate} if rate is not None else {}
    assert record(of, [OLD])["topics"]["/temperature"]["rate"] == rate


def test_the_topics_of_an_action_promise_no_rate() -> None:
    topics = record(graph(), [OLD])["topics"]
    assert [topics[f"/cook/{part}"]["rate"] for part in ("status", "feedback")] == [None, None]
    of = graph()
    of["actions"] = {}
    assert record(of, [OLD])["topics"]["/cook/feedback"]["rate"] == 50.0


def test_a_subscription_counts_once_something_comes_over_it() -> None:
    """Who subscribes to whatever there is (`rosbag record -a`) has no reason to without a publisher."""
    of = graph()
    of["topics"]["/config"] = topic(["/display"], [OLD], (OLD,))
    assert record(of, [OLD])["subscriptions"] == {}
    of["topics"]["/config"] = topic([], [OLD])
    assert record(of, [OLD])["subscriptions"] == {}
    of["topics"]["/config"] = topic(["/dead"], [OLD])
    assert record(of, [OLD])["subscriptions"] == {}


def test_what_clients_ask_of_a_node_is_theirs() -> None:
    """rosbridge subscribes, publishes and serves for its pages, which come to a pod once that is ready."""
    found = record(graph(), [OLD], {OLD: NEW}, intended=Intended(on_demand=(OLD,)))
    assert found["nodes"] == [NEW]
    assert not any(found[key] for key in ("topics", "subscriptions", "services", "actions", "edges"))
    other = record(graph(), [STATS_OLD], {OLD: NEW, STATS_OLD: STATS_NEW}, intended=Intended(on_demand=(OLD,)))
    assert not [edge for edge in other["edges"] if NEW in edge]


def test_a_topic_that_moves_is_owed_under_its_new_name_to_those_who_move_along() -> None:
    renames, intended = {OLD: NEW, STATS_OLD: STATS_NEW}, Intended(renamed={"/temperature": "/temp", "/cook": "/bake"})
    found = record(graph(), [OLD], renames, intended=intended)
    assert found["topics"]["/temp"]["rate"] == 499.8
    assert "/temperature" not in found["topics"]
    assert (found["actions"], "/bake/status" in found["topics"]) == (["/bake"], True)
    assert [edge for edge in found["edges"] if edge[1] == "/temp"] == [[NEW, "/temp", STATS_NEW]]
    assert "/temp" in record(graph(), [STATS_OLD], renames, intended=intended)["subscriptions"]


@pytest.mark.parametrize(
    ("rates", "least"),
    [({}, 449.82), ({"/temperature": 20}, 20.0), ({"/temp*": 0}, None), ({"/other": 5}, 449.82)],
)
def test_another_rate_can_be_said(rates: dict[str, float], least: float | None) -> None:
    contract = record(graph(), [OLD], {OLD: NEW}, intended=Intended(rates=rates))
    found = conditions(json.loads(json.dumps(contract)))["topics"][0]
    assert (found["name"], found.get("min_rate")) == ("/temperature", pytest.approx(least) if least else None)


@pytest.mark.parametrize("tolerance", [1, 1.5])
def test_a_tolerance_of_all_asks_for_no_rate(tolerance: float) -> None:
    assert "min_rate" not in conditions(record(graph(), [OLD], tolerance=tolerance))["topics"][0]


def test_within_a_group_the_new_versions_have_to_agree_with_each_other() -> None:
    """They do, once they are connected; the old version's type is nobody's any more."""
    renames = {OLD: NEW, STATS_OLD: STATS_NEW}
    of = graph()
    of["topics"]["/temperature"] = topic([OLD], [STATS_OLD, TOOL, "/dead"], rates={OLD: 500.0})
    found = record(of, [OLD], renames)
    assert (found["topics"]["/temperature"]["type"], found["topics"]["/temperature"]["md5sum"]) == ("", None)
    assert [NEW, "/temperature", STATS_NEW] in found["edges"]
    assert found["members"] == [STATS_NEW, NEW]
    assert record(of, [STATS_OLD], renames)["subscriptions"]["/temperature"] == {"type": ""}
    # somebody outside of the group uses it, or there is no group: the definition is his, too
    assert record(graph(), [OLD], renames)["topics"]["/temperature"]["type"] == "a/B"
    assert record(of, [OLD], {OLD: NEW})["topics"]["/temperature"]["type"] == "a/B"


def test_several_publishers_of_one_topic_each_have_their_own_rate() -> None:
    of = graph()
    of["topics"]["/temperature"] = topic([STATS_OLD, OLD], ["/display"], rates={OLD: 100.0, STATS_OLD: 40.0})
    found = record(of, [OLD, STATS_OLD])["topics"]["/temperature"]
    assert {name: seen["rate"] for name, seen in found["publishers"].items()} == {OLD: 100.0, STATS_OLD: 40.0}
    assert found["rate"] == 100.0  # of the first node named
    assert list(record(of, [OLD])["topics"]["/temperature"]["publishers"]) == [OLD]


def test_a_node_that_is_down_or_gone_leaves_nothing_to_restore() -> None:
    of = graph()
    of["nodes"][OLD] = node(reachable=False)
    for nodes in ([OLD], ["/never_there"]):
        found = record(of, nodes, {OLD: NEW})
        assert [found[key] for key in ("nodes", "topics", "subscriptions", "services", "actions", "edges")] == [
            [], {}, {}, {}, [], [],
        ]  # fmt: skip
    assert record(of, [])["node"] == ""


def test_what_the_update_changes_on_purpose_is_left_out() -> None:
    found = record(graph(), [OLD], intended=Intended(("/temperature", "/calibrate", "/cook", "/config")))
    assert set(found["topics"]) == {f"{OLD}/debug", "/latched"}
    assert (found["subscriptions"], set(found["services"]), found["actions"]) == ({}, {f"{OLD}/reset"}, [])
    assert {edge[1] for edge in found["edges"]} == {f"{OLD}/debug"}


@pytest.mark.parametrize(
    ("name", "tool"),
    [
        (TOOL, True),
        ("/rviz_1700000000000000000", True),
        ("/rosops_fleet_123", True),
        ("/ros_keeper", True),
        ("/ns/rqt_graph", True),
        ("/temperature_1a2b3c4d", False),
        ("/temperature_12345678", False),
        ("/camera_1_2", False),
        ("/my_rqt", False),
    ],
)
def test_tools(name: str, tool: bool) -> None:
    assert is_tool(name) is tool


def test_our_own_node_counts_whatever_its_name_looks_like() -> None:
    of = graph()
    assert ["/display", "/config", OLD] in record(of, [OLD])["edges"]
    anonymous = json.loads(json.dumps(of).replace(OLD, "/rqt_4711_1700000000000"))
    assert ["/display", "/config", "/rqt_4711_1700000000000"] in record(anonymous, ["/rqt_4711_1700000000000"])["edges"]


def test_what_the_keeper_gives_in_the_place_of_others_is_nobodys_to_give() -> None:
    of, with_keeper = graph(), graph()
    with_keeper["nodes"]["/ros_keeper"] = node()
    for name in ("/latched", "/temperature", "/config"):
        entry = with_keeper["topics"][name]
        entry["publishers"].append("/ros_keeper")
        entry["connections"] += [{"publisher": "/ros_keeper", "subscriber": end} for end in entry["subscribers"]]
    assert record(with_keeper, [OLD], {OLD: NEW}) == record(of, [OLD], {OLD: NEW})


def test_what_was_latched_is_owed_by_who_latched_it() -> None:
    of = graph()
    of["topics"]["/latched"]["publishers"].append(STATS_OLD)
    of["topics"]["/latched"]["latched"] = [OLD, "/ros_keeper"]
    contract = record(of, [OLD, STATS_OLD], {OLD: NEW, STATS_OLD: STATS_NEW})
    owed = [entry for entry in conditions(contract)["topics"] if entry["name"] == "/latched"]
    assert owed == [
        {"name": "/latched", "publisher": NEW, "latched": True},
        {"name": "/latched", "publisher": STATS_NEW},
    ]
    assert [topic.latched for topic in conditions_from({"topics": owed}).topics] == [True, False]
    found = contract["topics"]
    assert found["/latched"]["publishers"] == {NEW: {"rate": None, "latched": True}, STATS_NEW: {"rate": None}}
    assert found["/latched"]["latched"] is True  # of the first one, which its own probe holds to it
    assert "latched" not in found["/temperature"]


@pytest.mark.parametrize(
    ("name", "expected"),
    [(OLD, NEW), (f"{OLD}/a/b", f"{NEW}/a/b"), (f"{OLD}x", f"{OLD}x"), ("/x", "/x"), (f"/x{OLD}", f"/x{OLD}")],
)
def test_renamed(name: str, expected: str) -> None:
    assert renamed(name, {OLD: NEW}) == expected


# ---- conditions


def test_the_contract_as_conditions() -> None:
    contract = record(graph(), [OLD], {OLD: NEW}, tolerance=0.1)
    found = conditions(contract, absent=[OLD])
    assert found["nodes"] == [NEW]
    assert found["topics"][0] == {
        "name": "/temperature",
        "publisher": NEW,
        "type": "a/B",
        "min_rate": pytest.approx(449.82),
    }
    latched = next(entry for entry in found["topics"] if entry["name"] == "/latched")
    assert latched == {"name": "/latched", "publisher": NEW}
    assert found["services"] == [{"name": "/calibrate"}, {"name": f"{NEW}/reset"}]
    assert found["actions"] == [{"name": "/cook", "state": "up"}]
    assert found["absent"] == [OLD]
    assert conditions(contract, tolerance=0.5)["topics"][0]["min_rate"] == pytest.approx(249.9)


def test_only_an_end_that_is_not_ours_may_leave() -> None:
    renames = {OLD: NEW, STATS_OLD: STATS_NEW}
    edges = conditions(record(graph(), [OLD, STATS_OLD], renames))["edges"]
    peers = {(edge["publisher"], edge["topic"], edge["subscriber"]): edge.get("peer") for edge in edges}
    assert peers[NEW, "/temperature", STATS_NEW] is None
    assert peers[NEW, "/temperature", "/display"] == "subscriber"
    assert peers["/display", "/config", NEW] == "publisher"


def test_the_recorded_graph_gives_options_that_ros_ready_takes() -> None:
    probes = {"/trigger": ServiceProbe("rosrpc://h:1", "/helper", "std_srvs/Trigger", md5sum="9")}
    statuses = {"/work": {"/worker": StatusReading(((), ()))}}
    graph = build(recorded_state(), recorded_answers(), probes, statuses)
    a, b = (graph.node(name).key for name in ("/talker_a", "/talker_b"))
    rates = {"/chatter": Rate(99.9, 100, 1.0, by={a: Rate(49.9, 50, 1.0, known=49.9), b: Rate(50.0)})}
    nodes = ["/talker_a", "/helper", "/worker", "/relay"]
    found = conditions_from(options(recorded(graph.measured(rates), nodes)))
    assert EdgeCondition("/talker_a", "/chatter", "/relay") in found.edges
    assert EdgeCondition("/talker_b", "/chatter", "/relay", "publisher") in found.edges
    assert [(t.name, t.publisher, t.min_rate) for t in found.topics if t.min_rate] == [("/chatter", "/talker_a", 44.91)]
    assert (found.services, [action.name for action in found.actions]) == (("/trigger",), ["/work"])


@pytest.mark.parametrize(
    ("ignore", "left"),
    [
        (["/temperature"], {f"{NEW}/debug", "/latched", *COOK}),
        (["/lat*", "/*/feedback"], {"/temperature", f"{NEW}/debug", "/cook/status"}),
        (["/cook"], {"/temperature", f"{NEW}/debug", "/latched"}),  # an action with all its topics
        (["/Latched", "latched", "/temperature/*"], {"/temperature", f"{NEW}/debug", "/latched", *COOK}),
    ],
)
def test_what_an_update_is_meant_to_change_is_not_recorded(ignore: list[str], left: set[str]) -> None:
    found = record(graph(), [OLD], {OLD: NEW}, intended=Intended(tuple(ignore)))
    assert set(found["topics"]) == left
    assert found["actions"] == ([] if "/cook" in ignore else ["/cook"])
    assert {edge[1] for edge in found["edges"]} <= left | {"/config"}
