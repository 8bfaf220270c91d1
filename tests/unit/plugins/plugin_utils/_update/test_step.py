# SPDX-License-Identifier: GPL-3.0-or-later
"""One step of an update: what must hold before and after it, and what it applies."""

from __future__ import annotations

import json
from typing import Any

import pytest
from ansible_collections.rosops.fleet.plugins.module_utils._ros.contract import Sent
from ansible_collections.rosops.fleet.plugins.module_utils._ros.graph_json import graph_data, graph_from
from ansible_collections.rosops.fleet.plugins.module_utils._step import words
from ansible_collections.rosops.fleet.plugins.module_utils._step.objects import revision_of
from ansible_collections.rosops.fleet.plugins.module_utils._step.record import record_of
from ansible_collections.rosops.fleet.plugins.module_utils._step.words import BACK_TO
from ansible_collections.rosops.fleet.plugins.plugin_utils._model import names
from ansible_collections.rosops.fleet.plugins.plugin_utils._model.context import Robot
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.manifests import HISTORY_KEPT, step_objects
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.plan import Step
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.step import (
    Gate,
    is_dead,
    proof,
    proof_of_old,
    proves_nothing,
    step_gate,
    with_rates,
)
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.world import Calm, Live
from ansible_collections.rosops.fleet.tests.unit.robots import robot
from ansible_collections.rosops.fleet.tests.unit.simulated.objects import (
    app,
    applied,
    entry,
    planned,
    update_map,
    versions,
)

URI = "http://10.42.0.7:4000/"


def step_of(before: Robot, after: Robot, *maps: dict[str, Any]) -> Step:
    (step,) = planned(after, applied(before, *maps)).steps
    return step


def sensor_step(**more: Any) -> Step:
    return step_of(*versions(app("sensor", **more)))


def node(**more: Any) -> dict[str, Any]:
    return {"uri": URI, "pid": 1, "reachable": True, "error": "", **more}


def gate_of(step: Step, graph: dict[str, Any], live: Live) -> Gate:
    return step_gate(step, graph_from(graph), live)


def graph_of(step: Step, **more: Any) -> dict[str, Any]:
    """A sensor at 500 Hz with one subscriber of its own and a service."""
    (old,) = step.old_nodes.values()
    topic = {
        "type": "x/Temperature", "md5sum": "abc", "publishers": [old], "subscribers": ["/listener"],
        "connections": [{"publisher": old, "subscriber": "/listener"}], "rates": {old: 500.0},
    }  # fmt: skip
    service = {"providers": [old], "provider": old, "type": "x/Srv", "up": True}
    nodes = {old: node(), "/listener": node()}
    return {"nodes": nodes, "topics": {"/temperature": topic}, "services": {"/calibrate": service}, **more}


def test_the_contract_is_in_the_new_revisions_names_and_becomes_conditions() -> None:
    step = sensor_step()
    graph, (old,), (new,) = graph_of(step), step.old_nodes.values(), step.new_nodes.values()
    foreign = {**graph["topics"]["/temperature"], "publishers": ["/listener"], "connections": [], "rates": {}}
    # of another node, and what carries no rate of its own: a second of listening for nothing
    graph["topics"] |= {"/other": foreign, "/rosout": {"publishers": [old]}}
    gate = gate_of(step, graph, Live())
    assert (gate.problems, gate.warnings, gate.calm, gate.nodes) == ([], [], Calm([], []), {old})
    conditions = proof(step, gate, 0.1)
    assert new in conditions["nodes"]
    assert conditions["edges"] == [
        {"publisher": new, "topic": "/temperature", "subscriber": "/listener", "peer": "subscriber"}
    ]
    rated = [topic for topic in conditions["topics"] if topic.get("min_rate")]
    assert [(topic["publisher"], topic["min_rate"]) for topic in rated] == [(new, 450.0)]
    assert {"name": "/calibrate"} in conditions["services"]
    assert conditions["absent"] == list(step.old_nodes.values())
    back = proof_of_old(step, gate)  # the same under the old names
    assert (back["nodes"], [edge["publisher"] for edge in back["edges"]], back["absent"]) == ([old], [old], [])
    assert [(topic["publisher"], topic.get("min_rate")) for topic in back["topics"]] == [(old, None)]


