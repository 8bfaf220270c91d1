# SPDX-License-Identifier: GPL-3.0-or-later
"""A recorded graph and its stand-ins: played on a master of its own it is the same graph, and it serves real nodes."""

from __future__ import annotations

import json
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
from ansible_collections.rosops.fleet.plugins.module_utils._rehearsal import stand_in
from ansible_collections.rosops.fleet.plugins.module_utils._ros.client import Ros1Client
from ansible_collections.rosops.fleet.plugins.module_utils._ros.jobs import INFO_ARGS, read
from ansible_collections.rosops.fleet.plugins.module_utils._ros.traffic import Watcher
from ansible_collections.rosops.fleet.plugins.plugin_utils._rehearsal.recording import (
    KIND,
    OTHERS,
    VERSION,
    Node,
    parts,
)
from scene import PYTHON, Scene, until

RELAY = Path("/usr/lib/topic_tools/relay")
ALL = ("/hearer", "/listener", "/robot", "/talker", "/worker")
EDGES = (("/chatter", "/talker", "/listener"), ("/work/status", "/worker", "/hearer"))
HZ = 100.0
WINDOW = 5.0  # s in which the publishers count
SHARE = 0.2  # by which two counts of a busy machine differ
ASKED = {"rates": True, "rate_source": "counters", "md5sums": True, "definitions": True}

pytestmark = pytest.mark.skipif(not RELAY.exists(), reason="Debian's topic-tools is not installed")

Nodes = dict[str, Node]


class Stage(Scene):
    """A master on which nodes or their stand-ins play."""

    def nodes(self) -> None:
        self.start("chatter", "/talker", str(HZ))
        self.start("server", "/worker")
        self.start("robot", "/robot", "0.5")
        self.until_published("/chatter", "/talker")
        self.until_published("/work/status", "/worker")
        self.start("hearer", "/listener", "/chatter")
        self._start("/hearer", str(RELAY), "/work/status", "/heard", "__name:=hearer")

    def play(self, recorded: Nodes, *names: str) -> None:
        path = self.directory / "plan.json"
        path.write_text(json.dumps({"nodes": [recorded[name] for name in names]}), "utf-8")
        self._start("stand-in", PYTHON, stand_in.__file__, str(path))

    def graph(self, seconds: float = 0.1) -> dict[str, Any]:
        params = {name: one.get("default") for name, one in INFO_ARGS.items()}
        return read(Ros1Client(self.uri, 3.0), {**params, **ASKED, "rate_seconds": seconds})

    def edges(self) -> set[tuple[str, str, str]]:
        topics = self.graph()["topics"].items()
        return {(name, one["publisher"], one["subscriber"]) for name, topic in topics for one in topic["connections"]}

    def recorded(self) -> Nodes:
        """What is there, once all of it is; with counted rates. As a file says it."""

        def whole() -> bool:
            graph = self.graph()
            return set(ALL) <= set(graph["nodes"]) and "/work" in graph["actions"] and set(EDGES) <= self.edges()

        until("the whole graph", whole, 60)
        kept = json.dumps({"kind": KIND, "version": VERSION, "apps": [], "graph": self.graph(WINDOW)})
        return {node["name"]: node for node in parts(json.loads(kept), "the file")[OTHERS].nodes}


@contextmanager
def staged(directory: Path) -> Iterator[Stage]:
    made = Stage(directory)
    made.start_master()
    try:
        yield made
    finally:
        made.end()


@pytest.fixture(scope="module")
def real(tmp_path_factory: pytest.TempPathFactory) -> Nodes:
    """Of a robot."""
    with staged(tmp_path_factory.mktemp("robot")) as robot:
        robot.nodes()
        return robot.recorded()


@pytest.fixture
def scene(tmp_path: Path) -> Iterator[Stage]:
    """Where they are played."""
    with staged(tmp_path) as stage:
        yield stage


def rates(nodes: Nodes) -> dict[str, float]:
    return {topic["name"]: topic["rate"] for node in nodes.values() for topic in node["publishes"] if topic["rate"]}


def without_rates(nodes: Nodes) -> Nodes:
    return {
        name: {
            **node,
            "publishes": [{**one, "rate": 0.0, "definition": one["definition"].strip()} for one in node["publishes"]],
        }
        for name, node in nodes.items()
    }


def test_what_is_played_is_what_was_recorded(real: Nodes, scene: Stage) -> None:
    assert set(real) == set(ALL)
    scene.play(real, *real)
    played = scene.recorded()
    assert without_rates(played) == without_rates(real)
    assert rates(real)["/chatter"] == pytest.approx(HZ, rel=SHARE)
    assert rates(played) == pytest.approx(rates(real), rel=2 * SHARE)
    assert scene.stop("stand-in") == 0
    until("an empty graph", lambda: not set(ALL) & set(scene.graph()["nodes"]))


def test_stand_ins_among_real_nodes(real: Nodes, scene: Stage) -> None:
    """A real subscriber reads what they send, and who listens from the outside counts what a real publisher sends."""
    scene.play(real, "/talker", "/hearer")
    scene.until_published("/config", "/talker")
    scene.start("docked", "/reader", "/config")
    said = until("a latched message", lambda: [line for line in scene.log("/reader") if "heard" in line])
    assert [(line["heard"], line["by"]) for line in said] == [("", "/talker")]
    scene.start("server", "/worker")
    watcher = Watcher(Ros1Client(scene.uri, 3.0))

    def heard() -> Any:
        watcher.look()
        status = watcher.result([])["topics"].get("/work/status", {"messages": 0})
        return status if status["messages"] > 3 else None

    status = until("messages", heard)
    # it latches, so its numbers count what others got, too
    assert (status["numbered"], status["missing"], status["unconnected_looks"]) == (False, None, {"/hearer": 0})
