# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""The keeper takes back what a run left that has gone: a simulated cluster, graph and clock."""

from __future__ import annotations

import json
from collections.abc import Iterable
from typing import Any

import pytest
from ansible_collections.rosops.fleet.plugins.module_utils._common.errors import KubeError, RosError
from ansible_collections.rosops.fleet.plugins.module_utils._pod.step_watch import LOOK, Robot, Staying, StepWatch
from ansible_collections.rosops.fleet.plugins.module_utils._ros.graph import (
    Action,
    Graph,
    MasterState,
    Node,
    Questions,
    StatusReading,
)
from ansible_collections.rosops.fleet.tests.unit.plugins.module_utils._pod.steps_left import (
    NAMESPACE,
    UPDATING,
    WENT_BACK,
    lease,
    left,
    live,
    version,
)

ACTIVE, SUCCEEDED = 1, 3
AWAY = KubeError("nothing listens")


class World:
    """A cluster and a ROS graph; whoever applies something finds it there, not ready yet."""

    def __init__(self, *namespaces: str) -> None:
        self.at = 5000.0
        self.spaces = list(namespaces or [NAMESPACE])
        self.there: dict[tuple[str, str], dict[str, Any]] = {}
        self.maps: dict[tuple[str, str], dict[str, Any]] = {}
        self.leases: dict[str, dict[str, Any]] = {}
        self.number = 10
        self.away = False
        self.requests: list[str] = []
        self.done: list[str] = []
        self.fails: dict[str, Any] = {}  # a Deployment's name -> called when it is applied
        # the graph
        self.state_now = MasterState()
        self.goals: dict[str, StatusReading] = {}
        self.refused: set[str] = set()
        self.master_away = False
        self.held: list[tuple[str, str]] = []
        self.on_hold: Any = lambda: None
        self.said: list[str] = []
        self.watch = self.start()

    def start(self) -> StepWatch:
        robot = Robot(self.hold, self.release, self.take_back)
        return StepWatch(self, self, robot, self.said.append, lambda: self.at, lambda: 0.0, lambda _seconds: None)  # type: ignore[arg-type]

    def put(self, deployment: dict[str, Any], record: dict[str, Any], namespace: str = NAMESPACE) -> None:
        name = deployment["metadata"]["name"]
        self.there[namespace, name], self.maps[namespace, name] = deployment, record

    def run(self, seconds: float) -> None:
        end = self.at + seconds
        while self.at < end:
            self.at += self.watch.look()

    def revision(self, name: str, namespace: str = NAMESPACE) -> str:
        template = self.there[namespace, name]["spec"]["template"]
        return str(template["metadata"]["labels"]["rosops.fleet/revision"])

    # ---- the API

    def _ask(self, what: str) -> None:
        self.requests.append(what)
        if self.away:
            raise AWAY

    def namespaces(self) -> list[str]:
        return self.spaces

    def lease(self, namespace: str) -> dict[str, Any] | None:
        self._ask("lease")
        return self.leases.get(namespace)

    def write_lease(self, namespace: str, body: dict[str, Any]) -> dict[str, Any] | None:
        self._ask("write lease")
        there = self.leases.get(namespace)
        if (there or {"metadata": {}})["metadata"].get("resourceVersion") != body["metadata"].get("resourceVersion"):
            return None
        self.number += 1
        body = {**body, "metadata": {**body["metadata"], "resourceVersion": str(self.number)}}
        self.leases[namespace] = body
        self.done.append(f"lease {body['spec']['holderIdentity'] or 'free'}")
        return body

    def deployments(self, namespace: str) -> list[dict[str, Any]]:
        self._ask("deployments")
        return [item for (space, _name), item in self.there.items() if space == namespace]

    def deployment(self, namespace: str, name: str) -> dict[str, Any] | None:
        self._ask("deployment")
        return self.there.get((namespace, name))

    def update_map(self, namespace: str, app: str) -> dict[str, Any] | None:
        self._ask("map")
        return self.maps.get((namespace, app))

    def apply(self, namespace: str, body: dict[str, Any]) -> None:
        self._ask("apply")
        name = body["metadata"]["name"]
        self.fails.pop(name, lambda: None)()
        generation = self.there[namespace, name]["metadata"]["generation"] + 1
        self.there[namespace, name] = live(body, marked=False, generation=generation)
        self.done.append(f"apply {name} {self.revision(name, namespace)}")

    # ---- the graph

    def state(self) -> MasterState:
        if self.master_away:
            raise RosError("the ROS master does not answer")
        return self.state_now

    def ask(self, state: MasterState, wanted: Questions) -> Graph:
        nodes = {name: Node(name, pid=None, refused=name in self.refused) for name in wanted.nodes}
        servers = {name: state.publishers[f"{name}/status"] for name in wanted.actions}
        found = {
            name: Action(
                name, statuses={one: self.goals.get(one, StatusReading(error="mute")) for one in servers[name]}
            )
            for name in wanted.actions
        }
        return Graph(nodes, {}, {}, found)

    def serve(self, action: str, *nodes: str) -> None:
        self.state_now = MasterState(
            {**self.state_now.publishers, f"{action}/status": nodes},
            {**self.state_now.subscribers, f"{action}/goal": nodes, f"{action}/cancel": nodes},
        )

    # ---- the keeper

    def hold(self, action: str, server: str, _seconds: float) -> list[Any]:
        self.held.append((action, server))
        self.on_hold()
        return [1, "", 0]

    def release(self, action: str) -> list[Any]:
        self.held = [one for one in self.held if one[0] != action]
        return [1, "", 0]

    def take_back(self, nodes: Iterable[str]) -> None:
        self.done.append(f"services of {', '.join(sorted(nodes)) or 'nobody'}")


