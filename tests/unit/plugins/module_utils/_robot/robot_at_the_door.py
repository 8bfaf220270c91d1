# SPDX-License-Identifier: GPL-3.0-or-later
"""A robot with two apps, its cluster and its keeper's door, by a clock of its own; and `rosops-may` in front of it."""

from __future__ import annotations

import importlib.machinery
import importlib.util
import json
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest
from ansible_collections.rosops.fleet.plugins.module_utils._common.errors import RosError
from ansible_collections.rosops.fleet.plugins.module_utils._common.poll import PASS, WAIT
from ansible_collections.rosops.fleet.plugins.module_utils._robot.door import Door
from ansible_collections.rosops.fleet.plugins.module_utils._robot.holds import Holds
from ansible_collections.rosops.fleet.plugins.module_utils._robot.memory import Silence
from ansible_collections.rosops.fleet.plugins.module_utils._robot.step_watch import LOOK, Robot, StepWatch
from ansible_collections.rosops.fleet.plugins.module_utils._ros import idle_robot
from ansible_collections.rosops.fleet.plugins.module_utils._ros.backend import MasterState, Questions
from ansible_collections.rosops.fleet.plugins.module_utils._ros.checks import Check
from ansible_collections.rosops.fleet.plugins.module_utils._ros.conditions import ValueCondition
from ansible_collections.rosops.fleet.plugins.module_utils._ros.graph import Action, Graph, Node, StatusReading
from ansible_collections.rosops.fleet.plugins.module_utils._ros.raw_node import Asked
from ansible_collections.rosops.fleet.plugins.plugin_utils._objects.pod_settings import rest_maps
from ansible_collections.rosops.fleet.tests.unit.plugins.module_utils._robot.steps_left import Api, live, pod, version
from ansible_collections.rosops.fleet.tests.unit.robots import robot

CHECKOUT = Path(__file__).resolve().parents[5]
FILE = CHECKOUT / "playbooks" / "files" / "rosops-may"
SPACE, OWNER = "robot-robot1", "rosops-may/"
SERVERS = {"/arm/move": "/arm", "/base/drive": "/base"}
# 2026-07-01 00:00 in Berlin, a Wednesday
MIDNIGHT = 1782856800.0
INVENTORY = robot(
    {"name": "arm", "image": "a:1", "pattern": "action", "update": {"when": [{"topic": "/dock", "quiet": 3.0}]}},
    {"name": "base", "image": "b:1", "pattern": "action"},
    update_when=[{"topic": "/battery", "field": "percentage", "above": 0.4}],
    update_windows=[{"from": "00:00", "to": "06:00"}],
    update_timezone="Europe/Berlin",
)
VALUES = {"/battery": True, "/dock": True}
OTHERS = "host 7, process 11 (aa)"


def rosops_may() -> ModuleType:
    """The command as a module."""
    loader = importlib.machinery.SourceFileLoader("rosops_may", str(FILE))
    spec = importlib.util.spec_from_loader("rosops_may", loader)
    assert spec
    made = importlib.util.module_from_spec(spec)
    loader.exec_module(made)
    return made


class Ears:
    """What a Listener hears of this world."""

    open = 0

    def __init__(self, world: World, wanted: Iterable[ValueCondition]) -> None:
        self.world, self.wanted, self.since = world, [*wanted], world.at
        Ears.open += 1

    def checks(self, _graph: Graph) -> list[Check]:
        heard = self.world.at - self.since
        return [
            Check("value", str(one), PASS if self.world.values[one.topic] and heard >= one.seconds else WAIT, "not so")
            for one in self.wanted
        ]

    def close(self) -> None:
        Ears.open -= 1