def test_a_node_that_has_the_new_name_already_forbids_the_step() -> None:
    step = sensor_step()
    (new,) = step.new_nodes.values()
    graph = graph_of(step)
    graph["nodes"][new] = node(uri="http://10.42.0.9:1/")
    (problem,) = gate_of(step, graph, Live()).problems
    assert new in problem
    assert "http://10.42.0.9:1/" in problem
    graph["nodes"][new]["reachable"] = False  # a stale registration holds no name
    assert gate_of(step, graph, Live()).problems == []


def test_own_and_named_actions_must_rest_where_they_are_served() -> None:
    idle = {"idle": ["/move_base", "/gone", "/dock"]}
    step = step_of(*versions(app("planner", pattern="action", readiness={"actions": ["plan"]}, update=idle)))
    actions = {
        "/plan": served("/planner"),
        "/move_base": served("/base"),
        "/gone": served("/ghost"),
        "/dock": served("/planner"),
        "/other": served("/base"),
    }
    graph = graph_of(step, actions=actions)
    graph["nodes"]["/ghost"] = node(reachable=False, refused=True)
    assert gate_of(step, graph, Live()).calm.actions == [
        {"name": "/dock", "server": "/planner"},
        {"name": "/plan", "server": "/planner"},
        {"name": "/move_base"},
    ]


def served(server: str, **more: Any) -> dict[str, Any]:
    return {"up": True, "servers": [server], "goals": {}, **more}


def launch_step() -> Step:
    return step_of(*versions(app("nav", pattern="action", readiness={"nodes": False})))


def pod(name: str, address: str) -> dict[str, Any]:
    return {"metadata": {"namespace": "robot-robot1", "labels": {names.LABEL_APP: name}}, "status": {"podIP": address}}


def launch_graph() -> dict[str, Any]:
    """A launch file's two nodes, and another pod's."""
    graph = graph_of(sensor_step(), actions={"/move_base": served("/move_base")})
    graph["nodes"]["/move_base"] = node(uri="http://10.42.0.8:4001/")
    graph["nodes"]["/amcl"] = node(uri="http://10.42.0.8:4002/")
    graph["nodes"]["/rostopic_12_1700000000000"] = node(uri="http://10.42.0.8:4003/")
    return graph


def test_what_a_launch_file_started_is_found_by_its_pods_address() -> None:
    """It is waited for, its goals are held, and every node of it has to come back, for as long as the app may take."""
    step, pods = launch_step(), [pod("nav", "10.42.0.8"), pod("sensor", "10.42.0.7")]
    gate = gate_of(step, launch_graph(), Live(pods=pods))
    assert gate.calm.actions == [{"name": "/move_base", "server": "/move_base"}]
    assert proof(step, gate, 0.1)["nodes"] == ["/amcl", "/move_base"]
    assert proof_of_old(step, gate)["nodes"] == ["/amcl", "/move_base"]
    assert gate.contracts["nav"].nodes == ("/amcl", "/move_base")  # which the pod's own probe looks for, too
    assert (step.patience, sensor_step().patience) == (60.0, 0.0)
    host_network = [pod("nav", "10.42.0.8"), pod("sensor", "10.42.0.8")]
    assert gate_of(step, launch_graph(), Live(pods=host_network)).calm.actions == []  # the host's address tells nothing


