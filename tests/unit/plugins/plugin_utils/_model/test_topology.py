# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Topology: which host plays which part, and which groups make no fleet."""

from __future__ import annotations

from typing import Any

import pytest
from ansible_collections.rosops.fleet.plugins.module_utils._common.errors import SpecError
from ansible_collections.rosops.fleet.plugins.plugin_utils._model.topology import Host, edge_ordered, fleet_topology


def agent(host: str, *servers: str) -> Host:
    return Host("agent", "edge", servers, False, host)


def server(host: str, *servers: str, cluster: str = "edge") -> Host:
    return Host("server", cluster, servers, host == servers[0], host)


def test_one_edge_host_serves_all_robots() -> None:
    assert fleet_topology({"edge": ["edge1"], "robots": ["robot1", "robot2"]}) == {
        "edge1": server("edge1", "edge1"),
        "robot1": agent("robot1", "edge1"),
        "robot2": agent("robot2", "edge1"),
    }


def test_all_edge_hosts_are_servers_and_the_first_starts_the_cluster() -> None:
    found = fleet_topology({"edge": ["e2", "e1", "e3"], "robots": []})
    assert found == {host: server(host, "e2", "e1", "e3") for host in ("e2", "e1", "e3")}
    assert [host for host, part in found.items() if part.init] == ["e2"]


@pytest.mark.parametrize("first", ["", "e2"])
def test_the_edge_s_order_is_that_of_names(first: str) -> None:
    """But for the server that is named as the first; robots stay as they are."""
    groups = {"edge": ["e4", "e2", "e1", "e3"], "k3s_server": ["e3", "e2", "e1"], "robots": ["r2", "r1"]}
    servers = [*filter(None, [first]), *(name for name in ("e1", "e2", "e3") if name != first)]
    assert edge_ordered(groups, first) == {**groups, "edge": [*servers, "e4"], "k3s_server": servers}
    assert edge_ordered({"edge": "e1", "robots": ["r1"]}) == {"edge": "e1", "robots": ["r1"]}


def test_named_servers_make_the_other_edge_hosts_agents() -> None:
    found = fleet_topology({"edge": ["e1", "e2"], "k3s_server": ["e2"], "robots": ["r1"]})
    assert found == {"e1": agent("e1", "e2"), "e2": server("e2", "e2"), "r1": agent("r1", "e2")}


@pytest.mark.parametrize("modes", [{"r1": "standalone"}, {"r1": {"robot_mode": "standalone", "other": 1}}])
def test_a_standalone_robot_is_its_own_cluster(modes: dict[str, Any]) -> None:
    found = fleet_topology({"edge": ["e1"], "robots": ["r1", "r2"]}, modes)
    assert found["r1"] == server("r1", "r1", cluster="r1")
    assert found["r2"] == agent("r2", "e1")


def test_a_host_may_have_another_name_in_its_cluster() -> None:
    found = fleet_topology({"edge": ["e1"], "robots": ["r1"]}, nodes={"e1": "node-1"})
    assert {name: host.node for name, host in found.items()} == {"e1": "node-1", "r1": "r1"}
    assert found["r1"].servers == ("e1",)


def test_standalone_robots_need_no_edge() -> None:
    assert fleet_topology({"robots": ["r1"]}, {"r1": "standalone"}) == {"r1": server("r1", "r1", cluster="r1")}


def test_other_groups_and_hosts_are_left_out() -> None:
    groups = {"all": ["x", "e1"], "ungrouped": ["x"], "edge": ["e1"], "robots": []}
    assert set(fleet_topology(groups)) == {"e1"}


def test_the_answer_depends_on_the_groups_alone() -> None:
    groups = {"edge": ["e1", "e2", "e3"], "robots": ["r1"]}
    assert fleet_topology(groups) == fleet_topology({**groups, "reachable": ["e3"]})


@pytest.mark.parametrize(
    ("groups", "modes", "words"),
    [
        ({}, {}, "groups: has no host in edge or robots"),
        ({"robots": ["r1"]}, {}, "groups.edge: is empty, but r1 must join"),
        ({"robots": ["r1", "r2"]}, {"r1": "standalone"}, "but r2 must join"),
        ({"edge": ["e1", "e2"], "robots": []}, {}, "gives the cluster 2 servers"),
        ({"edge": ["e1", "e2", "e3", "e4"], "robots": []}, {}, "groups.edge: gives the cluster 4 servers"),
        (
            {"edge": ["e1", "e2", "e3"], "k3s_server": ["e1", "e2"]},
            {},
            "groups.k3s_server: gives the cluster 2 servers",
        ),
        ({"edge": ["e1"], "k3s_server": ["r1"], "robots": ["r1"]}, {}, "groups.k3s_server.r1: is not in edge"),
        ({"edge": ["e1", "r1"], "k3s_server": ["e1"], "robots": ["r1"]}, {}, "groups.robots.r1: is in edge too"),
        ({"edge": ["e1"], "robots": ["edge"]}, {"edge": "standalone"}, "is the name of the shared cluster"),
        (
            {"edge": ["e1"], "robots": ["r1"]},
            {"r1": "cloud"},
            "hosts.r1.robot_mode: is 'cloud'; allowed: agent or standalone",
        ),
        ({"edge": ["e1"], "robots": ["r1"]}, {"r1": 5}, "hosts.r1.robot_mode: is the number 5"),
        ({"edge": ["e1"], "robots": ["r1"]}, {"r1": ["agent"]}, "hosts.r1.robot_mode: is a list"),
        ({"edge": "e1", "robots": []}, {}, "groups.edge: is 'e1'; allowed: a list of host names"),
    ],
)
def test_no_fleet(groups: dict[str, Any], modes: dict[str, Any], words: str) -> None:
    with pytest.raises(SpecError) as caught:
        fleet_topology(groups, modes)
    assert words in str(caught.value)
    assert caught.value.details["errors"]
