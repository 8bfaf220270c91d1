# SPDX-License-Identifier: GPL-3.0-or-later
"""What the engine asks of a robot as jobs, of its keeper or on its host, and their results as answers."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import pytest
from ansible_collections.rosops.fleet.plugins.module_utils._common.errors import KubeError, RosError
from ansible_collections.rosops.fleet.plugins.module_utils._ros.graph import Graph
from ansible_collections.rosops.fleet.plugins.module_utils._ros.graph_json import graph_data
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.host import RobotSide
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.world import Calm, Seen

MASTER, KEEPER = "http://10.43.0.1:11311", "http://10.43.0.2:11411"
REST = [{"name": "/plan", "server": "/planner"}, {"name": "/dock"}]


class Jobs:
    """Notes what is run, and answers what it was told to."""

    def __init__(self, **answer: Any) -> None:
        self.answer, self.ran = answer, list[tuple[str, dict[str, Any]]]()

    def run(self, name: str, arguments: Mapping[str, Any]) -> Mapping[str, Any]:
        self.ran.append((name, dict(arguments)))
        return self.answer


def job(name: str, **arguments: Any) -> tuple[str, dict[str, Any]]:
    return name, arguments


def host(jobs: Jobs) -> RobotSide:
    return RobotSide(lambda: None, jobs.run, lambda _images: None)


def test_the_graph_is_asked_for_with_all_that_a_contract_holds() -> None:
    jobs = Jobs(graph={"nodes": {"/lidar": {"uri": "http://a:1/", "pid": 1}}})
    assert host(jobs).graph(MASTER).node("/lidar").reachable
    host(jobs).graph(MASTER, 2.0, ["/lidar"])
    rates = {"rates": True, "rate_seconds": 2.0, "rate_nodes": ["/lidar"]}
    assert jobs.ran == [
        ("graph", {"master_uri": MASTER, "md5sums": True}),
        ("graph", {"master_uri": MASTER, **rates}),
    ]


@pytest.mark.parametrize(("answer", "message"), [({"msg": "no master"}, "no master"), ({}, "without a word")])
def test_a_question_that_fails_is_an_error(answer: dict[str, Any], message: str) -> None:
    asked = host(Jobs(failed=True, **answer))
    for ask in (
        lambda: asked.graph(MASTER, 1.0),
        lambda: asked.release(KEEPER, REST),
        lambda: asked.register(MASTER, Graph()),
        lambda: asked.reap(MASTER, ["/a"], ()),
    ):
        with pytest.raises(RosError, match=message):
            ask()


def test_goals_are_held_and_let_go() -> None:
    jobs, when = Jobs(verdict="wait", reason="/plan is busy", failed=True), [{"topic": "/battery", "above": 0.4}]
    at, asked = {"master_uri": MASTER, "keeper_uri": KEEPER}, {"seconds": 60.0, "timeout": 8.0, "interval": 0.2}
    assert host(jobs).hold(MASTER, KEEPER, Calm(REST), 60.0, 8.0) == Seen("wait", "/plan is busy")
    host(jobs).hold(MASTER, "", Calm([], when), 60.0, 8.0)  # without a keeper nothing is held, or let go
    host(jobs).release("", REST)
    assert jobs.ran == [
        job("hold", **at, actions=REST, **asked),
        job("hold", master_uri=MASTER, actions=[], values=when, **asked),
    ]
    jobs = Jobs()
    host(jobs).release(KEEPER, REST)
    asked = {"actions": ["/plan", "/dock"], "timeout": 30.0, "interval": 0.2}
    assert jobs.ran == [job("release", keeper_uri=KEEPER, **asked)]


def test_conditions_are_waited_for() -> None:
    jobs = Jobs(verdict="pass", msg="all there")
    seen = host(jobs).ready(MASTER, {"nodes": ["/a"]}, 9.0, 2.0)
    assert seen == Seen("pass", "all there")
    asked = {"master_uri": MASTER, "nodes": ["/a"], "timeout": 9.0, "stable": 2.0, "interval": 0.2}
    assert jobs.ran == [("ready", asked)]


def test_a_module_that_breaks_off_has_not_passed() -> None:
    broken = host(Jobs(failed=True, msg="no Python"))
    assert broken.ready(MASTER, {}, 1.0) == Seen("fail", "no Python")
    assert broken.hold(MASTER, KEEPER, Calm(REST), 60.0, 1.0) == Seen("fail", "no Python")


def test_registrations_are_given_and_taken() -> None:
    jobs = Jobs()
    host(jobs).register(MASTER, Graph(), ["/a"])
    host(jobs).register(MASTER, Graph())
    host(jobs).reap(MASTER, ["/b"], ["10.42.0.7"])
    assert jobs.ran == [
        job("register", master_uri=MASTER, graph=graph_data(Graph()), nodes=["/a"]),
        job("register", master_uri=MASTER, graph=graph_data(Graph()), nodes=[]),
        job("reap", master_uri=MASTER, nodes=["/b"], hosts=["10.42.0.7"]),
    ]


class KeeperOf:
    """A door that answers, or does not."""

    def __init__(self, jobs: Jobs, away: str = "") -> None:
        self.jobs, self.away, self.asked = jobs, away, 0

    def there(self) -> None:
        self.asked += 1
        if self.away:
            raise KubeError(self.away)

    def job(self, name: str, arguments: Mapping[str, Any]) -> Mapping[str, Any]:
        self.there()
        return self.jobs.run(name, arguments)


@pytest.mark.parametrize("away", ["", "no endpoints available"])
def test_the_keeper_is_asked_and_the_host_where_the_keeper_does_not_answer(away: str) -> None:
    keeper, on_host, reached, told = Jobs(verdict="pass"), Jobs(verdict="wait"), list[str](), list[str]()
    robot = RobotSide(lambda: reached.append("host"), on_host.run, lambda _images: None)
    door = KeeperOf(keeper, away)
    asked = robot.by(door, told.append)
    asked.there()
    assert asked.ready(MASTER, {}, 1.0).verdict == ("wait" if away else "pass")
    assert (bool(reached), len(keeper.ran), len(on_host.ran), door.asked) == (bool(away), not away, bool(away), 2)
    assert told == ([f"ready on its host: {away}"] if away else [])


def test_what_the_keeper_says_went_wrong_is_not_asked_of_the_host() -> None:
    on_host = Jobs()
    door = KeeperOf(Jobs(failed=True, msg="another run changes this robot"))
    asked = RobotSide(lambda: None, on_host.run, lambda _images: None).by(door, lambda _text: None)
    with pytest.raises(RosError, match="another run"):
        asked.release(KEEPER, REST)
    assert on_host.ran == []
