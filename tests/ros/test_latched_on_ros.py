# SPDX-License-Identifier: GPL-3.0-or-later
"""What a node latched when something happened, over its update: real nodes, the stop hook and the keeper."""

from __future__ import annotations

import signal
from typing import Any

import pytest
from ansible_collections.rosops.fleet.plugins.module_utils._ros import contract
from ansible_collections.rosops.fleet.plugins.module_utils._ros.client import Ros1Client
from ansible_collections.rosops.fleet.plugins.module_utils._ros.conditions import conditions_from
from ansible_collections.rosops.fleet.plugins.module_utils._ros.gate import look
from ansible_collections.rosops.fleet.plugins.module_utils._ros.graph import names_of
from ansible_collections.rosops.fleet.plugins.module_utils._ros.graph_json import graph_from
from ansible_collections.rosops.fleet.plugins.modules import ros_graph_info
from scene import Run, Scene, until

OLD, NEW, NEWER = "/dock_0000000a", "/dock_0000000b", "/dock_0000000c"


def begin(scene: Scene) -> None:
    scene.start_master()
    scene.start_keeper()


def start_dock(scene: Scene, name: str, value: str = "", latch: str = "yes") -> None:
    scene.start("dock", name, "/dock", value, latch)
    until(f"{name} to be there", lambda: scene.log(name) and name in scene.registered())


def latch(scene: Scene, name: str) -> None:
    scene.kill(name, signal.SIGUSR1)


def heard(scene: Scene, name: str) -> list[Any]:
    return [line["heard"] for line in scene.log(name) if "heard" in line]


def subscribe(scene: Scene, name: str) -> None:
    scene.start("docked", name)
    until(f"{name} to be there", lambda: scene.log(name))


def publishers(scene: Scene) -> tuple[str, ...]:
    return scene.ros.state().publishers.get("/dock", ())


@pytest.mark.parametrize("names", [(OLD, NEW), ("/dock", "/dock")], ids=["overlap", "replace"])
def test_a_value_that_was_latched_on_an_event_survives_an_update(scene: Scene, names: tuple[str, str]) -> None:
    old, new = names
    begin(scene)
    start_dock(scene, old, "at the charger")
    latch(scene, old)
    subscribe(scene, "/early")
    until("the value", lambda: heard(scene, "/early") == ["at the charger"])
    if old != new:
        start_dock(scene, new, "on the way")
    assert scene.run_stop_hook(old) == ""
    if old == new:
        start_dock(scene, new, "on the way")
    until("the keeper to give it", lambda: "/ros_keeper" in publishers(scene), 10)

    subscribe(scene, "/late")
    scene.start("looker", "/looker")
    until("the value for who comes later", lambda: heard(scene, "/late") == ["at the charger"])
    assert scene.log("/late")[-1]["by"] == "/ros_keeper"
    until("the value for who looks again and again", lambda: len(heard(scene, "/looker")) >= 3)
    scene.kill("/looker")

    latch(scene, new)
    until("the new value", lambda: heard(scene, "/late") == ["at the charger", "on the way"])
    until("the keeper to let the old one go", lambda: "/ros_keeper" not in publishers(scene))
    subscribe(scene, "/later")
    until("the new value alone", lambda: heard(scene, "/later") == ["on the way"])
    assert heard(scene, "/early") == ["at the charger", "on the way"]  # who had it did not get it again
    assert heard(scene, "/late") == ["at the charger", "on the way"]


def test_it_survives_versions_and_a_restart_of_the_keeper(scene: Scene) -> None:
    """Of two versions in a row nothing happened to the second one; what was kept waits for the third."""
    begin(scene)
    start_dock(scene, OLD, "at the charger")
    latch(scene, OLD)
    subscribe(scene, "/early")
    until("the value", lambda: heard(scene, "/early"))
    start_dock(scene, NEW)
    assert scene.run_stop_hook(OLD) == ""
    until("the keeper to give it", lambda: "/ros_keeper" in publishers(scene), 10)
    assert scene.run_stop_hook(NEW) == ""
    until("nothing to be given while nobody is in its place", lambda: not publishers(scene))
    scene.kill("keeper")
    scene.start_keeper()
    assert "still keeps" in scene.said()
    start_dock(scene, NEWER, "on the way")
    until("the keeper to give it", lambda: "/ros_keeper" in publishers(scene), 10)
    subscribe(scene, "/late")
    until("the value", lambda: heard(scene, "/late") == ["at the charger"])
    assert heard(scene, "/early") == ["at the charger"]
    scene.kill("master")
    until("the keeper to see it", lambda: "the master is away" in scene.said())
    scene.start_master()
    until("the keeper to give it again", lambda: len(publishers(scene)) == 2, 15)
    subscribe(scene, "/last")
    until("the value", lambda: heard(scene, "/last") == ["at the charger"])
    latch(scene, NEWER)
    until("the keeper to let it go", lambda: publishers(scene) == (NEWER,))
    assert list((scene.directory / "record" / "latched").iterdir()) == []


def test_a_version_that_does_not_latch_what_the_one_before_did_is_refused(scene: Scene, run: Run) -> None:
    """The keeper, which latches in its place, makes it no better, and is no publisher that a readiness asks for."""
    begin(scene)
    start_dock(scene, OLD, "at the charger")
    latch(scene, OLD)
    recorded = graph_from(run(ros_graph_info, md5sums=True)["graph"])
    assert names_of(recorded.topics["/dock"].latched) == [OLD]
    start_dock(scene, NEW, latch="no")
    assert scene.run_stop_hook(OLD) == ""
    until("the keeper to give it", lambda: "/ros_keeper" in publishers(scene), 10)
    start_dock(scene, NEWER)

    def seen(new: str, **more: Any) -> tuple[str, list[str]]:
        owed = contract.conditions(contract.record(recorded, [OLD], {OLD: new}))
        found = look(Ros1Client(scene.uri), conditions_from({**owed, **more}))
        return found.verdict, [check.reason for check in found.unmet]

    assert seen(NEW) == ("fail", [f"{NEW} publishes it without latching"])
    assert seen(NEWER) == ("pass", [])
    assert seen(NEWER, topics=[{"name": "/dock", "publishers": 2, "type": "std_msgs/String"}]) == ("pass", [])
    verdict, (reason,) = seen(NEWER, topics=[{"name": "/dock", "publishers": 3}])
    assert (verdict, reason) == ("wait", "2 publishers of at least 3")
    again = graph_from(run(ros_graph_info, md5sums=True)["graph"])
    assert contract.record(again, [NEWER]).topics.keys() == contract.record(recorded, [OLD]).topics.keys()
