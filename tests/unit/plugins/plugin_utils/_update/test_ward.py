# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Which nodes are a robot's own, where a host is changed."""

from __future__ import annotations

from ansible_collections.rosops.fleet.plugins.module_utils._ros.graph import Graph
from ansible_collections.rosops.fleet.plugins.plugin_utils._update import ward
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.step import actions_to_rest
from ansible_collections.rosops.fleet.tests.unit.robots import robot


def shared_graph() -> Graph:
    nodes = {
        "/robot1/planner": {"pid": 1, "uri": "http://a/"},
        "/robot1/silent": {"uri": "http://b/"},
        "/robot1/dead": {"uri": "http://c/", "refused": True},
        "/robot2/planner": {"pid": 1, "uri": "http://d/"},
    }
    actions = {f"{name}/plan": {"up": True, "servers": [name], "clients": []} for name in nodes}
    return Graph.from_dict({"nodes": nodes, "actions": actions})


def test_where_robots_share_a_master_only_the_own_ones_rest() -> None:
    graph = shared_graph()
    shared = robot(name="robot1", master={"mode": "shared"})
    nodes = ward.own_nodes(graph, shared)
    assert nodes == ["/robot1/dead", "/robot1/planner", "/robot1/silent"]
    # a server that does not answer may be at work, one that is gone is not
    assert [one["server"] for one in actions_to_rest(graph, nodes)] == ["/robot1/planner", "/robot1/silent"]
    assert ward.conditions(graph, nodes)["nodes"] == ["/robot1/planner"]
