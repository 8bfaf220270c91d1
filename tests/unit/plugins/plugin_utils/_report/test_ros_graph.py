# SPDX-License-Identifier: GPL-3.0-or-later
"""Of a graph: who runs where, who hears whom, and who should."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest
from ansible_collections.rosops.fleet.plugins.module_utils._ros.graph import Graph
from ansible_collections.rosops.fleet.plugins.plugin_utils._report.ros_graph import (
    Process,
    Reading,
    launched_rows,
    links,
    place,
)
from ansible_collections.rosops.fleet.plugins.plugin_utils._report.rows import Ended, Link, Workload
from ansible_collections.rosops.fleet.tests.unit.plugins.plugin_utils._report import a_robot

HOSTS = {"192.0.2.10": "edge1"}


def found(**more: Any) -> dict[str, Link]:
    """The links by name."""
    return {link.name: link for link in a_robot.rows(**more)}


@pytest.mark.parametrize(
    ("robot", "address", "found"),
    [
        ("robot1", "10.42.0.9", ("edge1", "detector")),
        ("robot1", "192.0.2.10", ("edge1", "")),  # in the host's own network
        ("robot1", "192.0.2.99", ("192.0.2.99", "")),
        ("robot1", "", ("", "")),
        ("robot2", "10.42.0.9", ("10.42.0.9", "")),  # another robot's
    ],
)
def test_a_node_runs_where_its_pod_does(robot: str, address: str, found: tuple[str, str]) -> None:
    assert place(robot, f"http://{address}:1234/" if address else "", a_robot.APPS, HOSTS) == found


def test_clusters_have_the_same_addresses() -> None:
    """A robot that is a cluster of its own, and an app of the whole fleet's at the edge."""
    address = a_robot.ADDRESSES["robot1"]
    shared = Workload("(shared)", "map", nodes=("edge1",), addresses=(address,))
    assert place("robot1", f"http://{address}:1/", [*a_robot.APPS, shared], HOSTS) == ("robot1", "base")
    # in one host's network both have the same, and nobody knows whose the node is
    apps = [*a_robot.APPS, replace(shared, nodes=("robot1",))]
    assert place("robot1", f"http://{address}:1/", apps, HOSTS) == ("robot1", "")


def test_who_is_registered_and_alive_and_not_connected_is_broken() -> None:
    broken = (("/merger", "/amcl"), ("/joystick", "/mux"), ("/safety", "/arm_driver"))
    assert {name: link.broken for name, link in found(broken=broken, down=("/mux",)).items() if link.broken} == {
        "/scan": (("/merger", "/amcl"),),
        "/safety/stop": (("/safety", "/arm_driver"),),
    }


def test_the_topics_of_an_action_are_one_link() -> None:
    there = found()
    assert not [name for name in there if name.startswith("/move_base/")]
    assert (there["/move_base"].action, there["/move_base"].publishers) == (True, ("/mission",))
    for publisher, subscriber in (("/mission", "/move_base"), ("/move_base", "/mission")):
        graph = a_robot.graph()
        part = graph["topics"]["/move_base/goal" if publisher == "/mission" else "/move_base/result"]
        part["connections"].remove({"publisher": publisher, "subscriber": subscriber})
        [link] = [one for one in links({"robot1": Reading.from_dict(graph, {})}) if one.action]
        assert link.broken == (("/mission", "/move_base"),)


# --- processes of launch files


def app(name: str, *addresses: str, robot: str = "robot1") -> Workload:
    return Workload(robot, name, addresses=addresses)


def graphs(*launched: Process, robot: str = "robot1") -> dict[str, Reading]:
    return {robot: Reading(Graph(), launched)}


BASE, ARM = app("base", "10.42.0.7"), app("arm", "10.42.0.8")
CRASHED = Process("/arm/lidar", "10.42.0.7", alive=True, crash="was started again 4 times")
ELSEWHERE = "launch file at 10.42.0.7 of robot1"


@pytest.mark.parametrize(
    ("apps", "where"),
    [
        ([BASE, ARM], "app base of robot1"),
        ([app("base", "10.42.0.6", "10.42.0.7")], "app base of robot1"),  # two pods, while one takes the other's place
        ([BASE, app("arm", "10.42.0.7")], ELSEWHERE),  # both have the host's
        ([app("base", "10.42.0.7", robot="robot2")], ELSEWHERE),  # another cluster has the same addresses
        ([app("base", "10.42.0.7", robot="(shared)")], "app base of (shared)"),
        ([ARM, app("older")], ELSEWHERE),
        ([], ELSEWHERE),
    ],
)
def test_whose_a_crashed_process_is(apps: list[Workload], where: str) -> None:
    [problem], ended = launched_rows(apps, graphs(CRASHED))
    assert (problem.where, problem.what, ended) == (where, "/arm/lidar was started again 4 times", [])
    assert problem.todo.endswith("logs deploy/base") == where.startswith("app base")


def test_a_shared_masters_graph_is_all_robots() -> None:
    other = app("base", "10.42.1.7", robot="robot2")
    problems, _ended = launched_rows(
        [BASE, other], graphs(CRASHED, replace(CRASHED, host="10.42.1.7"), robot="(shared)")
    )
    assert [one.where for one in problems] == ["app base of robot1", "app base of robot2"]


def test_who_has_ended_nobody_knows_how_is_said_and_no_problem() -> None:
    known = (Process("/c", "10.42.0.7", alive=True), Process("/d", "10.42.0.7", exit_code=0))
    unknown = (Process("/a/map", "10.42.0.7"), Process("/b", "10.9.9.9"))
    ended = [Ended("robot1", "base", "/a/map", "10.42.0.7"), Ended("robot1", "", "/b", "10.9.9.9")]
    assert launched_rows([BASE], graphs(*known, *unknown)) == ([], ended)