def test_contract_and_way_back_are_applied_before_the_new_version() -> None:
    earlier = [entry(robot(app("sensor", *image)), "sensor") for image in [(), *((f"x.org/a:{n}",) for n in range(9))]]
    step = step_of(robot(app("sensor")), robot(app("sensor", "x.org/a:2")), update_map("sensor", earlier))
    objects = step_objects(step, gate_of(step, graph_of(step), Live()).contracts, 0.1, 180.0, 1000.0)
    assert [item["metadata"]["name"] for item in objects] == ["sensor-update", "sensor"]
    contract = json.loads(objects[0]["data"]["contract.json"])
    assert contract["revision"] == step.after["sensor"]["revision"]
    assert (contract["ready_timeout"], contract["apps"]) == (180.0, ["sensor"])
    assert "until" not in contract  # a version that nobody proved is no better for waiting
    assert contract["tolerance"] == 0.1
    assert [sent["rate"] for sent in contract["topics"]["/temperature"]["publishers"].values()] == [500.0]
    kept, *others = json.loads(objects[0]["data"]["history.json"])
    assert len(others) == HISTORY_KEPT - 1 == 4
    assert kept["revision"] not in [one["revision"] for one in others]  # each once
    assert kept["deployment"] == step.previous["sensor"]
    assert kept["image"] == "example.org/app:1.0"
    notes = objects[-1]["metadata"]["annotations"]
    assert notes[words.UPDATING] == f"1000 {revision_of(objects[-1])}"
    assert "image ros-app image=example.org/app:1.0" in notes[BACK_TO].split("\n")


def test_the_masters_contract_is_everything_that_is_registered() -> None:
    before, after = (robot(app("sensor"), master={"image": f"x.org/ros:{number}"}) for number in (1, 2))
    _keeper, step = planned(after, applied(before)).steps
    objects = [(item["kind"], item["metadata"]["name"]) for item in step_objects(step, {}, 0.1, 180.0, 1000.0)]
    assert objects == [("ConfigMap", "ros-master-update"), ("Deployment", "ros-master"), ("Service", "ros-master")]
    other = sensor_step()
    gate = gate_of(step, graph_of(other), Live())
    conditions = proof(step, gate, 0.1)
    assert step.kind == "master"
    assert sorted(conditions["nodes"]) == sorted(["/listener", *other.old_nodes.values()])
    assert len(conditions["edges"]) == 1
    assert conditions["absent"] == []


def test_check_mode_is_told_what_the_step_would_allow() -> None:
    """And a way back after it holds the old version to its old names."""
    step = sensor_step(update={"ignore": ["/debug"], "renamed": {"/temperature": "/temp"}})
    gate = gate_of(step, graph_of(step), Live())
    assert gate.allowed == ["/temperature has to be /temp then"]
    assert [topic["name"] for topic in proof(step, gate, 0.1)["topics"]] == ["/temp"]
    assert [topic["name"] for topic in proof_of_old(step, gate)["topics"]] == ["/temperature"]


def test_rates_that_were_measured_one_after_the_other_are_all_known() -> None:
    step = sensor_step()
    (old,) = step.old_nodes.values()
    graph = graph_of(step)
    later = {
        "/temperature": {"rates": {"/other": 20.0}, "unsteady": {"/third": 5.0, old: 499.0}, "latched": ["/other"]},
        "/new": {"rates": {"/other": 1.0}},
    }
    found = with_rates(graph_from(graph), graph_from({"topics": later}))
    whole = graph_data(graph_from(graph))["topics"]["/temperature"]
    assert graph_data(found)["topics"] == {
        "/temperature": {
            **whole,
            "rates": {old: 500.0, "/other": 20.0},
            "unsteady": {"/third": 5.0},
            "latched": ["/other"],
        }
    }


def test_a_step_that_the_graph_says_nothing_of_proves_nothing_but_its_pod() -> None:
    step = launch_step()
    assert proves_nothing(proof(step, gate_of(step, {}, Live()), 0.1))
    named = sensor_step()
    assert not proves_nothing(proof(named, gate_of(named, {}, Live()), 0.1))


