# SPDX-License-Identifier: GPL-3.0-or-later
"""What a step registers again, against a real master and real nodes."""

from __future__ import annotations

import signal
from typing import Any

from ansible_collections.rosops.fleet.plugins.module_utils._ros.registrar import register
from ansible_collections.rosops.fleet.plugins.modules import ros_graph_info
from scene import Run, Scene, until


def brings_back(scene: Scene, graph: dict[str, Any], *nodes: str) -> bool:
    return bool(register({"master_uri": scene.uri, "graph": graph, "nodes": nodes})["changed"])


def test_present_gives_a_service_back_to_the_provider_that_survived(scene: Scene, run: Run) -> None:
    """The roll-back: the new version has taken the service over, and is about to go."""
    scene.start_master()
    scene.start("service", "/old")
    until("the old one", lambda: scene.registered()["/old"].services.get("/trigger"))
    graph = run(ros_graph_info)["graph"]
    scene.start("service", "/new")
    until("the new one", lambda: scene.registered()["/new"].services.get("/trigger"))
    assert "/trigger" not in scene.registered()["/old"].services

    assert brings_back(scene, graph, "/old", "/never")
    assert scene.registered()["/old"].services.get("/trigger")
    assert not brings_back(scene, graph, "/old", "/never")
    scene.start("caller", "/caller")
    until("answers", lambda: len(scene.log("/caller")) > 10)
    scene.kill("/new", signal.SIGTERM)
    count = len(scene.log("/caller"))
    until("more answers", lambda: len(scene.log("/caller")) > count + 20)
    assert {(line["ok"], line.get("answer")) for line in scene.log("/caller")} == {(True, "/old")}