def busy(*states: int) -> StatusReading:
    return StatusReading((states, states))


def left_alone(node: str | None = None, **contract: Any) -> World:
    """A world whose run has gone in the middle of a step that does not get ready."""
    world = World()
    world.put(live(version("camera", 2, node=node)), left(version("camera", 1, node=node), **contract))
    world.leases[NAMESPACE] = lease("host 77")
    return world


def test_a_version_that_does_not_get_ready_is_taken_back() -> None:
    world = left_alone(ready_timeout=120)
    world.run(130)  # 15 s for the Lease, which were 20
    assert world.revision("camera") == "rev2"
    world.run(40)
    assert world.done == [
        "lease ros-keeper",
        "lease ros-keeper",
        "services of /camera_1",
        "apply camera rev1",
        "lease free",
    ]
    there = world.there[NAMESPACE, "camera"]["metadata"]["annotations"]
    assert UPDATING not in there
    told = json.loads(there[WENT_BACK])
    assert (told["from"], told["to"], told["at"]) == ("rev2", "rev1", "1970-01-01T00:00:00.000000Z")
    assert told["reason"] == "not ready 120 s after the run that began it had gone"
    assert world.said == [f"{NAMESPACE}: camera was taken back: {told['reason']}"]
    world.run(3600)
    assert len(world.done) == 5  # and that was it


def test_without_a_word_about_it_a_version_has_three_minutes() -> None:
    world = left_alone()
    world.run(190)
    assert world.revision("camera") == "rev2"
    world.run(20)
    assert world.revision("camera") == "rev1"


def test_a_version_that_gets_ready_stays_for_the_next_run() -> None:
    world = left_alone()
    world.run(100)
    world.there[NAMESPACE, "camera"]["status"]["readyReplicas"] = 1
    world.run(3600)
    assert (world.revision("camera"), world.done) == ("rev2", [])
    assert UPDATING in world.there[NAMESPACE, "camera"]["metadata"]["annotations"]


def test_a_run_at_work_is_let_alone() -> None:
    world = left_alone(ready_timeout=30)
    for number in range(200):
        world.leases[NAMESPACE] = lease("host 77", number)
        world.run(10)
    assert world.done == []
    assert set(world.requests) == {"lease"}


def test_at_rest_a_look_is_one_small_request() -> None:
    world = World()
    world.put(live(version("camera", 2), marked=False, ready=True), left())
    world.run(10 * LOOK)
    assert world.requests.count("deployments") == 1
    assert len(world.requests) == 11
    world.leases[NAMESPACE] = lease("", 2)  # a run came and went
    world.run(10 * LOOK)
    assert world.requests.count("deployments") == 2