@pytest.mark.parametrize(("states", "dead"), [([], True), (["waiting"], True), (["waiting", "running"], False)])
def test_a_version_is_dead_when_none_of_its_containers_runs(states: list[str], dead: bool) -> None:
    step = sensor_step()
    labels = {names.LABEL_APP: "sensor", names.LABEL_REVISION: step.after["sensor"]["revision"]}
    old = {**labels, names.LABEL_REVISION: step.before["sensor"]["revision"]}
    new = {"metadata": {"labels": labels}, "status": {"containerStatuses": [{"state": {one: {}}} for one in states]}}
    other = {"metadata": {"labels": old}, "status": {"containerStatuses": [{"state": {"running": {}}}]}}
    assert is_dead(step, [other, new]) == dead
    assert is_dead(step, [{"metadata": {"labels": labels}}])


# --- launch files whose versions overlap ----------------------------------------------------------------------------


LAUNCH = {"package": "nav", "file": "nav.launch", "replace": ["move_base"]}


def overlapping(launch: dict[str, Any]) -> Step:
    return step_of(*versions(app("nav", launch=launch)))


def overlapping_graph(step: Step) -> dict[str, Any]:
    """Two nodes of the launch file with their revision, one of them an action's server; and another pod's."""
    old = step.launched["nav"].old
    server, amcl = f"/move_base{old}", f"/amcl{old}"
    graph = graph_of(sensor_step(), actions={"/move_base": served(server)})
    graph["nodes"][server] = node(uri="http://10.42.0.8:4001/")
    graph["nodes"][amcl] = node(uri="http://10.42.0.8:4002/")
    graph["topics"]["/amcl/pose"] = {
        "type": "x/Pose", "md5sum": "", "publishers": [amcl], "subscribers": ["/listener"],
        "connections": [{"publisher": amcl, "subscriber": "/listener"}],
    }  # fmt: skip
    return graph


def test_the_nodes_of_a_launch_file_are_promised_under_their_next_names() -> None:
    """What is held back is nothing that the pod's own probe may wait for."""
    step = overlapping(LAUNCH)
    launch = step.launched["nav"]
    gate = gate_of(step, overlapping_graph(step), Live(pods=[pod("nav", "10.42.0.8")]))
    assert gate.problems == []
    assert gate.calm.actions == [{"name": "/move_base", "server": f"/move_base{launch.old}"}]
    contract = gate.contracts["nav"]
    assert contract.nodes == (f"/amcl{launch.new}",)
    assert contract.topics["/amcl/pose"].publishers == {f"/amcl{launch.new}": Sent()}
    assert contract.edges == ((f"/amcl{launch.new}", "/amcl/pose", "/listener"),)
    assert contract.others is not None
    assert contract.others.nodes == (f"/move_base{launch.new}",)
    assert contract.others.actions == ("/move_base",)
    wanted = proof(step, gate, 0.1)
    assert set(wanted["nodes"]) == {f"/amcl{launch.new}", f"/move_base{launch.new}"}
    assert wanted["absent"] == [f"/amcl{launch.old}", f"/move_base{launch.old}"]
    before = proof_of_old(step, gate)
    assert set(before["nodes"]) == {f"/amcl{launch.old}", f"/move_base{launch.old}"}
    assert [topic["name"] for topic in before["topics"]] == ["/amcl/pose"]
    assert gate.allowed[-1] == (
        f"/move_base{launch.old} is away from its end until its next version has begun: it is in launch.replace of nav"
    )


def test_a_node_of_which_two_must_not_be_there_is_refused_with_what_to_write() -> None:
    words = (
        "/move_base{} serves the action /move_base, of which two servers lose goals: list /move_base in launch.replace "
        "of nav, or in launch.overlap if two of it do no harm"
    )
    alone = {**LAUNCH, "replace": []}
    for launch, forbidden in ((alone, True), ({**alone, "overlap": ["move_base"]}, False)):
        step = overlapping(launch)
        gate = gate_of(step, overlapping_graph(step), Live(pods=[pod("nav", "10.42.0.8")]))
        assert gate.problems == ([words.format(step.launched["nav"].old)] if forbidden else [])


