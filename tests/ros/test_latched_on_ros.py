# SPDX-License-Identifier: GPL-3.0-or-later
"""What a node latched when something happened, over its update: real nodes, the stop hook and the keeper."""

from __future__ import annotations

import signal
from typing import Any

import pytest
from scene import Scene, until

OLD, NEW = "/dock_0000000a", "/dock_0000000b"


def start_dock(scene: Scene, name: str, value: str = "") -> None:
    scene.start("dock", name, "/dock", value)
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
    scene.start_master()
    scene.start_keeper()
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