def test_an_api_that_is_away_is_weather() -> None:
    world = left_alone(ready_timeout=120)
    world.run(60)
    world.away = True
    world.run(600)
    asked = len(world.requests)
    assert asked < 80
    world.away = False
    world.run(80)
    assert world.revision("camera") == "rev2"
    world.run(60)
    assert world.revision("camera") == "rev1"
    assert world.said[:2] == [f"{NAMESPACE}: nothing listens", f"{NAMESPACE}: the Kubernetes API answers"]


def test_a_keeper_started_anew_begins_anew() -> None:
    world = left_alone(ready_timeout=120)
    world.run(130)
    world.watch = world.start()
    world.run(130)
    assert world.revision("camera") == "rev2"
    world.run(40)
    assert world.revision("camera") == "rev1"


def test_a_run_that_takes_the_lease_meanwhile_has_it() -> None:
    world = left_alone(ready_timeout=30)
    find = world.lease

    def taken(namespace: str) -> dict[str, Any] | None:
        found = find(namespace)
        world.number += 1
        world.leases[NAMESPACE] = lease("host 99", world.number)  # right after every look
        return found

    world.lease = taken  # type: ignore[method-assign]
    world.leases[NAMESPACE] = lease("")
    world.run(300)
    assert not [done for done in world.done if done.startswith("apply")]


def test_the_apps_of_a_step_go_back_together_though_the_api_goes_in_between() -> None:
    world = World()
    apps = {"apps": ["lidar", "camera"], "ready_timeout": 60}
    for app, ready in (("camera", True), ("lidar", False)):
        world.put(live(version(app, 2), ready=ready), left(version(app, 1), **apps))

    def goes() -> None:
        world.away = True
        raise AWAY

    world.fails["camera"] = goes
    world.run(100)
    assert (world.revision("lidar"), world.revision("camera")) == ("rev1", "rev2")
    world.away = False
    world.run(20)
    assert (world.revision("lidar"), world.revision("camera")) == ("rev1", "rev1")
    assert world.leases[NAMESPACE]["spec"]["holderIdentity"] == ""


# ---- goals


def drained(world: World) -> World:
    """The action's server has the same name in every version."""
    world.serve("/dock", "/camera")
    return world


def test_a_goal_on_the_new_node_is_waited_for() -> None:
    world = drained(left_alone(node="/camera", ready_timeout=60))
    world.goals["/camera"] = busy(ACTIVE)
    world.run(3600)
    assert world.done == []
    assert world.said == [f"{NAMESPACE}/camera: is taken back when it rests: /dock ACTIVE"]
    world.goals["/camera"] = busy(SUCCEEDED)
    world.run(20)
    assert world.revision("camera") == "rev1"
    assert world.held == [("/dock", "/camera")]  # goals that came meanwhile are for the old one


def test_a_goal_that_comes_just_then_is_waited_for_too() -> None:
    world = drained(left_alone(node="/camera", ready_timeout=60))
    world.goals["/camera"] = busy()

    def comes() -> None:
        world.goals["/camera"] = busy(ACTIVE)

    world.on_hold = comes
    world.run(200)
    assert [done for done in world.done if done.startswith("apply")] == []
    assert world.held == []
    assert world.leases[NAMESPACE]["spec"]["holderIdentity"] == ""


def test_a_dead_node_has_no_goals_and_one_that_cannot_be_read_keeps_nobody_waiting_for_ever() -> None:
    dead = drained(left_alone(node="/camera", ready_timeout=60))
    dead.refused = {"/camera"}
    dead.run(100)
    assert dead.revision("camera") == "rev1"
    mute = drained(left_alone(node="/camera", ready_timeout=60))
    mute.run(130)
    assert mute.revision("camera") == "rev2"
    mute.run(30)
    assert mute.revision("camera") == "rev1"
    blind = left_alone(ready_timeout=60)
    blind.master_away = True
    blind.run(130)
    assert blind.revision("camera") == "rev2"
    blind.run(30)
    assert blind.revision("camera") == "rev1"


