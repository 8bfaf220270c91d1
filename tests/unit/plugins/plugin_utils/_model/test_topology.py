# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Topology: which host plays which part, and which groups make no fleet."""

from __future__ import annotations

from typing import Any

import pytest
from ansible_collections.rosops.fleet.plugins.plugin_utils._model.topology import (
    ClusterPart,
    edge_ordered,
    fleet_topology,
    members,
    mode_of,
    topology_problems,
)


def agent(host: str, *servers: str) -> ClusterPart:
    return ClusterPart("agent", "edge", servers, False, host)


def server(host: str, *servers: str, cluster: str = "edge") -> ClusterPart:
    return ClusterPart("server", cluster, servers, host == servers[0], host)


@pytest.mark.parametrize(
    ("groups", "modes", "expected"),
    [
        ({"edge": ["e"], "robots": ["r1", "r2"]}, {}, [server("e", "e"), agent("r1", "e"), agent("r2", "e")]),
        # all are servers, and the first starts the cluster
        ({"edge": ["e2", "e1", "e3"]}, {}, [server(host, "e2", "e1", "e3") for host in ("e2", "e1", "e3")]),
        # those that are named make agents of the others
        (
            {"edge": ["e1", "e2"], "k3s_server": ["e2"], "robots": ["r1"]},
            {},
            [agent("e1", "e2"), server("e2", "e2"), agent("r1", "e2")],
        ),
        # a cluster of its own, which needs no edge
        (
            {"edge": ["e"], "robots": ["r1", "r2"]},
            {"r1": "standalone"},
            [server("e", "e"), server("r1", "r1", cluster="r1"), agent("r2", "e")],
        ),
        ({"robots": ["r1"]}, {"r1": "standalone"}, [server("r1", "r1", cluster="r1")]),
        # the groups of these names alone count
        ({"all": ["x", "e"], "edge": ["e"], "robots": [], "reachable": ["x"]}, {}, [server("e", "e")]),
    ],
)
def test_each_hosts_part(groups: dict[str, Any], modes: dict[str, str], expected: list[ClusterPart]) -> None:
    assert list(fleet_topology(groups, modes).items()) == [(part.node, part) for part in expected]


def test_a_host_may_have_another_name_in_its_cluster() -> None:
    found = fleet_topology({"edge": ["e1"], "robots": ["r1"]}, {}, {"e1": "node-1"})
    assert {name: host.node for name, host in found.items()} == {"e1": "node-1", "r1": "r1"}
    assert found["r1"].servers == ("e1",)


@pytest.mark.parametrize("first", ["", "e2"])
def test_the_edge_s_order_is_that_of_names(first: str) -> None:
    """But for the server that is named as the first; robots stay as they are."""
    groups = {"edge": ["e4", "e2", "e1", "e3"], "k3s_server": ["e3", "e2", "e1"], "robots": ["r2", "r1"]}
    servers = [*filter(None, [first]), *(name for name in ("e1", "e2", "e3") if name != first)]
    assert edge_ordered(groups, first) == {**groups, "edge": [*servers, "e4"], "k3s_server": servers}
    assert edge_ordered({"edge": "e1", "robots": ["r1"]}) == {"edge": "e1", "robots": ["r1"]}


@pytest.mark.parametrize(("said", "mode"), [({}, "agent"), ({"robot_mode": None}, "agent"), ({"robot_mode": 5}, 5)])
def test_a_robots_mode(said: dict[str, Any], mode: object) -> None:
    assert mode_of("r1", {"r1": said}) == mode


@pytest.mark.parametrize(
    ("groups", "modes", "words"),
    [
        ({}, {}, "groups: has no host in edge or robots"),
        ({"robots": ["r1"]}, {}, "groups.edge: is empty, but r1 must join"),
        ({"robots": ["r1", "r2"]}, {"r1": "standalone"}, "but r2 must join"),
        ({"edge": ["e1", "e2"], "robots": []}, {}, "gives the cluster 2 servers"),
        ({"edge": ["e1", "e2", "e3", "e4"], "robots": []}, {}, "groups.edge: gives the cluster 4 servers"),
        ({"edge": ["a", "b", "c"], "k3s_server": ["a", "b"]}, {}, "groups.k3s_server: gives the cluster 2 servers"),
        ({"edge": ["e1"], "k3s_server": ["r1"], "robots": ["r1"]}, {}, "groups.k3s_server.r1: is not in edge"),
        ({"edge": ["e1", "r1"], "k3s_server": ["e1"], "robots": ["r1"]}, {}, "groups.robots.r1: is in edge too"),
        ({"edge": ["e1"], "robots": ["edge"]}, {"edge": "standalone"}, "is the name of the shared cluster"),
        (
            {"edge": ["e1"], "robots": ["r1"]},
            {"r1": "cloud"},
            "r1.robot_mode: is 'cloud'; allowed: agent or",
        ),
        ({"edge": ["e1"], "robots": ["r1"]}, {"r1": 5}, "hosts.r1.robot_mode: is the number 5"),
        ({"edge": ["e1"], "robots": ["r1"]}, {"r1": ["agent"]}, "hosts.r1.robot_mode: is a list"),
        ({"edge": "e1", "robots": []}, {}, "groups.edge: is 'e1'; allowed: a list of host names"),
    ],
)
def test_no_fleet(groups: dict[str, Any], modes: dict[str, Any], words: str) -> None:
    said = {robot: modes.get(robot, "agent") for robot in members(groups, "robots")}
    assert any(words in problem.line() for problem in topology_problems(groups, said))
