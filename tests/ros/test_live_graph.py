# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Contract, conditions and socket tables against real ROS nodes on loopback: Debian's rosmaster, rospy and roscpp."""

from __future__ import annotations

import os
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

CHECKOUT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(CHECKOUT / ".ansible" / "collections"))

from ansible_collections.rosops.fleet.plugins.module_utils._common.poll import Seen, poll  # noqa: E402
from ansible_collections.rosops.fleet.plugins.module_utils._ros.client import Ros1Client  # noqa: E402
from ansible_collections.rosops.fleet.plugins.module_utils._ros.conditions import conditions_from  # noqa: E402
from ansible_collections.rosops.fleet.plugins.module_utils._ros.contract import conditions, record  # noqa: E402
from ansible_collections.rosops.fleet.plugins.module_utils._ros.gate import Look, look  # noqa: E402
from ansible_collections.rosops.fleet.plugins.module_utils._ros.graph import everything  # noqa: E402
from ansible_collections.rosops.fleet.plugins.module_utils._ros.listener import Listener  # noqa: E402
from ansible_collections.rosops.fleet.plugins.modules.ros_graph_info import INFO_ARGS, read  # noqa: E402

PYTHON, MASTER, RELAY = "/usr/bin/python3", Path("/usr/bin/rosmaster"), Path("/usr/lib/topic_tools/relay")
NODES = Path(__file__).with_name("graph_nodes.py")
STRING_MD5 = "992ce8a1687cec8c8bd883ec73ca41d1"  # of std_msgs/String, whoever computes it


def lacking() -> str:
    imports = [PYTHON, "-c", "import rospy, actionlib, rosmaster"]
    if not MASTER.exists() or subprocess.run(imports, capture_output=True, check=False).returncode:  # noqa: S603
        return "Debian's python3-rosmaster, python3-rospy and python3-actionlib are not installed"
    return "" if RELAY.exists() else "Debian's topic-tools is not installed"


pytestmark = pytest.mark.skipif(bool(lacking()), reason=lacking() or "all there")


class Scene:
    """A master and nodes on loopback, ended together."""

    def __init__(self, home: Path) -> None:
        with socket.socket() as free:
            free.bind(("127.0.0.1", 0))
            port = free.getsockname()[1]
        self.home, self.uri = home, f"http://127.0.0.1:{port}/"
        self.processes: dict[str, subprocess.Popen[bytes]] = {}
        self.run("master", str(MASTER), "--core", "-p", str(port), "-t", "2", "-w", "16")
        self.ros = Ros1Client(self.uri, 3.0)
        self.until(lambda: bool(self.read()["nodes"] is not None), "the master")

    def run(self, name: str, *command: str) -> None:
        env = {**os.environ, "ROS_MASTER_URI": self.uri, "ROS_IP": "127.0.0.1", "ROS_LOG_DIR": str(self.home)}
        env.pop("PYTHONPATH", None)
        self.processes[name] = subprocess.Popen(  # noqa: S603 - our own command lines
            command, env=env, cwd=self.home, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
        )

    def node(self, kind: str, name: str, *more: str) -> None:
        self.run(f"/{name}", PYTHON, str(NODES), kind, name, *more)

    def stop(self, name: str, kill: bool = False) -> None:
        process = self.processes.pop(name)
        (process.kill if kill else process.terminate)()
        process.wait(20)

    def read(self, **params: Any) -> dict[str, Any]:
        return read(self.ros, {**{name: spec.get("default") for name, spec in INFO_ARGS.items()}, **params})

    def wait(self, wanted: dict[str, Any], timeout: float = 20, stable: float = 0.0) -> Look:
        asked = conditions_from(wanted)
        ears = Listener(self.ros, asked.values)

        def probe() -> Seen:
            seen = look(self.ros, asked, ears=ears)
            return Seen(seen.verdict, seen)

        found: Look = poll(probe, timeout, 0.2, stable=stable).last
        return found

    def until(self, true: Callable[[], bool], what: str, seconds: float = 30) -> None:
        end = time.monotonic() + seconds
        while True:
            try:
                if true():
                    return
            except Exception:
                if time.monotonic() > end:
                    raise
            assert time.monotonic() < end, f"{what} did not come"
            time.sleep(0.1)

    def end(self) -> None:
        for process in self.processes.values():
            process.kill()
            process.wait()