def test_the_old_nodes_goals_are_its_own() -> None:
    """Overlapping: the old one works on, and is not touched."""
    world = left_alone(ready_timeout=60)
    world.serve("/dock", "/camera_1", "/camera_2")
    world.goals = {"/camera_1": busy(ACTIVE), "/camera_2": busy()}
    world.run(100)
    assert (world.revision("camera"), world.held) == ("rev1", [])


def test_a_launch_files_goals_are_found_by_their_actions_name() -> None:
    world = left_alone(ready_timeout=60, actions=["/dock"])
    world.serve("/dock", "/move_base")
    world.goals["/move_base"] = busy(ACTIVE)
    world.run(300)
    assert world.done == []


def test_the_master_goes_back_without_a_graph() -> None:
    world = World()
    world.put(live(version("ros-master", 2, node="")), left(version("ros-master", 1, node=""), actions=["/dock"]))
    world.master_away = True
    world.run(200)
    assert world.revision("ros-master") == "rev1"


# ---- a shared master


def test_what_is_the_whole_fleets_waits_for_the_runs_on_all_robots() -> None:
    world = World("fleet", "robot-r1", "robot-r2")
    world.put(live(version("map", 2, "fleet")), left(version("map", 1, "fleet"), ready_timeout=60), "fleet")
    world.put(
        live(version("camera", 2, "robot-r2")), left(version("camera", 1, "robot-r2"), ready_timeout=60), "robot-r2"
    )
    for number in range(50):
        world.leases["robot-r1"] = lease("host 77", number)
        world.run(4)
    assert world.revision("map", "fleet") == "rev2"
    assert world.revision("camera", "robot-r2") == "rev1"
    world.run(120)
    assert world.revision("map", "fleet") == "rev1"


def test_a_hundred_robots_cost_a_request_a_second() -> None:
    world = World("fleet", *(f"robot-r{number}" for number in range(100)))
    world.run(1000)
    assert world.requests.count("lease") <= 1001
    assert world.requests.count("deployments") <= 103


def test_a_robot_whose_api_does_not_answer_is_said_once() -> None:
    world = World("fleet", "robot-r1")
    find = world.lease

    def refused(namespace: str) -> dict[str, Any] | None:
        if namespace == "robot-r1":
            raise KubeError("answered 403")
        return find(namespace)

    world.lease = refused  # type: ignore[method-assign]
    world.run(300)
    assert world.said == ["robot-r1: answered 403"]


# ---- whether a server stays


@pytest.mark.parametrize(
    ("deployment", "stays"),
    [
        (live(version("camera", 2, node="/camera")), False),
        (live(version("camera", 2, node="/camera"), ready=True), True),  # it kept its contract
        (live(version("camera", 2, node="/camera"), marked=False), True),  # started again, not replaced
        (live(version("other", 2)), True),  # nobody's that we know
    ],
)
def test_a_server_stays_unless_its_version_is_on_trial(deployment: dict[str, Any], stays: bool) -> None:
    world = World()
    world.put(deployment, left())
    assert Staying(world, lambda: world.at)("/dock", "/camera") is stays  # type: ignore[arg-type]


def test_a_launch_files_server_is_known_by_its_action() -> None:
    world = World()
    world.put(live(version("nav", 2, node="/nav")), left(actions=["/dock"]))
    stays = Staying(world, lambda: world.at)  # type: ignore[arg-type]
    assert not stays("/dock", "/move_base")
    world.there[NAMESPACE, "nav"]["status"]["readyReplicas"] = 1
    asked = len(world.requests)
    assert stays("/dock", "/move_base")
    assert world.requests[asked:] == ["deployment"]


def test_while_nobody_can_say_it_nobody_can_take_it_back_either() -> None:
    world = left_alone(node="/camera")
    world.away = True
    stays = Staying(world, lambda: world.at)  # type: ignore[arg-type]
    answers = []
    for _look in range(3):
        answers.append(stays("/dock", "/camera"))
        world.at += 5.0
    assert answers == [False, False, True]
    world.away = False
    assert not stays("/dock", "/camera")
