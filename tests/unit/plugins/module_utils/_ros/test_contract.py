# SPDX-License-Identifier: GPL-3.0-or-later
from __future__ import annotations

import json
from typing import Any

import pytest
from ansible_collections.rosops.fleet.plugins.module_utils._ros.contract import Contract, Intended, as_before, untold
from ansible_collections.rosops.fleet.plugins.module_utils._ros.contract import conditions as options
from ansible_collections.rosops.fleet.plugins.module_utils._ros.contract import record as recorded
from ansible_collections.rosops.fleet.plugins.module_utils._ros.graph_json import graph_from

OLD, NEW = "/temperature_1a2b3c4d", "/temperature_5e6f7a8b"
STATS_OLD, STATS_NEW = "/stats_11111111", "/stats_22222222"
COOK = ("/cook/status", "/cook/feedback")
TOOL = "/rostopic_4711_1700000000000"


def record(of: dict[str, Any], *args: Any, **more: Any) -> dict[str, Any]:
    """The contract as it lies in the cluster, where every version of the collection reads these very keys."""
    made = recorded(graph_from(of), *args, **more)
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


def changed(nodes: dict[str, Any] | None = None, **topics: Any) -> dict[str, Any]:
    """The graph with other topics, and nodes."""
    of = graph()
    of["topics"].update({f"/{name}": entry for name, entry in topics.items()})
    return {**of, "nodes": {**of["nodes"], **(nodes or {})}}


def kept() -> dict[str, Any]:
    """The keeper publishes in the place of others."""
    of = changed({"/ros_keeper": node()})
    for name in ("/latched", "/temperature", "/config"):
        entry = of["topics"][name]
        entry["publishers"].append("/ros_keeper")
        entry["connections"] += [{"publisher": "/ros_keeper", "subscriber": end} for end in entry["subscribers"]]
    return of


ALONE, BOTH = {OLD: NEW}, {OLD: NEW, STATS_OLD: STATS_NEW}
ANY_SERVICE = {"type": "a/S", "md5sum": "6" * 32}
OWN_EDGES = [
    ["/display", "/config", NEW], [NEW, "/cook/feedback", "/display"], [NEW, "/cook/status", "/display"],
    [NEW, "/temperature", "/display"], [NEW, "/temperature", STATS_OLD],
]  # fmt: skip
NOTHING = {"topics": {}, "subscriptions": {}, "services": {}, "actions": [], "edges": []}
BRIDGE = Intended(on_demand=(OLD,))  # rosbridge: what it has on the graph is its pages' wish
MOVED = Intended(renamed={"/temperature": "/temp", "/cook": "/bake"})
MEANT = Intended(("/temperature", "/calibrate", "/cook", "/config"))
TOGETHER = changed(temperature=topic([OLD], [STATS_OLD, TOOL, "/dead"], rates={OLD: 500.0}))
TWO = changed(temperature=topic([STATS_OLD, OLD], ["/display"], rates={OLD: 100.0, STATS_OLD: 40.0}))
TOOL_LIKE = json.loads(json.dumps(graph()).replace(OLD, "/rqt_1"))  # an app may be called so, too
LATCHED = changed(latched={**topic([OLD, STATS_OLD], [], kind="*"), "latched": [OLD, "/ros_keeper"]})


