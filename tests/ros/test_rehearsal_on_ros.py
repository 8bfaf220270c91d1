# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""A recorded graph and its stand-ins: played on a master of its own it is the same graph, and it serves real nodes."""

from __future__ import annotations

import json
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
from ansible_collections.rosops.fleet.plugins.module_utils._pod import stand_in
from ansible_collections.rosops.fleet.plugins.module_utils._ros.client import Ros1Client
from ansible_collections.rosops.fleet.plugins.module_utils._ros.recording import Recording
from ansible_collections.rosops.fleet.plugins.modules.ros_graph_record import read
from ansible_collections.rosops.fleet.plugins.plugin_utils._rehearsal.stand_ins import plan
from scene import PYTHON, Scene, until

RELAY = Path("/usr/lib/topic_tools/relay")
NODES = Path(__file__).with_name("graph_nodes.py")
ALL = ("/hearer", "/listener", "/robot", "/talker", "/worker")
EDGES = (("/chatter", "/talker", "/listener"), ("/work/status", "/worker", "/hearer"))
HZ = 100.0
WINDOW = 5.0  # s in which the publishers count
SHARE = 0.2  # by which two counts of a busy machine differ

pytestmark = pytest.mark.skipif(not RELAY.exists(), reason="Debian's topic-tools is not installed")


class Stage(Scene):
    """A master on which nodes or their stand-ins play."""

    def node(self, kind: str, *more: str) -> None:
        self._start(f"/{kind}", PYTHON, str(NODES), kind, kind if kind != "server" else "worker", *more)

    def nodes(self) -> None:
        self.node("talker", str(HZ))
        self.node("listener")
        self.node("server")
        self.node("robot", "0.5")
        self._start("/hearer", str(RELAY), "/work/status", "/heard", "__name:=hearer")

    def play(self, recording: Recording, *nodes: str, asks: tuple[str, ...] = ()) -> None:
        path = self.directory / "plan.json"
        path.write_text(json.dumps(plan(recording, nodes, asks).as_dict()), "utf-8")
        self._start("stand-in", PYTHON, stand_in.__file__, str(path))

    def record(self, seconds: float = 0.1) -> Recording:
        params = {"robot": "robot1", "apps": [], "rate_seconds": seconds, "values": []}
        return read(Ros1Client(self.uri, 3.0), params)

    def account(self, node: str) -> dict[str, Any]:
        [found] = self.ros.calls([("getParam", "/tester", f"{stand_in.ACCOUNTS}{node}")])
        return json.loads(found) if isinstance(found, str) else {}

    def stop(self, name: str) -> int:
        process = self.processes.pop(name)
        process.terminate()
        return process.wait(20)


@contextmanager
def staged(directory: Path) -> Iterator[Stage]:
    made = Stage(directory)
    made.start_master()
    try:
        yield made
    finally:
        made.end()


@pytest.fixture(scope="module")
def real(tmp_path_factory: pytest.TempPathFactory) -> Recording:
    """Of a robot's nodes."""
    with staged(tmp_path_factory.mktemp("robot")) as robot:
        robot.nodes()
        return recorded(robot)


@pytest.fixture
def scene(tmp_path: Path) -> Iterator[Stage]:
    """Where they are played."""
    with staged(tmp_path) as stage:
        yield stage


def is_whole(recording: Recording) -> bool:
    edges = all((ends[0], ends[1]) in recording.topics[topic].edges for topic, *ends in EDGES)
    return edges and recording.others == ALL and "/work" in recording.actions


def recorded(stage: Stage) -> Recording:
    """What is there, once all of it is; with counted rates."""
    until("the whole graph", lambda: is_whole(stage.record()), 60)
    return stage.record(WINDOW)


def without_counts(recording: Recording) -> dict[str, Any]:
    """Everything but how much was sent, and the parameters, among which accounts are."""
    data = recording.as_dict()
    for topic in data["topics"].values():
        for sent in topic["publishers"].values():
            del sent["rate"]
    return {key: value for key, value in data.items() if key != "parameters"}


def rates(recording: Recording) -> dict[tuple[str, str], float]:
    return {
        (name, node): sent.rate
        for name, topic in recording.topics.items()
        for node, sent in topic.publishers.items()
        if sent.rate
    }


def test_what_is_played_is_what_was_recorded(real: Recording, scene: Stage) -> None:
    kept = Recording.from_dict(json.loads(json.dumps(real.as_dict())), "the file")
    assert kept == real
    scene.play(kept, *kept.others)
    played = recorded(scene)
    assert without_counts(played) == without_counts(real)
    assert rates(real)["/chatter", "/talker"] == pytest.approx(HZ, rel=SHARE)
    assert set(rates(real)) == {("/chatter", "/talker"), ("/work/status", "/worker")}
    assert rates(played) == pytest.approx(rates(real), rel=2 * SHARE)
    account = until("an account", lambda: scene.account("/hearer"))["/work/status"]
    assert (account["messages"] > 0, account["missing"], account["publishers"]) == (True, 0, ["/worker"])
    assert scene.stop("stand-in") == 0
    until("an empty graph", lambda: scene.record().others == ())


def test_stand_ins_among_real_nodes(real: Recording, scene: Stage) -> None:
    """A real subscriber can read what they send, and they keep account of what a real publisher sends."""
    scene.play(real, "/talker", "/hearer")
    scene.start("docked", "/reader", "/config")
    said = until("a latched message", lambda: [line for line in scene.log("/reader") if "heard" in line])
    assert [(line["heard"], line["by"]) for line in said] == [("", "/talker")]
    scene.node("server")

    def heard(more: int = 0) -> Any:
        account = scene.account("/hearer").get("/work/status", {"messages": 0})
        return account if account["messages"] > more else None

    before = until("messages", heard)
    scene.stop("/server")
    scene.node("server")
    account = until("messages of the next version", lambda: heard(before["messages"] + 10))
    assert (account["missing"], account["publishers"]) == (0, ["/worker"])
    assert max(seconds for _at, seconds in account["gaps"]) > 0.4  # there was nobody for as long as rospy starts


def test_a_service_that_goes_is_seen_by_who_greets_it(real: Recording, scene: Stage) -> None:
    scene.play(real, "/talker", asks=("/trigger", "/asked"))
    scene.start("service", "/real", "/asked")

    def counts(service: str) -> tuple[int, int]:
        told = scene.account("/talker")[service]
        return told["asked"] - told["refused"], told["refused"]

    until("answers of a real service", lambda: counts("/asked")[0] > 3)
    until("answers of a stand-in", lambda: counts("/trigger")[0] > 3)
    scene.kill("/real")
    before = counts("/asked")[1]
    until("refusals", lambda: counts("/asked")[1] > before + 3)
    answered = counts("/trigger")[0]
    until("answers of who is still there", lambda: counts("/trigger")[0] > answered)


def test_a_publisher_of_another_definition_is_not_taken(real: Recording, scene: Stage) -> None:
    scene.play(real, "/listener")
    scene.start("talker", "/talker", "/chatter", "UInt64")
    until("both", lambda: {"/listener", "/talker"} <= set(scene.record().others))
    until("a refusal", lambda: "do not match" in scene.said("talker"))
    assert scene.record().topics["/chatter"].edges == ()
    assert until("an account", lambda: scene.account("/listener"))["/chatter"]["messages"] == 0
