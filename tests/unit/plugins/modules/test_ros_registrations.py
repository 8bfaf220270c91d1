# SPDX-License-Identifier: GPL-3.0-or-later
from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest
import yaml
from ansible_collections.rosops.fleet.plugins.module_utils._common.errors import RosError
from ansible_collections.rosops.fleet.plugins.module_utils._ros.registrations import (
    ALIVE,
    DEAD,
    UNKNOWN,
    Call,
    Entry,
    Liveness,
)
from ansible_collections.rosops.fleet.plugins.modules import ros_registrations

URI = "http://10.0.0.1:1/"
GRAPH = {
    "nodes": {"/n": {"uri": URI, "pid": 7, "publications": ["/a"], "subscriptions": [], "services": ["/s"]}},
    "topics": {"/a": {"type": "x/A"}},
    "services": {"/s": {"uri": "rosrpc://10.0.0.1:3"}},
}


class FakeRos:
    there: dict[str, Entry] = {}  # noqa: RUF012 - one per test
    answers: dict[str, list[Liveness]] = {}  # noqa: RUF012
    applied: list[Call] = []  # noqa: RUF012

    def __init__(self, uri: str, timeout: float) -> None:
        self.timeout = timeout
        if uri == "http://bad":
            raise RosError("no port")

    def snapshot(self) -> dict[str, Entry]:
        return dict(self.there)

    def ask(self, entries: dict[str, Entry], seconds: float = 0.0, own_word: bool = True) -> dict[str, Liveness]:
        del own_word
        assert not seconds or seconds >= 5
        return {node: self.answers[node].pop(0) for node in entries}

    def apply(self, calls: tuple[Call, ...]) -> None:
        self.applied.extend(calls)


class Run:
    def __init__(self, monkeypatch: pytest.MonkeyPatch, main: Callable[..., dict[str, Any]]) -> None:
        self.monkeypatch, self.main = monkeypatch, main
        self.applied: list[Call] = []
        monkeypatch.setattr(ros_registrations, "Registrar", FakeRos)
        monkeypatch.setattr(ros_registrations, "BETWEEN_LOOKS", 0)

    def __call__(self, there: dict[str, Entry], answers: dict[str, list[Liveness]], **params: Any) -> dict[str, Any]:
        for name, value in (("there", there), ("answers", answers), ("applied", self.applied)):
            self.monkeypatch.setattr(FakeRos, name, value)
        return self.main(ros_registrations, **params)


@pytest.fixture
def run(monkeypatch: pytest.MonkeyPatch, main: Callable[..., dict[str, Any]]) -> Run:
    return Run(monkeypatch, main)


def living() -> Liveness:
    return Liveness(ALIVE, "", 7, frozenset({"/a"}), frozenset(), frozenset({"/s"}))


def test_present_restores(run: Run) -> None:
    result = run({}, {"/n": [living()]}, graph=GRAPH)
    assert result["changed"]
    assert result["restored"] == [call.as_dict() for call in run.applied]
    assert [entry["kind"] for entry in result["restored"]] == ["publisher", "service"]
    assert (result["removed"], result["skipped"]) == ([], [])


def test_check_mode_says_the_same_and_does_nothing(run: Run) -> None:
    result = run({}, {"/n": [living()]}, graph=GRAPH, _ansible_check_mode=True)
    assert (result["changed"], len(result["restored"]), run.applied) == (True, 2, [])
    assert list(result["diff"]["after"]) == ["/n"]


def test_present_asks_nobody_where_nothing_is_missing(run: Run) -> None:
    there = {"/n": Entry(URI, None, {"/a": "x/A"}, {}, {"/s": "rosrpc://10.0.0.1:3"})}
    result = run(there, {}, graph=GRAPH)
    assert (result["changed"], result["diff"]) == (False, {"before": {}, "after": {}})


def test_present_of_named_nodes(run: Run) -> None:
    result = run({}, {}, graph=GRAPH, nodes=["/other"])
    assert (result["changed"], result["skipped"]) == (False, [{"node": "/other", "reason": "it is not in the graph"}])


@pytest.mark.parametrize(
    ("answers", "nodes", "removed", "skipped"),
    [
        ([Liveness(DEAD, "refused"), Liveness(DEAD, "refused")], [], 1, []),
        ([Liveness(DEAD, "refused"), living()], [], 0, ["/n"]),
        ([Liveness(UNKNOWN, "late")], [], 0, ["/n"]),
        ([living()], [], 0, []),
        ([living()], ["/n"], 0, ["/n"]),  # somebody wanted it gone, and has to know
    ],
)
def test_absent(run: Run, answers: list[Liveness], nodes: list[str], removed: int, skipped: list[str]) -> None:
    result = run({"/n": Entry(URI, None, {"/a": "x/A"})}, {"/n": answers}, state="absent", nodes=nodes)
    assert (result["changed"], len(result["removed"]), len(run.applied)) == (bool(removed), removed, removed)
    assert [entry["node"] for entry in result["skipped"]] == skipped


def test_the_name_of_a_revision_means_the_nodes_of_its_pods(run: Run) -> None:
    """Of the graph that was recorded when it is to be registered, of those that are there when it is to go."""
    one, two, other = "/n_1a2b3c4d_4", "/n_1a2b3c4d_5", "/n_99999999_4"
    graph = {**GRAPH, "nodes": dict.fromkeys((one, other), GRAPH["nodes"]["/n"])}
    assert run({}, {one: [living()]}, graph=graph, nodes=["/n_1a2b3c4d"])["skipped"] == []
    assert {call.node for call in run.applied} == {one}
    dead = [Liveness(DEAD, "refused"), Liveness(DEAD, "refused")]
    there = {name: Entry(URI, None, {"/a": "x/A"}) for name in (one, two, other)}
    result = run(there, {one: [living()], two: dead}, state="absent", nodes=["/n_1a2b3c4d"])
    assert [entry["node"] for entry in result["removed"]] == [two]
    assert [entry["node"] for entry in result["skipped"]] == [one]


def test_absent_of_a_node_that_is_not_there(run: Run) -> None:
    result = run({}, {}, state="absent", nodes=["/n"])
    assert (result["changed"], result["skipped"]) == (False, [])


@pytest.mark.parametrize(
    ("params", "message"),
    [
        ({}, "graph"),
        ({"graph": {"nodes": {"/n": "up"}}}, "not one of ros_graph_info"),
        ({"graph": GRAPH, "master_uri": "http://bad"}, "no port"),
    ],
)
def test_bad_options(run: Run, params: dict[str, Any], message: str) -> None:
    result = run({}, {}, **params)
    assert (result["failed"], message in result["msg"]) == (True, True)


def test_what_is_returned_is_documented(run: Run) -> None:
    returned = run({}, {"/n": [living()]}, graph=GRAPH)
    documented = yaml.safe_load(ros_registrations.RETURN)
    assert set(documented) == set(returned) - {"changed", "diff", "invocation", "warnings"}
    assert set(documented["restored"]["sample"][0]) == set(returned["restored"][0])