@pytest.mark.parametrize(
    ("of", "nodes", "renames", "intended", "expected"),
    [
        (graph(), [OLD], ALONE, None, {
            "node": NEW, "nodes": [NEW], "members": [NEW], "subscriptions": {"/config": {"type": "a/B"}},
            "services": {"/calibrate": ANY_SERVICE, f"{NEW}/reset": ANY_SERVICE}, "actions": ["/cook"],
            # without who was dead or is a tool
            "edges": OWN_EDGES,
        }),
        (kept(), [OLD], ALONE, None, record(graph(), [OLD], ALONE)),
        (graph(), [OLD], {}, None, {"node": OLD, "nodes": [OLD], "members": []}),
        (graph(), [], {}, None, {"node": "", "nodes": [], **NOTHING}),
        (changed({OLD: node(reachable=False)}), [OLD], ALONE, None, {"node": NEW, "nodes": [], **NOTHING}),
        (graph(), ["/never_there"], ALONE, None, {"node": "/never_there", "nodes": [], **NOTHING}),
        (graph(), [OLD], ALONE, BRIDGE, {"nodes": [NEW], **NOTHING}),
        (graph(), [STATS_OLD], BOTH, BRIDGE, {
            "edges": [["/display", "/config", STATS_NEW], [STATS_NEW, "/mean", "/display"]],
        }),
        # who subscribes to whatever there is (`rosbag record -a`) has no reason to without a publisher
        (changed(config=topic(["/display"], [OLD], (OLD,))), [OLD], {}, None, {"subscriptions": {}}),
        (changed(config=topic([], [OLD])), [OLD], {}, None, {"subscriptions": {}}),
        (changed(config=topic(["/dead"], [OLD])), [OLD], {}, None, {"subscriptions": {}}),
        (graph(), [OLD], BOTH, MOVED, {"actions": ["/bake"]}),
        (graph(), [OLD], BOTH, Intended(("/bake",), MOVED.renamed), {"actions": []}),
        (TOGETHER, [OLD], BOTH, None, {"members": [STATS_NEW, NEW]}),
        (graph(), [OLD], {}, MEANT, {
            "subscriptions": {}, "services": {f"{OLD}/reset": ANY_SERVICE}, "actions": [],
            "edges": [[OLD, f"{OLD}/debug", end] for end in ("/display", STATS_OLD)],
        }),
    ],
)  # fmt: skip
def test_what_nodes_are_to_the_graph(
    of: dict[str, Any], nodes: list[str], renames: Any, intended: Intended | None, expected: dict[str, Any]
) -> None:
    found = record(of, nodes, renames, intended=intended or Intended())
    assert {key: found[key] for key in expected} == expected


@pytest.mark.parametrize(
    ("of", "nodes", "renames", "intended", "there", "gone"),
    [
        (graph(), [OLD], BOTH, None, [
            [NEW, "/temperature", STATS_NEW],
            [NEW, f"{NEW}/debug", STATS_NEW],  # a private topic follows, for whoever follows along
        ], [
            [NEW, f"{NEW}/debug", "/display"],  # who asked for the old name goes on asking for it
            ["/display", "/config", STATS_NEW],  # the other app's own affair
        ]),
        (graph(), [OLD, STATS_OLD], BOTH, None, [["/display", "/config", STATS_NEW]], []),
        (graph(), [OLD], {}, None, [[OLD, f"{OLD}/debug", "/display"]], []),
        (graph(), [OLD], BOTH, MOVED, [[NEW, "/temp", STATS_NEW]], [[NEW, "/temp", "/display"]]),
        (TOGETHER, [OLD], BOTH, None, [[NEW, "/temperature", STATS_NEW]], []),
        (TOOL_LIKE, ["/rqt_1"], {}, None, [["/display", "/config", "/rqt_1"]], []),
    ],
)  # fmt: skip
def test_which_connections_are_owed(  # noqa: PLR0913 - the table's columns
    of: dict[str, Any], nodes: list[str], renames: Any, intended: Intended | None, there: Any, gone: Any
) -> None:
    edges = record(of, nodes, renames, intended=intended or Intended())["edges"]
    assert [edge for edge in there if edge not in edges] == []
    assert [edge for edge in gone if edge in edges] == []


