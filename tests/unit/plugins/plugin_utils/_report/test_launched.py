# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Whose the processes of launch files are, and what is a problem."""

from __future__ import annotations

from typing import Any

import pytest
from ansible_collections.rosops.fleet.plugins.plugin_utils._report.launched import launched_rows

AGAIN = "was started again 4 times"


def app(name: str, *addresses: str, robot: str = "robot1") -> dict[str, Any]:
    return {"name": name, "robot": robot, "addresses": list(addresses)}


def child(node: str, host: str = "10.42.0.7", crash: str = "", **more: Any) -> dict[str, Any]:
    return {"node": node, "host": host, "crash": crash, "alive": False, "exit_code": None, **more}


def graphs(*launched: dict[str, Any], robot: str = "robot1") -> dict[str, Any]:
    return {robot: {"nodes": {}, "launched": list(launched)}}


def problems(apps: list[dict[str, Any]], found: dict[str, Any]) -> list[tuple[str, str]]:
    return [(row["where"], row["what"]) for row in launched_rows(apps, found)[0]]


BASE, ARM = app("base", "10.42.0.7"), app("arm", "10.42.0.8")
ELSEWHERE = "launch file at 10.42.0.7 of robot1"


@pytest.mark.parametrize(
    ("apps", "where"),
    [
        ([BASE, ARM], "app base of robot1"),
        ([app("base", "10.42.0.6", "10.42.0.7")], "app base of robot1"),  # two pods, while one takes the other's place
        ([app("base", "10.42.0.7"), app("arm", "10.42.0.7")], ELSEWHERE),  # both have the host's
        ([app("base", "10.42.0.7", robot="robot2")], ELSEWHERE),  # another cluster has the same addresses
        ([app("base", "10.42.0.7", robot="(shared)")], "app base of (shared)"),
        ([ARM, {"name": "older", "robot": "robot1"}], ELSEWHERE),
        ([], ELSEWHERE),
    ],
)
def test_whose_it_is(apps: list[dict[str, Any]], where: str) -> None:
    found = graphs(child("/arm/lidar", crash=AGAIN, alive=True))
    assert problems(apps, found) == [(where, f"/arm/lidar {AGAIN}")]


def test_a_shared_masters_graph_is_all_robots() -> None:
    other = app("base", "10.42.1.7", robot="robot2")
    found = graphs(child("/a", crash=AGAIN), child("/b", "10.42.1.7", crash=AGAIN), robot="(shared)")
    assert [where for where, _what in problems([BASE, other], found)] == ["app base of robot1", "app base of robot2"]


def test_who_has_ended_nobody_knows_how_is_said_and_no_problem() -> None:
    known = (child("/c", alive=True), child("/d", exit_code=0))
    unknown = (child("/a/map"), child("/b", "10.9.9.9"))
    assert launched_rows([BASE], graphs(*known, *unknown)) == (
        [],
        [
            {"robot": "robot1", "app": "base", "node": "/a/map", "host": "10.42.0.7"},
            {"robot": "robot1", "app": "", "node": "/b", "host": "10.9.9.9"},
        ],
    )


def test_graphs_without_launch_files() -> None:
    assert launched_rows([BASE], {"robot1": {"nodes": {}}}) == ([], [])
