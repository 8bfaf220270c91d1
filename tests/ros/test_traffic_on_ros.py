# SPDX-License-Identifier: GPL-3.0-or-later
"""The account of an update's traffic, kept beside real nodes that are replaced: well, and not so well."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from ansible_collections.rosops.fleet.plugins.module_utils._ros.backend import everything
from ansible_collections.rosops.fleet.plugins.module_utils._ros.client import Ros1Client
from ansible_collections.rosops.fleet.plugins.module_utils._ros.traffic import Topic, Watcher
from scene import Scene, until

OLD, NEW = "/source_00000001", "/source_00000002"


class TrafficScene(Scene):
    def __init__(self, directory: Path) -> None:
        super().__init__(directory)
        self.watcher, self.before = Watcher(Ros1Client(self.uri, 3.0)), dict[int, int]()

    def look_until(self, what: str, true: Any) -> None:
        until(what, lambda: self.watcher.look() or true())

    def heard(self, publishers: int) -> int:
        """How many messages came since that many have been connected to."""
        topic = self.watcher.traffic.topics.get("/points", Topic())
        if topic.publishers != publishers:
            return 0
        return topic.messages - self.before.setdefault(publishers, topic.messages)

    def connected(self) -> set[str]:
        client = Ros1Client(self.uri, 3.0)
        state = client.state()
        topic = client.ask(state, everything(state)).topics.get("/points")
        return {publisher.name for publisher, _subscriber in topic.connections} if topic else set()


@pytest.fixture
def scene(tmp_path: Path) -> Iterator[TrafficScene]:
    made = TrafficScene(tmp_path)
    made.start_master()
    made.start("hearer", "/sink_0000000a", "/points", "actionlib_msgs/GoalStatusArray")
    made.until_registered("/sink_0000000a")
    made.start("points", OLD)
    made.look_until("messages of the old source", lambda: made.heard(1) > 20)
    yield made
    made.end()


def test_a_source_that_is_replaced_while_it_still_sends(scene: TrafficScene) -> None:
    scene.start("points", NEW)
    scene.look_until("messages of both", lambda: scene.heard(2) > 40)
    until("the new one has its listener", lambda: NEW in scene.connected())
    scene.stop(OLD)
    scene.look_until("the old one's end", lambda: scene.connected() == {NEW})
    result = scene.watcher.result([])
    assert result["problems"] == [], result
    points = result["topics"]["/points"]
    assert (points["numbered"], points["missing"], points["publishers"]) == (True, 0, 2)


def test_a_source_that_ends_before_the_next_one_begins(scene: TrafficScene) -> None:
    scene.stop(OLD)
    scene.look_until("a look at nobody", lambda: scene.connected() == set())
    scene.watcher.look()
    scene.start("points", NEW)
    scene.look_until("messages of the new one", lambda: scene.heard(2) > 20)
    result = scene.watcher.result([])
    assert len(result["problems"]) == 1, result
    [problem] = result["problems"]
    assert problem.startswith("/points: /sink was not connected in ")
    assert scene.watcher.result(["/points"])["problems"] == []