@pytest.mark.parametrize(
    ("of", "nodes", "renames", "intended", "name", "expected"),
    [
        (graph(), [OLD], ALONE, None, "/temperature", {
            "type": "a/B", "md5sum": "5" * 32, "publishers": {NEW: {"rate": 499.8}},
        }),
        (graph(), [OLD], ALONE, None, "/latched", {
            "type": "", "md5sum": "5" * 32, "publishers": {NEW: {"rate": None}},
        }),
        (graph(), [OLD], BOTH, MOVED, "/temp", {"publishers": {NEW: {"rate": 499.8}}}),
        # an action's topics promise no rate
        (graph(), [OLD], {}, None, "/cook/status", {"publishers": {OLD: {"rate": None}}}),
        (graph(), [OLD], {}, None, "/cook/feedback", {"publishers": {OLD: {"rate": None}}}),
        ({**graph(), "actions": {}}, [OLD], {}, None, "/cook/feedback", {"publishers": {OLD: {"rate": 50.0}}}),
        # new versions that are connected agree with each other; to somebody else the definition is his, too
        (TOGETHER, [OLD], BOTH, None, "/temperature", {"type": "", "md5sum": None}),
        (graph(), [OLD], BOTH, None, "/temperature", {"type": "a/B"}),
        (TOGETHER, [OLD], ALONE, None, "/temperature", {"type": "a/B"}),
        (TWO, [OLD, STATS_OLD], {}, None, "/temperature", {
            "publishers": {OLD: {"rate": 100.0}, STATS_OLD: {"rate": 40.0}},
        }),
        (TWO, [OLD], {}, None, "/temperature", {"publishers": {OLD: {"rate": 100.0}}}),
        (LATCHED, [OLD, STATS_OLD], BOTH, None, "/latched", {
            "publishers": {NEW: {"rate": None, "latched": True}, STATS_NEW: {"rate": None}},
        }),
    ],
)  # fmt: skip
def test_what_a_topic_owes(  # noqa: PLR0913 - the table's columns
    of: dict[str, Any], nodes: list[str], renames: Any, intended: Intended | None, name: str, expected: dict[str, Any]
) -> None:
    found = record(of, nodes, renames, intended=intended or Intended())["topics"][name]
    assert {key: found[key] for key in expected} == expected


def test_a_subscription_moves_with_its_topic_and_asks_for_no_type_of_the_step_itself() -> None:
    assert "/temp" in record(graph(), [STATS_OLD], BOTH, intended=MOVED)["subscriptions"]
    assert record(TOGETHER, [STATS_OLD], BOTH)["subscriptions"]["/temperature"] == {"type": ""}


@pytest.mark.parametrize(
    ("rates", "tolerance", "least"),
    [
        ({}, 0.1, 449.82),
        ({"/temperature": 20}, 0.1, 20.0),
        ({"/temp*": 0}, 0.1, None),
        ({"/other": 5}, 0.1, 449.82),
        ({}, 0.5, 249.9),
        ({}, 1, None),
        ({}, 1.5, None),
    ],
)
def test_the_least_rate(rates: dict[str, float], tolerance: float, least: float | None) -> None:
    contract = {**record(graph(), [OLD], ALONE, intended=Intended(rates=rates)), "tolerance": tolerance}
    for found in (conditions(contract), conditions({**contract, "tolerance": 0.3}, tolerance=tolerance)):
        assert found["topics"][0].get("min_rate") == (pytest.approx(least) if least else None)


def test_the_contract_as_conditions() -> None:
    found = conditions(record(LATCHED, [OLD, STATS_OLD], BOTH))
    assert found["nodes"] == [NEW, STATS_NEW]
    of = {(entry["name"], entry["publisher"]): entry for entry in found["topics"]}
    assert of["/temperature", NEW] == {
        "name": "/temperature", "publisher": NEW, "type": "a/B", "min_rate": pytest.approx(449.82),
    }  # fmt: skip
    assert of["/latched", NEW] == {"name": "/latched", "publisher": NEW, "latched": True}
    assert of["/latched", STATS_NEW] == {"name": "/latched", "publisher": STATS_NEW}
    assert found["services"] == [{"name": "/calibrate"}, {"name": f"{NEW}/reset"}]
    assert found["actions"] == [{"name": "/cook", "state": "up"}]
    # an end that is not ours may leave
    peers = {(edge["publisher"], edge["topic"], edge["subscriber"]): edge.get("peer") for edge in found["edges"]}
    assert peers[NEW, "/temperature", STATS_NEW] is None
    assert (peers[NEW, "/temperature", "/display"], peers["/display", "/config", NEW]) == ("subscriber", "publisher")


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
    earlier = Contract.from_dict(record(graph(), [OLD], {OLD: NEW})).owed(Intended(tuple(ignore)))
    assert earlier == Contract.from_dict(found)  # as is asked of an app that is down when its update begins
    nothing = earlier.owed(Intended(on_demand=(NEW,)))
    assert (nothing.nodes, nothing.topics, nothing.edges, nothing.services) == ((NEW,), {}, (), {})