class World(Api):
    """Stands for the keeper's cluster, its graph, its calls and its files."""

    timeout, caller, uri = 2.0, "/ros_keeper", "http://master:11311"

    def __init__(self) -> None:
        super().__init__(SPACE)
        self.at, self.begin = 5000.0, MIDNIGHT + 3600.0
        self.master_away, self.whole_since = False, 0.0  # the time since when it has all that the one before had
        self.maps = {(SPACE, item["metadata"]["name"]): item for item in rest_maps(INVENTORY)}
        for app in ("arm", "base"):
            self.there[SPACE, app] = live(version(app, 2, SPACE, f"/{app}"), marked=False, ready=True)
        self.servers = dict(SERVERS)
        self.goals: dict[str, int] = {}  # action -> how many are under way
        self.waiting: dict[str, int] = {}  # that are held
        self.held_until: dict[str, float] = {}
        self.values = dict(VALUES)
        self.sleeps: Callable[[], None] = lambda: None
        self.looks = self.at
        self.start()

    def start(self) -> None:
        """The keeper, anew."""
        self.holds = Holds(self, self, self, self, lambda: self.at, self.wall)  # type: ignore[arg-type]
        robot = Robot(lambda *_: [1, "", 0], lambda _: [1, "", 0], lambda _: None, Silence, self.holds.watch)
        self.watch = StepWatch(self, self, robot, self, lambda _: None, lambda: self.at, self.sleep)  # type: ignore[arg-type]
        self.door = Door(self.holds, self.watch.left_over, lambda since: since >= self.whole_since, self.sleep)

    # ---- time

    def wall(self) -> float:
        return self.begin + self.at

    def sleep(self, seconds: float) -> None:
        self.run(seconds)
        self.sleeps()

    def run(self, seconds: float) -> None:
        """Time passes, and the keeper looks every ten seconds."""
        end = self.at + seconds
        while self.looks <= end:
            self.at = max(self.at, self.looks)
            self.watch.look()
            self.looks += LOOK
        self.at = max(self.at, end)
        self.pass_on()

    # ---- the cluster

    def pods(self, _namespace: str) -> list[dict[str, Any]]:
        return [pod("arm", 2, "10.42.0.1"), pod("base", 2, "10.42.0.2")]

    def apply(self, *_: Any) -> None:
        raise AssertionError("nobody changes anything here")

    @property
    def holder(self) -> str:
        return str((self.leases_now.get(SPACE) or {"spec": {}})["spec"].get("holderIdentity", ""))

    # ---- the graph

    def state(self, types: bool = False) -> MasterState:  # noqa: ARG002 - nobody wants them
        if self.master_away:
            raise RosError("the ROS master does not answer")
        ends = {f"{action}/{part}": (node,) for action, node in self.servers.items() for part in ("goal", "cancel")}
        status = {f"{action}/status": (node,) for action, node in self.servers.items()}
        return MasterState({**status, "/rosout": ("/rqt_gui_1", "/ros_keeper")}, ends)

    def ask(self, state: MasterState, wanted: Questions) -> Graph:
        found = state.graph.answered(
            Node(name, f"http://10.42.0.{3 + 'ab'.find(name[1])}:1/", 7, True) for name in wanted.nodes
        )

        def told(name: str) -> Action:
            action, reading = found.action(name), StatusReading(((1,) * self.goals.get(name, 0),) * 2)
            return replace(action, statuses=dict.fromkeys(action.servers, reading))

        return replace(found, actions={**found.actions, **{name: told(name) for name in wanted.actions}})

    def addresses(self, names: Iterable[str]) -> tuple[dict[str, str], dict[str, str]]:
        return {name: f"http://{name[1:]}:1/" for name in names}, {}

    # ---- goals, and the keeper's calls

    def goal(self, action: str) -> None:
        """A client sends one."""
        self.pass_on()
        kind = self.waiting if action in self.held_until else self.goals
        kind[action] = kind.get(action, 0) + 1

    def pass_on(self) -> None:
        """What is held no longer goes to the server."""
        for action in [action for action, until in self.held_until.items() if until <= self.at]:
            self.let_go(action)

    def let_go(self, action: str) -> None:
        self.held_until.pop(action, None)
        self.goals[action] = self.goals.get(action, 0) + self.waiting.pop(action, 0)

    def hold(self, action: str, server: str, seconds: float) -> str:
        assert server == self.servers.get(action, server)
        self.held_until[action] = self.at + seconds
        return ""

    def release(self, action: str) -> str:
        self.let_go(action)
        return ""

    def held(self) -> dict[str, Any]:
        self.pass_on()
        return {action: {} for action in self.held_until}

    # ---- the API server, which leads to the door

    def send(self, method: str, path: str, body: dict[str, Any] | None) -> tuple[int, dict[str, Any]]:
        """What `rosops-may` sends."""
        if self.away:
            return 503, {"kind": "Status", "message": "the API server is away"}
        if "/proxy/" in path:
            url, _, query = path.partition("?")
            asked = dict(one.split("=") for one in query.split("&"))
            said = self.door.page(Asked(method, url.partition("/proxy")[2], asked))
            return said.status, json.loads(said.body)
        if method == "GET":
            found = self.leases_now.get(SPACE)
            return (200, found) if found else (404, {"kind": "Status"})
        assert body is not None
        assert (method == "PUT") == ("resourceVersion" in body["metadata"])
        written = self.write_lease(SPACE, body)
        return (200, written) if written else (409, {"kind": "Status", "message": "modified"})


@contextmanager
def at_the_door(patch: pytest.MonkeyPatch) -> Iterator[World]:
    """A world whose keeper hears what is so there."""
    world = World()
    patch.setattr(idle_robot, "Listener", Ears)
    patch.setattr(idle_robot, "tell_publishers", lambda *_: None)
    yield world
    assert Ears.open == 0, "a listener was left open"


def lease_of(holder: str, world: World, seconds: int = 15) -> Mapping[str, Any]:
    """Somebody else's, written now."""
    there = world.leases_now.get(SPACE, {"metadata": {"name": "robot-update"}})
    spec = {"holderIdentity": holder, "leaseDurationSeconds": seconds, "acquireTime": "before"}
    made = world.write_lease(SPACE, {"metadata": there["metadata"], "spec": spec})
    assert made
    return made
