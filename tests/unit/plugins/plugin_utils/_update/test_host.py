# SPDX-License-Identifier: GPL-3.0-or-later
"""What the engine asks of a robot as jobs, of its keeper or on its host, and their results as answers."""

from __future__ import annotations

from typing import Any
from unittest.mock import Mock, call

import pytest
from ansible_collections.rosops.fleet.plugins.module_utils._common.errors import KubeError, RosError
from ansible_collections.rosops.fleet.plugins.module_utils._ros.graph import Graph
from ansible_collections.rosops.fleet.plugins.module_utils._ros.graph_json import graph_data
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.host import RobotSide
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.world import Calm, Seen

MASTER, KEEPER = "http://10.43.0.1:11311", "http://10.43.0.2:11411"
REST = [{"name": "/plan", "server": "/planner"}, {"name": "/dock"}]


def host(job: Mock) -> RobotSide:
    return RobotSide(Mock(), job, Mock())


def test_the_graph_is_asked_for_with_all_that_a_contract_holds() -> None:
    job = Mock(return_value={"graph": {"nodes": {"/lidar": {"uri": "http://a:1/", "pid": 1}}}})
    assert host(job).graph(MASTER).node("/lidar").reachable
    host(job).graph(MASTER, 2.0, ["/lidar"])
    rates = {"rates": True, "rate_seconds": 2.0, "rate_nodes": ["/lidar"]}
    assert job.mock_calls == [
        call("graph", {"master_uri": MASTER, "md5sums": True}),
        call("graph", {"master_uri": MASTER, **rates}),
    ]


@pytest.mark.parametrize(("answer", "message"), [({"msg": "no master"}, "no master"), ({}, "without a word")])
def test_a_question_that_fails_is_an_error(answer: dict[str, Any], message: str) -> None:
    asked = host(Mock(return_value={"failed": True, **answer}))
    for ask in (
        lambda: asked.graph(MASTER, 1.0),
        lambda: asked.release(KEEPER, REST),
        lambda: asked.register(MASTER, Graph()),
        lambda: asked.reap(MASTER, ["/a"], ()),
    ):
        with pytest.raises(RosError, match=message):
            ask()


def test_goals_are_held_and_let_go() -> None:
    job, when = Mock(), [{"topic": "/battery", "above": 0.4}]
    job.return_value = {"verdict": "wait", "reason": "/plan is busy", "failed": True}
    at, asked = {"master_uri": MASTER, "keeper_uri": KEEPER}, {"seconds": 60.0, "timeout": 8.0, "interval": 0.2}
    assert host(job).hold(MASTER, KEEPER, Calm(REST), 60.0, 8.0) == Seen("wait", "/plan is busy")
    host(job).hold(MASTER, "", Calm([], when), 60.0, 8.0)  # without a keeper nothing is held, or let go
    host(job).release("", REST)
    job.return_value = {}
    host(job).release(KEEPER, REST)
    assert job.mock_calls == [
        call("hold", {**at, "actions": REST, **asked}),
        call("hold", {"master_uri": MASTER, "actions": [], "values": when, **asked}),
        call("release", {"keeper_uri": KEEPER, "actions": ["/plan", "/dock"], "timeout": 30.0, "interval": 0.2}),
    ]


def test_conditions_are_waited_for() -> None:
    job = Mock(return_value={"verdict": "pass", "msg": "all there"})
    assert host(job).ready(MASTER, {"nodes": ["/a"]}, 9.0, 2.0) == Seen("pass", "all there")
    asked = {"master_uri": MASTER, "nodes": ["/a"], "timeout": 9.0, "stable": 2.0, "interval": 0.2}
    job.assert_called_once_with("ready", asked)


def test_a_module_that_breaks_off_has_not_passed() -> None:
    broken = host(Mock(return_value={"failed": True, "msg": "no Python"}))
    assert broken.ready(MASTER, {}, 1.0) == Seen("fail", "no Python")
    assert broken.hold(MASTER, KEEPER, Calm(REST), 60.0, 1.0) == Seen("fail", "no Python")


def test_registrations_are_given_and_taken() -> None:
    job, graph = Mock(return_value={}), graph_data(Graph())
    host(job).register(MASTER, Graph(), ["/a"])
    host(job).register(MASTER, Graph())
    host(job).reap(MASTER, ["/b"], ["10.42.0.7"])
    assert job.mock_calls == [
        call("register", {"master_uri": MASTER, "graph": graph, "nodes": ["/a"]}),
        call("register", {"master_uri": MASTER, "graph": graph, "nodes": []}),
        call("reap", {"master_uri": MASTER, "nodes": ["/b"], "hosts": ["10.42.0.7"]}),
    ]


@pytest.mark.parametrize("away", ["", "no endpoints available"])
def test_the_keeper_is_asked_and_the_host_where_the_keeper_does_not_answer(away: str) -> None:
    there, on_host, told, door = Mock(), Mock(return_value={"verdict": "wait"}), Mock(), Mock()
    door.job.return_value = {"verdict": "pass"}
    door.there.side_effect = door.job.side_effect = KubeError(away) if away else None
    asked = RobotSide(there, on_host, Mock()).by(door, told)
    asked.there()
    assert asked.ready(MASTER, {}, 1.0).verdict == ("wait" if away else "pass")
    assert (there.call_count, on_host.mock_calls) == ((1, door.job.mock_calls) if away else (0, []))
    assert (door.there.call_count, door.job.call_count) == (1, 1)
    assert told.mock_calls == ([call(f"ready on its host: {away}")] if away else [])


def test_what_the_keeper_says_went_wrong_is_not_asked_of_the_host() -> None:
    on_host, door = Mock(), Mock()
    door.job.return_value = {"failed": True, "msg": "another run changes this robot"}
    with pytest.raises(RosError, match="another run"):
        host(on_host).by(door, Mock()).release(KEEPER, REST)
    assert not on_host.called