@pytest.fixture
def scene(tmp_path: Path) -> Iterator[Scene]:
    made = Scene(tmp_path)
    yield made
    made.end()


def edge(publisher: str, topic: str, subscriber: str, **more: str) -> dict[str, str]:
    return {"publisher": publisher, "topic": topic, "subscriber": subscriber, **more}


def start(scene: Scene) -> None:
    scene.node("talker", "talker_old", "100")
    scene.node("talker", "other", "40")
    scene.node("listener", "listener")
    scene.node("listener", "rostopic_123_1700000000000")
    scene.node("server", "worker")
    scene.run("/relay", str(RELAY), "/chatter", "/relayed", "__name:=relay")
    heard = [edge(name, "/chatter", to) for name in ("/talker_old", "/other") for to in ("/listener", "/relay")]
    up = scene.wait({"edges": heard, "actions": [{"name": "/work"}], "services": [{"name": "/trigger"}]}, 60)
    assert up.unmet == []


def test_an_update_of_a_publisher(scene: Scene) -> None:
    start(scene)
    graph = scene.read(rates=True, md5sums=True)
    chatter = graph["topics"]["/chatter"]
    assert chatter["rates"] == {"/talker_old": pytest.approx(100, rel=0.2), "/other": pytest.approx(40, rel=0.2)}
    assert chatter["rate"] == pytest.approx(140, rel=0.2)
    assert (chatter["md5sum"], graph["topics"]["/relayed"]["md5sum"]) == (STRING_MD5, STRING_MD5)  # rospy and roscpp
    assert graph["services"]["/trigger"]["md5sum"] == "937c9679a518e3a18d831e57125ea522"
    only = scene.read(rates=True, rate_topics=["/relayed"], rate_seconds=0.5)["topics"]
    assert [name for name, topic in only.items() if topic["rate"] is not None] == ["/relayed"]

    contract = record(graph, ["/talker_old"], {"/talker_old": "/talker_new"})
    assert contract["edges"] == [["/talker_new", "/chatter", "/listener"], ["/talker_new", "/chatter", "/relay"]]
    assert set(contract["topics"]) == {"/chatter", "/config", "/talker_new/debug"}
    assert contract["topics"]["/config"]["rate"] is None
    assert set(contract["services"]) <= {"/trigger"}

    # the new one at half the rate, beside the other: the sum would hide it
    wanted = conditions(contract, absent=["/talker_old"])
    scene.node("talker", "talker_new", "50")
    scene.stop("/talker_old")
    slow = scene.wait(wanted, 4)
    assert {(check.kind, check.name) for check in slow.unmet} == {("rate", "/chatter"), ("rate", "/talker_new/debug")}
    scene.stop("/talker_new")
    scene.node("talker", "talker_new", "100")
    assert scene.wait(wanted, 20, stable=2).unmet == []

    # a peer that was killed is not the update's fault; asked for without that leave, it is missing
    scene.stop("/listener", kill=True)
    lost = "/talker_new -> /chatter -> /listener"

    def reason() -> str:
        seen = scene.wait(wanted, 5)
        assert seen.unmet == []
        return next(check.reason for check in seen.checks if check.name == lost)

    scene.until(lambda: "nothing listens at" in reason(), "the end of the connection")
    assert scene.wait({"edges": [edge("/talker_new", "/chatter", "/listener")]}, 0).unmet
    assert scene.wait({"topics": [{"name": "/chatter", "connected": True}]}, 0).unmet == []  # of those that live


def test_rates_by_counters_of_both_libraries(scene: Scene) -> None:
    start(scene)
    scene.run("/second", str(RELAY), "/relayed", "/twice_relayed", "__name:=second")
    assert scene.wait({"edges": [edge("/relay", "/relayed", "/second")]}, 30).unmet == []
    topics = scene.read(rates=True, rate_source="counters", rate_seconds=3.0)["topics"]
    assert topics["/chatter"]["rate"] == pytest.approx(140, rel=0.2)
    assert topics["/relayed"]["rate"] == pytest.approx(140, rel=0.2)  # by roscpp
    for unheard in ("/twice_relayed", "/config", "/talker_old/debug"):
        assert (topics[unheard]["rate"], topics[unheard]["rate_error"]) == (None, "")