def test_what_clients_ask_for_is_held_against_no_version_of_a_launch_file() -> None:
    """Nor that one of them steers the robot through it."""
    step = overlapping({"package": "rosbridge_server", "file": "rosbridge_websocket.launch"})
    graph = overlapping_graph(step)
    graph["topics"]["/cmd_vel"] = {
        "type": "geometry_msgs/Twist", "md5sum": "", "publishers": [f"/amcl{step.launched['nav'].old}"],
        "subscribers": ["/listener"], "connections": [],
    }  # fmt: skip
    gate = gate_of(step, graph, Live(pods=[pod("nav", "10.42.0.8")]))
    assert gate.problems == []
    contract = gate.contracts["nav"]
    assert len(contract.nodes) == 2
    assert not (contract.topics or contract.subscriptions or contract.services or contract.actions or contract.edges)


def test_a_pod_that_has_only_just_started_is_no_reason_to_ask_nothing_of_the_next_version() -> None:
    """What it is to the graph stands in the contract of its last step, under the names of that one."""
    step = overlapping(LAUNCH)
    launch = step.launched["nav"]
    gate = gate_of(step, overlapping_graph(step), Live(pods=[pod("nav", "10.42.0.8")]))
    earlier = json.loads(json.dumps(gate.contracts["nav"].as_dict()).replace(launch.new, launch.old))
    kept = update_map("nav", [])
    kept["data"]["contract.json"] = json.dumps(
        {**earlier, "revision": step.before["nav"]["revision"], "apps": ["nav"], "soak": 120.0, "ends": 1}
    )
    again = gate_of(step, {}, Live(maps=[kept], pods=[pod("nav", "10.42.0.8")]))
    was, now = gate.contracts["nav"], again.contracts["nav"]
    assert (now.nodes, now.topics, now.edges) == (was.nodes, was.topics, was.edges)
    assert again.succession.nodes == gate.succession.nodes
    # that it is watched is said of the version before: a pod that read it of itself would not be held to anything
    record, *_rest = step_objects(step, again.contracts, 0.1, 180.0, 1000.0)
    assert (record_of(record).soak, record_of(record).contract.nodes) == (0.0, was.nodes)
    assert proof_of_old(step, again) == proof_of_old(step, gate)


def test_a_way_back_to_another_handoff_owes_private_names_where_they_always_were() -> None:
    before, after = app("nav", "x.org/a:1", launch=LAUNCH), app("nav", "x.org/a:2", launch=LAUNCH, pattern=None)
    step = step_of(robot(before), robot(after))
    assert step.launched["nav"].new == ""
    gate = gate_of(step, overlapping_graph(step), Live(pods=[pod("nav", "10.42.0.8")]))
    assert set(gate.contracts["nav"].topics) == {"/amcl/pose"}
    wanted = proof_of_old(step, gate)
    assert [topic["name"] for topic in wanted["topics"]] == ["/amcl/pose"]
    assert [edge["publisher"] for edge in wanted["edges"]] == [f"/amcl{step.launched['nav'].old}"]


def test_a_node_of_an_app_without_a_name_of_its_own_is_warned_of() -> None:
    """A tool that somebody has open elsewhere is not."""
    graph = launch_graph()
    graph["nodes"]["/rviz_1_1700000000000"] = node(uri="http://10.42.0.99:1/")
    found = gate_of(launch_step(), graph, Live(pods=[pod("nav", "10.42.0.8")])).warnings
    (line,) = [one for one in found if "anonymous" in one]
    assert line.startswith("/rostopic_12_1700000000000 of nav has an anonymous name")
