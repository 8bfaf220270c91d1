# SPDX-License-Identifier: GPL-3.0-or-later
"""The module ros_registrations against a real master and real nodes."""

from __future__ import annotations

import signal

from ansible_collections.rosops.fleet.plugins.modules import ros_graph_info, ros_registrations
from scene import Run, Scene, until


def test_present_after_a_restart_of_the_master(scene: Scene, run: Run) -> None:
    scene.start_master()
    for kind, name in (("talker", "/talker"), ("listener", "/listener"), ("service", "/adder")):
        scene.start(kind, name)
    until("messages", lambda: scene.log("/listener")[-1]["count"] > 100)
    until("the service", lambda: scene.log("/adder"))
    graph = run(ros_graph_info)["graph"]
    before = scene.registered()
    scene.kill("master")
    scene.kill("/adder")
    scene.start_master()

    wanted = {"graph": graph}
    predicted = run(ros_registrations, **wanted, _ansible_check_mode=True, _ansible_diff=True)
    assert scene.registered() == {}  # check mode wrote nothing
    done = run(ros_registrations, **wanted, _ansible_diff=True)
    assert {key: done[key] for key in predicted} == predicted
    del before["/adder"]
    assert scene.registered() == before
    assert [entry["node"] for entry in done["skipped"]] == ["/adder"]
    assert set(done["diff"]["after"]) == {"/talker", "/listener"}
    again = run(ros_registrations, **wanted)
    assert (again["changed"], again["restored"]) == (False, [])
    count = scene.log("/listener")[-1]["count"]
    until("more messages", lambda: scene.log("/listener")[-1]["count"] > count + 500)
    assert scene.log("/listener")[-1]["lost"] == 0


def test_present_gives_a_service_back_to_the_provider_that_survived(scene: Scene, run: Run) -> None:
    """The roll-back: the new version has taken the service over, and is about to go."""
    scene.start_master()
    scene.start("service", "/old")
    until("the old one", lambda: scene.registered()["/old"].services.get("/trigger"))
    graph = run(ros_graph_info)["graph"]
    scene.start("service", "/new")
    until("the new one", lambda: scene.registered()["/new"].services.get("/trigger"))
    assert "/trigger" not in scene.registered()["/old"].services

    wanted = {"graph": graph, "nodes": ["/old", "/never"]}
    done = run(ros_registrations, **wanted)
    assert done["restored"] == [{"node": "/old", "kind": "service", "name": "/trigger"}]
    assert done["skipped"] == [{"node": "/never", "reason": "it is not in the graph"}]
    assert run(ros_registrations, **wanted)["changed"] is False
    scene.start("caller", "/caller")
    until("answers", lambda: len(scene.log("/caller")) > 10)
    scene.kill("/new", signal.SIGTERM)
    count = len(scene.log("/caller"))
    until("more answers", lambda: len(scene.log("/caller")) > count + 20)
    assert {(line["ok"], line.get("answer")) for line in scene.log("/caller")} == {(True, "/old")}
