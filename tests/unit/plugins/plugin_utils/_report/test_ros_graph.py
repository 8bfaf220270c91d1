# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Of a graph: who runs where, who hears whom, and who should."""

from __future__ import annotations

from typing import Any

from ansible_collections.rosops.fleet.plugins.module_utils._ros.graph import Graph
from ansible_collections.rosops.fleet.plugins.plugin_utils._report.ros_graph import Places, links
from ansible_collections.rosops.fleet.tests.unit.plugins.plugin_utils._report import a_robot

NODES = [{"name": "edge1", "address": "192.0.2.10"}]


def found(**more: Any) -> dict[str, Any]:
    """The links by name."""
    return {link["name"]: link for link in a_robot.rows(**more)}


def test_a_node_runs_where_its_pod_does() -> None:
    places = Places(a_robot.APPS, NODES)

    def at(uri: str) -> dict[str, str]:
        return places.of("robot1", uri)

    assert at("http://10.42.0.9:1234/") == {"at": "edge1", "app": "detector"}
    assert at("http://192.0.2.10:1234/") == {"at": "edge1", "app": ""}  # in the host's own network
    assert at("http://192.0.2.99:1234/") == {"at": "192.0.2.99", "app": ""}
    assert at("") == {"at": "", "app": ""}
    assert places.of("robot2", "http://10.42.0.9:1/")["app"] == ""  # another robot's


def test_clusters_have_the_same_addresses() -> None:
    """A robot that is a cluster of its own, and an app of the whole fleet's at the edge."""
    address = a_robot.ADDRESSES["robot1"]
    shared = {"robot": "(shared)", "name": "map", "nodes": ["edge1"], "addresses": [address]}
    places = Places([*a_robot.APPS, shared], NODES)
    assert places.of("robot1", f"http://{address}:1/") == {"at": "robot1", "app": "base"}
    # in one host's network both have the same, and nobody knows whose the node is
    places = Places([*a_robot.APPS, {**shared, "nodes": ["robot1"]}], NODES)
    assert places.of("robot1", f"http://{address}:1/") == {"at": "robot1", "app": ""}


def test_who_is_registered_and_alive_and_not_connected_is_broken() -> None:
    broken = (("/merger", "/amcl"), ("/joystick", "/mux"), ("/safety", "/arm_driver"))
    assert {name: link["broken"] for name, link in found(broken=broken, down=("/mux",)).items() if link["broken"]} == {
        "/scan": [["/merger", "/amcl"]],
        "/safety/stop": [["/safety", "/arm_driver"]],
    }


def test_the_topics_of_an_action_are_one_link() -> None:
    there = found()
    assert not [name for name in there if name.startswith("/move_base/")]
    assert (there["/move_base"]["action"], there["/move_base"]["publishers"]) == (True, ["/mission"])
    for publisher, subscriber in (("/mission", "/move_base"), ("/move_base", "/mission")):
        graph = a_robot.graph()
        part = graph["topics"]["/move_base/goal" if publisher == "/mission" else "/move_base/result"]
        part["connections"].remove({"publisher": publisher, "subscriber": subscriber})
        [link] = [one for one in links("robot1", Graph.from_dict(graph)) if one["action"]]
        assert link["broken"] == [["/mission", "/move_base"]]


def test_what_nobody_listens_to_is_no_link() -> None:
    assert "/log/bag_state" not in found()


def test_a_graph_of_nothing() -> None:
    assert links("robot1", Graph()) == []