def test_a_look_wakes_no_camera_and_a_latched_message_is_no_rate(scene: Scene) -> None:
    scene.node("camera", "camera")
    scene.node("listener", "listener")
    assert scene.wait({"edges": [edge("/camera", "/chatter", "/listener")]}, 60).unmet == []

    def woken() -> bool:
        return bool(scene.ros.rates(scene.ros.ask(state, everything(state)), {"/woken": 0.3})["/woken"].messages)

    state = scene.ros.state()
    for asked in ({"rate_source": "counters", "rate_seconds": 0.5}, {"rate_nodes": ["/camera"], "md5sums": True}):
        graph = scene.read(rates=True, **asked)
        assert not woken()
    assert graph["topics"]["/chatter"]["rates"] == {"/camera": pytest.approx(20, rel=0.2)}
    config = scene.read(rates=True, rate_topics=["/config"], rate_seconds=0.5)["topics"]["/config"]
    assert (config["rate"], config["rates"], config["latched"]) == (None, {}, ["/camera"])
    assert scene.read(rates=True, rate_topics=["/image/compressed"], rate_seconds=0.5)["topics"]["/woken"]
    assert woken()  # which proves that it would have said so


def test_persistent_service_connections_are_told_from_calls_and_from_topics(scene: Scene) -> None:
    scene.node("talker", "adder", "20")
    for number in range(3):  # topic connections at the very port that serves the service
        scene.node("listener", f"listener_{number}")
    heard = [edge("/adder", "/chatter", f"/listener_{number}") for number in range(3)]
    assert scene.wait({"edges": heard, "services": [{"name": "/trigger"}]}, 60).unmet == []

    def seen() -> Any:
        return scene.read(service_connections=True)["services"]["/trigger"]["connections"]

    assert seen() == 0
    scene.node("plain", "plain_caller")
    scene.until(lambda: "/plain_caller" in scene.read()["nodes"], "the caller")
    assert [seen() for _look in range(3)] == [0, 0, 0]  # it calls all the time
    scene.node("persistent", "persistent_caller")
    scene.until(lambda: bool(seen() == 1), "its connection")
    scene.stop("/persistent_caller", kill=True)
    scene.until(lambda: bool(seen() == 0), "its end")
    assert scene.read()["services"]["/trigger"]["connections"] is None


def test_what_messages_say_by_nodes_that_are_not_told_of_us(scene: Scene) -> None:
    scene.node("robot", "robot", "0.5")
    scene.run("/relay", str(RELAY), "/speed", "/relayed", "__name:=relay")  # a roscpp publisher
    values = [
        {"topic": "/battery", "field": "data", "above": 0.4},
        {"topic": "/battery", "field": "data", "equals": 0.75},
        {"topic": "/speed", "field": "layout.dim[0].label", "equals": "m/s"},
        {"topic": "/relayed", "field": "data[1]", "above": 0.4, "below": 0.6},
        {"topic": "/joy", "quiet": 0.5},
    ]
    assert scene.wait({"values": values}, 60).unmet == []
    before = scene.ros.state()
    still = [{"topic": topic, "field": "data", "still": 1.0} for topic in ("/speed", "/relayed")]
    moves = scene.wait({"values": still}, 3)
    assert [check.name for check in moves.unmet] == ["/speed data still for 1 s", "/relayed data still for 1 s"]
    assert scene.ros.state() == before  # nobody is registered who was not
    fails = scene.wait({"values": [{"topic": "/speed", "field": "speed", "above": 0.0}]}, 10)
    assert (fails.verdict, len(fails.unmet)) == ("fail", 1)

    scene.stop("/robot")
    scene.node("robot", "robot", "0.0")
    quiet = {"topic": "/alive", "field": "frame_id", "quiet": 1.0}  # stamps are no movement
    assert scene.wait({"values": [*still, quiet]}, 60).unmet == []
