# SPDX-License-Identifier: GPL-3.0-or-later
from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest
from ansible_collections.rosops.fleet.plugins.module_utils._ros import registrations
from ansible_collections.rosops.fleet.plugins.module_utils._ros.backend import MasterState
from ansible_collections.rosops.fleet.plugins.module_utils._ros.graph_json import graph_from
from ansible_collections.rosops.fleet.plugins.module_utils._ros.registrations import (
    ALIVE,
    DEAD,
    UNKNOWN,
    Entry,
    Liveness,
)

URI, OTHER = "http://10.0.0.1:1/", "http://10.0.0.1:2/"
TALKER = Entry(URI, 7, {"/a": "x/A"}, {"/b": "x/B"}, {"/s": "rosrpc://10.0.0.1:3"})
YES = Liveness(ALIVE, "", 7, frozenset({"/a"}), frozenset({"/b"}), frozenset({"/s"}))


def test_the_calls_are_the_masters_api_in_the_nodes_name() -> None:
    calls = registrations.restore({"/n": TALKER}, {}, {"/n": YES})
    assert [call.request for call in calls] == [
        ("registerPublisher", "/n", "/a", "x/A", URI),
        ("registerService", "/n", "/s", "rosrpc://10.0.0.1:3", URI),
        ("registerSubscriber", "/n", "/b", "x/B", URI),
    ]
    gone = Liveness(DEAD, "refused")
    calls = registrations.remove({"/n": TALKER}, [{"/n": gone}, {"/n": gone}])
    assert [call.request for call in calls] == [
        ("unregisterSubscriber", "/n", "/b", URI),
        ("unregisterService", "/n", "/s", "rosrpc://10.0.0.1:3"),
        ("unregisterPublisher", "/n", "/a", URI),
    ]


def test_all_publishers_come_before_the_first_subscriber() -> None:
    """Else roscpp's subscribers, told of some publishers only, would hang up on the others."""
    need = {"/a": TALKER, "/z": Entry(OTHER, None, {"/b": "x/B"})}
    answers = {"/a": YES, "/z": Liveness(ALIVE, "", 8)}  # a process id that was not recorded is not compared
    kinds = [call.kind for call in registrations.restore(need, {}, answers)]
    assert kinds == ["publisher", "publisher", "service", "subscriber"]


ALL = ("/a", "/s", "/b")


@pytest.mark.parametrize(
    ("answer", "restored"),
    [
        (YES, ALL),
        (replace(YES, publications=None, subscriptions=None), ALL),  # it does not say what it has
        (replace(YES, publications=frozenset()), ("/s", "/b")),
        (replace(YES, services=frozenset()), ("/a", "/b")),
        (replace(YES, pid=8), ()),  # another process
        (Liveness(DEAD, "nothing listens"), ()),
        (Liveness(UNKNOWN, "no answer"), ()),
    ],
)
def test_only_what_the_node_confirms_is_restored(answer: Liveness, restored: tuple[str, ...]) -> None:
    calls = registrations.restore({"/n": TALKER}, {}, {"/n": answer})
    assert tuple(call.name for call in calls) == restored
    assert registrations.restore({"/n": TALKER}, {}, {}) == ()
    # the master would shut a newer process of the name down: its address is not the one that would be registered
    assert registrations.restore({"/n": TALKER}, {"/n": Entry(OTHER, None, {"/a": "x/A"})}, {"/n": answer}) == ()


def test_who_may_only_be_late_gets_back_what_it_had_where_that_is_asked_for() -> None:
    late = {"/n": Liveness(UNKNOWN, "no answer")}
    calls = registrations.restore({"/n": TALKER}, {}, late, late=True)
    assert tuple(call.name for call in calls) == ALL
    newer = {"/n": Entry(OTHER, None, {"/a": "x/A"})}
    assert registrations.restore({"/n": TALKER}, newer, late, late=True) == ()
    assert registrations.restore({"/n": TALKER}, {}, {"/n": Liveness(DEAD)}, late=True) == ()


def test_a_service_is_not_taken_from_who_answers_for_one_who_is_late() -> None:
    need = {"/m": replace(TALKER, uri=OTHER), "/n": TALKER}
    answers = {"/m": YES, "/n": Liveness(UNKNOWN, "no answer")}
    calls = registrations.restore(need, {}, answers, late=True)
    assert [(call.node, call.name) for call in calls if call.kind == "service"] == [("/m", "/s")]
    assert {call.name for call in calls if call.node == "/n"} == {"/a", "/b"}
    there = {"/m": replace(TALKER, uri=OTHER)}
    calls = registrations.restore({"/n": TALKER}, there, answers, late=True)
    assert [call.name for call in calls] == ["/a", "/b"]