@pytest.mark.parametrize(
    ("topic_name", "sent", "intended", "told"),
    [
        ("temperature", {"unsteady": {OLD: 200.0}}, Intended(), {OLD}),
        ("temperature", {"unsteady": {OLD: 199.0}}, Intended(), set()),  # so few may be sent when something happens
        ("temperature", {"unsteady": {OLD: 500.0}}, Intended(rates={"/temperature": 0}), set()),  # by its word
        ("temperature", {"unsteady": {OLD: 500.0}}, Intended(ignore=("/temperature",)), set()),
        ("temperature", {"unsteady": {"/display": 500.0}}, Intended(), set()),  # that one stays
        ("temperature", {"unsteady": {OLD: 500.0}, "rates": {OLD: 500.0}}, Intended(), set()),
        ("cook/feedback", {"unsteady": {OLD: 500.0}}, Intended(), set()),  # what goals make it carry
    ],
)
def test_of_which_nodes_a_rate_should_be_known(
    topic_name: str, sent: dict[str, Any], intended: Intended, told: set[str]
) -> None:
    of = changed(**{topic_name: {**topic([OLD, "/display"], ["/dead"]), **sent}})
    found = untold(graph_from(of), [OLD], intended)
    assert {*found} == told
    if told:
        assert found[OLD] == f"{OLD} sends 200 messages a second on /temperature, too unevenly to tell its rate"


@pytest.mark.parametrize(
    ("now", "rate"),
    [(500.0, 400.0), (300.0, 300.0), (200.0, 200.0), (199.0, None)],
    ids=["as was known", "no more than it sends", "half", "it may be another stream by now"],
)
@pytest.mark.parametrize("publishers", [{OLD: {"rate": 400.0}}, {"/other_name": {"rate": 400.0}}])
def test_what_cannot_be_told_is_as_it_was(now: float, rate: float | None, publishers: dict[str, Any]) -> None:
    earlier = Contract.from_dict({"topics": {"/temperature": {"publishers": publishers}}})
    of = changed(temperature={**topic([OLD, "/display"], []), "unsteady": {OLD: now, "/display": 390.0}})
    for contract in (earlier, Contract(others=earlier)):
        found = as_before(graph_from(of), [OLD], contract)
        assert {key.name: hz for key, hz in found.topic("/temperature").rates.items()} == ({OLD: rate} if rate else {})
    assert as_before(graph_from(of), [OLD], Contract()).topics == graph_from(of).topics


def test_it_is_read_with_the_names_of_revisions_whatever_pod_it_was_written_of() -> None:
    made = recorded(graph_from(graph()), [OLD, STATS_OLD], {OLD: NEW, STATS_OLD: STATS_NEW})
    made = Contract.from_dict({**made.as_dict(), "others": made.as_dict()})
    written = json.dumps(made.as_dict()).replace(NEW, f"{NEW}_79d9c6f8b5").replace(STATS_NEW, f"{STATS_NEW}_4")
    assert written.count("_79d9c6f8b5") > 10
    assert Contract.from_dict(json.loads(written)) == made


@pytest.mark.parametrize("rated", [0, 1])
def test_of_two_pods_of_a_revision_the_one_counts_of_which_a_rate_is_known(rated: int) -> None:
    """One of them has only just come, or goes."""
    pods = [f"{OLD}_{number}" for number in (4, 5)]
    there = {
        "nodes": {name: {**node(), "uri": f"http://{name[-1]}:1/"} for name in (*pods, "/display")},
        "topics": {"/temperature": topic(pods, ["/display"], rates={pods[rated]: 500.0})},
    }
    made = recorded(graph_from(there).by_revision(), [OLD], {OLD: NEW})
    (sent,) = made.topics["/temperature"].publishers.values()
    assert (made.nodes, sent.rate, made.edges) == ((NEW,), 500.0, ((NEW, "/temperature", "/display"),))
