# SPDX-License-Identifier: GPL-3.0-or-later
"""What the engine asks of a robot as modules that run on its host, and their results as answers."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import pytest
from ansible_collections.rosops.fleet.plugins.module_utils._common.errors import RosError
from ansible_collections.rosops.fleet.plugins.module_utils._ros.graph import Graph
from ansible_collections.rosops.fleet.plugins.module_utils._ros.graph_json import graph_data
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.host import ModuleHost
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.world import Calm, Seen

MASTER, KEEPER = "http://10.43.0.1:11311", "http://10.43.0.2:11411"
REST = [{"name": "/plan", "server": "/planner"}, {"name": "/dock"}]


class Modules:
    """Notes what is run, and answers what it was told to."""

    def __init__(self, **answer: Any) -> None:
        self.answer, self.ran = answer, list[tuple[str, dict[str, Any]]]()

    def run(self, name: str, arguments: Mapping[str, Any]) -> Mapping[str, Any]:
        self.ran.append((name, dict(arguments)))
        return self.answer


def job(name: str, **arguments: Any) -> tuple[str, dict[str, Any]]:
    return "_host", {"job": name, "arguments": arguments}


def host(modules: Modules) -> ModuleHost:
    return ModuleHost(lambda: None, modules.run, lambda _images: None)


def test_the_graph_is_asked_for_with_all_that_a_contract_holds() -> None:
    modules = Modules(graph={"nodes": {"/lidar": {"uri": "http://a:1/", "pid": 1}}})
    assert host(modules).graph(MASTER).node("/lidar").reachable
    host(modules).graph(MASTER, 2.0, ["/lidar"])
    rates = {"rates": True, "rate_seconds": 2.0, "rate_nodes": ["/lidar"]}
    assert modules.ran == [
        ("ros_graph_info", {"master_uri": MASTER, "md5sums": True, "service_connections": True}),
        ("ros_graph_info", {"master_uri": MASTER, **rates}),
    ]


@pytest.mark.parametrize(("answer", "message"), [({"msg": "no master"}, "no master"), ({}, "without a word")])
def test_a_question_that_fails_is_an_error(answer: dict[str, Any], message: str) -> None:
    asked = host(Modules(failed=True, **answer))
    for ask in (
        lambda: asked.graph(MASTER, 1.0),
        lambda: asked.release(KEEPER, REST),
        lambda: asked.register(MASTER, Graph()),
        lambda: asked.reap(MASTER, ["/a"]),
    ):
        with pytest.raises(RosError, match=message):
            ask()


def test_goals_are_held_and_let_go() -> None:
    modules, when = Modules(verdict="wait", reason="/plan is busy", failed=True), [{"topic": "/battery", "above": 0.4}]
    at, asked = {"master_uri": MASTER, "keeper_uri": KEEPER}, {"seconds": 60.0, "timeout": 8.0, "interval": 0.2}
    assert host(modules).hold(MASTER, KEEPER, Calm(REST), 60.0, 8.0) == Seen("wait", "/plan is busy")
    host(modules).hold(MASTER, "", Calm([], when), 60.0, 8.0)  # without a keeper nothing is held, or let go
    host(modules).release("", REST)
    assert modules.ran == [
        job("ros_hold", **at, actions=REST, **asked),
        job("ros_hold", master_uri=MASTER, actions=[], values=when, **asked),
    ]
    modules = Modules()
    host(modules).release(KEEPER, REST)
    asked = {"actions": ["/plan", "/dock"], "timeout": 30.0, "interval": 0.2}
    assert modules.ran == [job("ros_release", keeper_uri=KEEPER, **asked)]


def test_conditions_are_waited_for() -> None:
    modules = Modules(verdict="pass", msg="all there")
    seen = host(modules).ready(MASTER, {"nodes": ["/a"]}, 9.0, 2.0)
    assert seen == Seen("pass", "all there")
    asked = {"master_uri": MASTER, "nodes": ["/a"], "timeout": 9.0, "stable": 2.0, "interval": 0.2}
    assert modules.ran == [("ros_ready", asked)]


def test_a_module_that_breaks_off_has_not_passed() -> None:
    broken = host(Modules(failed=True, msg="no Python"))
    assert broken.ready(MASTER, {}, 1.0) == Seen("fail", "no Python")
    assert broken.hold(MASTER, KEEPER, Calm(REST), 60.0, 1.0) == Seen("fail", "no Python")


def test_registrations_are_given_and_taken() -> None:
    modules = Modules()
    host(modules).register(MASTER, Graph(), ["/a"])
    host(modules).register(MASTER, Graph())
    host(modules).reap(MASTER, ["/b"])
    assert modules.ran == [
        job("ros_register", master_uri=MASTER, graph=graph_data(Graph()), nodes=["/a"]),
        job("ros_register", master_uri=MASTER, graph=graph_data(Graph()), nodes=[]),
        job("ros_reap", master_uri=MASTER, nodes=["/b"]),
    ]