@pytest.mark.parametrize(
    ("answer", "taken"),
    [
        (YES, ()),
        (replace(YES, publications=None), ()),  # it does not say
        (replace(YES, publications=frozenset(), services=frozenset()), ("/a",)),  # the service may only be late
        (replace(YES, subscriptions=frozenset({"/c"})), ("/b",)),
        (Liveness(ALIVE, "", 8, frozenset(), frozenset()), ()),  # another process: it is gone, which is looked at twice
        (Liveness(UNKNOWN), ()),
    ],
)
def test_what_a_node_denies_is_taken_back(answer: Liveness, taken: tuple[str, ...]) -> None:
    calls = registrations.denied({"/n": TALKER}, {"/n": answer})
    assert tuple(call.name for call in calls) == taken
    assert all(call.remove for call in calls)


@pytest.mark.parametrize(
    ("present", "take", "missing"),
    [
        ({}, False, {"publications", "subscriptions", "services"}),
        ({"/n": TALKER}, True, set()),
        ({"/n": Entry(URI, None, {"/a": "x/A"})}, False, {"subscriptions", "services"}),
        ({"/n": Entry(OTHER, 7, {"/a": ""}, {"/b": ""})}, False, {"publications", "subscriptions", "services"}),
        # the service points elsewhere
        ({"/n": Entry(URI, 0, {"/a": ""}, {"/b": ""}), "/m": Entry(OTHER, 0, services={"/s": "y"})}, False, set()),
        (
            {"/n": Entry(URI, 0, {"/a": ""}, {"/b": ""}), "/m": Entry(OTHER, 0, services={"/s": "y"})},
            True,
            {"services"},
        ),
    ],
)
def test_what_is_missing(present: dict[str, Entry], take: bool, missing: set[str]) -> None:
    found = registrations.missing({"/n": TALKER}, present, take)
    kinds = ("publications", "subscriptions", "services")
    assert {kind for entry in found.values() for kind in kinds if getattr(entry, kind)} == missing
    assert bool(found) == bool(missing)


@pytest.mark.parametrize(
    ("answers", "removed"),
    [
        ([Liveness(DEAD), Liveness(DEAD)], True),
        ([Liveness(DEAD), Liveness(UNKNOWN)], False),
        ([Liveness(UNKNOWN), Liveness(UNKNOWN)], False),  # late twice is still late
        ([Liveness(DEAD), Liveness(ALIVE, "", 7)], False),
        ([Liveness(ALIVE, "", 8), Liveness(ALIVE, "", 8)], True),  # somebody else at its address
        ([Liveness(ALIVE, "", 7), Liveness(ALIVE, "", 7)], False),
    ],
)
def test_only_who_is_gone_twice_is_removed(answers: list[Liveness], removed: bool) -> None:
    assert bool(registrations.remove({"/n": TALKER}, [{"/n": answer} for answer in answers])) is removed
    assert registrations.remove({"/n": TALKER}, [{"/n": answers[0]}, {}]) == ()  # nobody asked it the second time


def test_a_graph_of_ros_graph_info() -> None:
    graph: dict[str, Any] = {
        "nodes": {
            "/n": {"uri": URI, "pid": 7, "publications": ["/a"], "subscriptions": ["/b"], "services": ["/s", "/gone"]},
            "/nowhere": {"uri": "", "pid": None, "publications": ["/a"], "subscriptions": [], "services": []},
        },
        "topics": {"/a": {"type": "x/A"}, "/b": {"type": ""}},
        "services": {"/s": {"uri": "rosrpc://10.0.0.1:3"}, "/gone": {"uri": ""}},
    }
    expected = Entry(URI, 7, {"/a": "x/A"}, {"/b": "*"}, {"/s": "rosrpc://10.0.0.1:3"})
    assert registrations.from_graph(graph_from(graph)) == {"/n": expected}


def test_a_snapshot_of_the_master() -> None:
    state = MasterState({"/a": ("/n",)}, {"/b": ("/n", "/m")}, {"/s": ("/n",)}, {"/a": "x/A"})
    found = registrations.from_master(state, {"/n": URI}, {"/s": "rosrpc://h:1"})
    assert found == {"/n": Entry(URI, None, {"/a": "x/A"}, {"/b": "*"}, {"/s": "rosrpc://h:1"})}
