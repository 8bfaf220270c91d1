# SPDX-License-Identifier: GPL-3.0-or-later
"""Rates and conditions against real ROS nodes on loopback: Debian's rosmaster, rospy and roscpp."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from ansible_collections.rosops.fleet.plugins.module_utils._common.poll import Seen, poll
from ansible_collections.rosops.fleet.plugins.module_utils._ros.backend import everything
from ansible_collections.rosops.fleet.plugins.module_utils._ros.client import Ros1Client
from ansible_collections.rosops.fleet.plugins.module_utils._ros.conditions import conditions_from
from ansible_collections.rosops.fleet.plugins.module_utils._ros.gate import Look, look
from ansible_collections.rosops.fleet.plugins.module_utils._ros.jobs import INFO_ARGS, read
from ansible_collections.rosops.fleet.plugins.module_utils._ros.listener import Listener
from scene import Scene, until

RELAY = Path("/usr/lib/topic_tools/relay")
LONG = 5.0  # seconds in which a node that is kept waiting for half a second does not change its rate by a fifth

pytestmark = pytest.mark.skipif(not RELAY.exists(), reason="Debian's topic-tools is not installed")


class GraphScene(Scene):
    def __init__(self, directory: Path) -> None:
        super().__init__(directory)
        self.client = Ros1Client(self.uri, 3.0)

    def relay(self, name: str, topic: str, to: str) -> None:
        """A roscpp node."""
        self._start(name, str(RELAY), topic, to, f"__name:={name}")

    def read(self, **params: Any) -> dict[str, Any]:
        return read(self.client, {**{name: spec.get("default") for name, spec in INFO_ARGS.items()}, **params})

    def wait(self, wanted: dict[str, Any], timeout: float) -> Look:
        asked = conditions_from(wanted)
        ears = Listener(self.client, asked.values).checks

        def probe() -> Seen:
            seen = look(self.client, asked, ears=ears)
            return Seen(seen.verdict, seen)

        found: Look = poll(probe, timeout, 0.2).last
        return found


@pytest.fixture
def scene(tmp_path: Path) -> Iterator[GraphScene]:
    made = GraphScene(tmp_path)
    try:
        made.start_master()
        yield made
    finally:
        made.end()


def edge(publisher: str, topic: str, subscriber: str) -> dict[str, str]:
    return {"publisher": publisher, "topic": topic, "subscriber": subscriber}


def test_rates_by_counters_of_both_libraries(scene: GraphScene) -> None:
    scene.start("chatter", "/talker", "100")
    scene.start("chatter", "/other", "40")
    scene.start("server", "/worker")
    scene.until_published("/chatter", "/talker", "/other")
    scene.start("hearer", "/listener", "/chatter")
    scene.relay("relay", "/chatter", "/relayed")
    scene.until_published("/relayed", "/relay")
    scene.relay("second", "/relayed", "/twice_relayed")
    heard = [edge(name, "/chatter", to) for name in ("/talker", "/other") for to in ("/listener", "/relay")]
    heard.append(edge("/relay", "/relayed", "/second"))
    up = scene.wait({"edges": heard, "actions": [{"name": "/work"}], "services": [{"name": "/trigger"}]}, 60)
    assert up.unmet == []
    topics = scene.read(rates=True, rate_source="counters", rate_seconds=LONG)["topics"]
    assert topics["/chatter"]["rate"] == pytest.approx(140, rel=0.2)
    assert topics["/relayed"]["rate"] == pytest.approx(140, rel=0.2)  # by roscpp
    for unheard in ("/twice_relayed", "/config", "/talker/debug"):
        assert (topics[unheard]["rate"], topics[unheard]["rate_error"]) == (None, "")


def test_a_look_wakes_no_camera_and_a_latched_message_is_no_rate(scene: GraphScene) -> None:
    scene.start("camera", "/camera")
    scene.until_published("/chatter", "/camera")
    scene.start("hearer", "/listener", "/chatter")
    assert scene.wait({"edges": [edge("/camera", "/chatter", "/listener")]}, 60).unmet == []

    def woken() -> bool:
        return bool(scene.client.rates(scene.client.ask(state, everything(state)), {"/woken": 1.0})["/woken"].messages)

    state = scene.client.state()
    scene.read(rates=True, rate_source="counters")
    assert not woken()
    asked = {"rates": True, "rate_seconds": LONG, "rate_nodes": ["/camera"], "md5sums": True}
    # of what comes unevenly, as on a busy machine, no rate is told
    rates = until("its rate", lambda: scene.read(**asked)["topics"]["/chatter"]["rates"], 180)
    assert not woken()
    assert rates == {"/camera": pytest.approx(20, rel=0.2)}
    config = scene.read(rates=True, rate_topics=["/config"])["topics"]["/config"]
    assert (config["rate"], config["rates"], config["latched"]) == (None, {}, ["/camera"])
    assert scene.read(rates=True, rate_topics=["/image/compressed"])["topics"]["/woken"]
    until("what proves that it would have said so", woken)


def test_what_messages_say_by_nodes_that_are_not_told_of_us(scene: GraphScene) -> None:
    scene.start("robot", "/robot", "0.5")
    scene.until_published("/speed", "/robot")
    scene.relay("relay", "/speed", "/relayed")  # a roscpp publisher
    values = [
        {"topic": "/battery", "field": "data", "above": 0.4},
        {"topic": "/battery", "field": "data", "equals": 0.75},
        {"topic": "/speed", "field": "layout.dim[0].label", "equals": "m/s"},
        {"topic": "/relayed", "field": "data[1]", "above": 0.4, "below": 0.6},
        {"topic": "/joy", "quiet": 0.5},
    ]
    assert scene.wait({"values": values}, 60).unmet == []
    before = scene.client.state()
    still = [{"topic": topic, "field": "data", "still": 1.0} for topic in ("/speed", "/relayed")]
    moves = scene.wait({"values": still}, 3)
    assert [check.name for check in moves.unmet] == ["/speed data still for 1 s", "/relayed data still for 1 s"]
    assert scene.client.state() == before  # nobody is registered who was not
    fails = scene.wait({"values": [{"topic": "/speed", "field": "speed", "above": 0.0}]}, 10)
    assert (fails.verdict, len(fails.unmet)) == ("fail", 1)

    scene.stop("/robot")
    scene.start("robot", "/robot", "0.0")
    quiet = {"topic": "/alive", "field": "frame_id", "quiet": 1.0}  # stamps are no movement
    assert scene.wait({"values": [*still, quiet]}, 60).unmet == []
