# SPDX-License-Identifier: GPL-3.0-or-later
"""The keeper takes back what a run left that has gone: a simulated cluster, graph and clock."""

from __future__ import annotations

import json
from collections.abc import Iterable
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest
from ansible_collections.rosops.fleet.plugins.module_utils._common.errors import KubeError, RosError
from ansible_collections.rosops.fleet.plugins.module_utils._robot.cluster_api import ApiError
from ansible_collections.rosops.fleet.plugins.module_utils._robot.memory import KeptFiles, Silence
from ansible_collections.rosops.fleet.plugins.module_utils._robot.open_goals import Staying
from ansible_collections.rosops.fleet.plugins.module_utils._robot.step_watch import LOOK, Robot, StepWatch
from ansible_collections.rosops.fleet.plugins.module_utils._ros.backend import MasterState, Questions
from ansible_collections.rosops.fleet.plugins.module_utils._ros.graph import Graph, Node, StatusReading
from ansible_collections.rosops.fleet.plugins.module_utils._ros.graph_json import graph_from
from ansible_collections.rosops.fleet.plugins.module_utils._step.update_record import CUT_OFF
from ansible_collections.rosops.fleet.plugins.plugin_utils._report.kept import last_steps
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.outcome import StepResult, events_map
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.step import step_gate
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.world import Live
from ansible_collections.rosops.fleet.tests.unit.plugins.module_utils._robot.steps_left import (
    NAMESPACE,
    UPDATING,
    WENT_BACK,
    Api,
    lease,
    left,
    live,
    pod,
    version,
)
from ansible_collections.rosops.fleet.tests.unit.plugins.plugin_utils._update.test_step import launch_graph, launch_step
from ansible_collections.rosops.fleet.tests.unit.plugins.plugin_utils._update.test_step import pod as engine_pod

ACTIVE, SUCCEEDED = 1, 3
AWAY = KubeError("nothing listens")
HOURS = 4 * 3600.0  # longer than anything is waited for


class World(Api):
    """A cluster and a ROS graph; whoever applies something finds it there, not ready yet."""

    def __init__(self, *namespaces: str) -> None:
        super().__init__(*(namespaces or [NAMESPACE]))
        self.at = 5000.0
        self.fails: dict[str, Any] = {}  # a Deployment's name -> called when it is applied
        # the graph
        self.state_now = MasterState()
        self.goals: dict[str, StatusReading] = {}
        self.refused: set[str] = set()
        self.master_away = False
        self.held: list[tuple[str, str]] = []
        self.on_hold: Any = lambda: None
        self.said: list[str] = []
        self.refuses_holds = False
        self.pods_now: list[dict[str, Any]] = []
        self.uris: dict[str, str] = {}
        self.answering: set[str] = set()
        self.silence = Silence()
        self.unevictable: list[ApiError] = []  # what an eviction is answered with
        self.watch = self.start()

    def start(self) -> StepWatch:
        robot = Robot(self.hold, self.release, self.take_back, lambda: self.silence, lambda *_: None)
        return StepWatch(self, self, robot, self, self.said.append, lambda: self.at, self.sleep)  # type: ignore[arg-type]

    def sleep(self, seconds: float) -> None:
        self.at += seconds

    def put(self, deployment: dict[str, Any], record: dict[str, Any], namespace: str = NAMESPACE) -> None:
        name = deployment["metadata"]["name"]
        self.there[namespace, name], self.maps[namespace, name] = deployment, record

    def take(self, holder: str = "host 77", namespace: str = NAMESPACE) -> None:
        """Somebody takes the Lease, or renews it."""
        self.number += 1
        self.leases_now[namespace] = lease(holder, self.number)

    def run(self, seconds: float) -> None:
        end = self.at + seconds
        while self.at < end:
            self.watch.look()
            self.at += LOOK

    def revision(self, name: str, namespace: str = NAMESPACE) -> str:
        template = self.there[namespace, name]["spec"]["template"]
        return str(template["metadata"]["labels"]["rosops.fleet/revision"])

    # ---- the API

    def pods(self, _namespace: str) -> list[dict[str, Any]]:
        self._ask("pods")
        return self.pods_now

    def apply(self, namespace: str, body: dict[str, Any]) -> None:
        self._ask("apply")
        name = body["metadata"]["name"]
        if body["kind"] == "ConfigMap":
            if body["metadata"]["resourceVersion"] != self.maps[namespace, name]["metadata"]["resourceVersion"]:
                raise ApiError("it has been modified", 409)
            self.maps[namespace, name] = body
            return
        self.fails.pop(name, lambda: None)()
        generation = self.there[namespace, name]["metadata"]["generation"] + 1
        self.there[namespace, name] = live(body, marked=False, generation=generation)
        self.done.append(f"apply {name} {self.revision(name, namespace)}")

    def evict(self, namespace: str, item: dict[str, Any], seconds: int | None) -> None:
        self._ask("evict")
        for error in self.unevictable:
            raise error
        grace = "its own time" if seconds is None else f"{seconds} s"
        self.done.append(f"evict {namespace}/{item['metadata']['name']} in {grace}")

    def tell(self, namespace: str, item: dict[str, Any], reason: str, message: str) -> None:
        self._ask("tell")
        self.done.append(f"{reason} {namespace}/{item['metadata']['name']}: {message}")

    # ---- the graph

    def state(self) -> MasterState:
        if self.master_away:
            raise RosError("the ROS master does not answer")
        return self.state_now

    def ask(self, state: MasterState, wanted: Questions) -> Graph:
        pids = {name: 77 if name in self.answering else None for name in wanted.nodes}
        nodes = [Node(name, self.uris.get(name, ""), pid, refused=name in self.refused) for name, pid in pids.items()]
        found = state.graph.answered(nodes)
        statuses = {node.key: self.goals.get(node.name, StatusReading(error="mute")) for node in nodes}
        return replace(found, actions={name: replace(found.action(name), statuses=statuses) for name in wanted.actions})

    def serve(self, action: str, *nodes: str) -> None:
        self.state_now = MasterState(
            {**self.state_now.publishers, f"{action}/status": nodes},
            {**self.state_now.subscribers, f"{action}/goal": nodes, f"{action}/cancel": nodes},
        )

    # ---- the keeper

    def hold(self, action: str, server: str, _seconds: float) -> list[Any]:
        self.on_hold()
        if not self.refuses_holds:
            self.held.append((action, server))
        return [int(not self.refuses_holds), "", 0]

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
    world.leases_now[NAMESPACE] = lease("host 77")
    return world


def test_a_version_that_does_not_get_ready_is_taken_back() -> None:
    world = left_alone(ready_timeout=120)
    world.run(130)  # 15 s for the Lease, which were 20
    assert world.revision("camera") == "rev2"
    world.run(40)
    assert [done for done in world.done if done != "lease ros-keeper"] == [
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
    assert world.done[-1] == "lease free"  # and that was it


def test_a_run_at_work_is_let_alone() -> None:
    world = left_alone(ready_timeout=30)
    world.silence = Silence({"/camera_2": ("http://10.42.0.9:1/", 500.0)})
    for _time in range(200):
        world.take()
        world.run(10)
    assert world.done == []
    assert set(world.requests) == {"leases"}


def test_at_rest_a_look_is_one_small_request() -> None:
    world = World()
    world.put(live(version("camera", 2), marked=False, ready=True), left())
    world.run(10 * LOOK)
    assert world.requests.count("deployments") == 1
    assert len(world.requests) == 12  # and one look at the record of updates
    world.leases_now[NAMESPACE] = lease("", 2)  # a run came and went
    world.run(10 * LOOK)
    assert world.requests.count("deployments") == 2


def test_an_api_that_is_away_is_weather() -> None:
    world = left_alone(ready_timeout=120)
    world.run(60)
    asked, world.away = len(world.requests), True
    world.run(600)
    assert world.requests[asked:] == ["leases"] * 60
    world.away = False
    world.run(80)
    assert world.revision("camera") == "rev2"
    world.run(60)
    assert world.revision("camera") == "rev1"
    assert world.said[:2] == ["the cluster: nothing listens", "the cluster: the Kubernetes API answers"]


def test_it_rests_where_nobody_takes_a_step_and_none_is_left() -> None:
    world = World()
    assert not world.watch.rests()  # nothing was seen yet
    world.leases_now[NAMESPACE] = lease("host 77")
    world.run(LOOK)
    assert not world.watch.rests()
    world.leases_now[NAMESPACE] = lease("", 2)
    world.run(LOOK)
    assert world.watch.rests()
    world.put(live(version("camera", 2)), left(version("camera", 1)))
    world.leases_now[NAMESPACE] = lease("", 3)  # a run that has come and gone
    world.run(LOOK)
    assert not world.watch.rests()


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
    assert world.leases_now[NAMESPACE]["spec"]["holderIdentity"] == ""


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


@pytest.mark.parametrize("refuses", [False, True])
def test_a_goal_that_comes_just_then_is_waited_for_too(refuses: bool) -> None:
    """Where nothing can be held it is looked twice all the same."""
    world = drained(left_alone(node="/camera", ready_timeout=60))
    world.goals["/camera"], world.refuses_holds = busy(), refuses
    world.on_hold = lambda: world.goals.update({"/camera": busy(ACTIVE)})
    world.run(200)
    assert not [done for done in world.done if done.startswith(("apply", "services"))]
    assert world.held == []
    assert world.leases_now[NAMESPACE]["spec"]["holderIdentity"] == ""
    world.goals["/camera"], world.on_hold = busy(), lambda: None
    world.run(20)
    assert world.revision("camera") == "rev1"


@pytest.mark.parametrize(
    ("seen", "seconds"),
    [
        ({"refused": {"/camera"}}, 100),  # a dead node has no goals
        ({}, 160),  # one that cannot be read keeps nobody waiting for ever
        ({"master_away": True}, 160),
    ],
)
def test_whose_goals_cannot_be_read(seen: dict[str, Any], seconds: int) -> None:
    world = drained(left_alone(node="/camera", ready_timeout=60))
    vars(world).update(seen)
    world.run(seconds - 30)
    assert world.revision("camera") == "rev2"
    world.run(30)
    assert world.revision("camera") == "rev1"


NEW_NODE, OLD_NODE = "/camera_22222222_5", "/camera_11111111_4"


@pytest.mark.parametrize(
    ("servers", "goals", "held", "revision"),
    [
        ([OLD_NODE, NEW_NODE], busy(), [], "rev1"),  # two of them: nobody can say whose goals they are
        ([NEW_NODE], busy(), [("/dock", NEW_NODE)], "rev1"),
        ([OLD_NODE], busy(), [], "rev1"),  # the old one works on by itself
        ([NEW_NODE], busy(ACTIVE), [], "rev2"),
    ],
)
def test_nodes_of_overlapping_versions_are_known_in_their_pods(
    servers: list[str], goals: StatusReading, held: list[tuple[str, str]], revision: str
) -> None:
    world = World()
    new, old = version("camera", 2, node="/camera_22222222"), version("camera", 1, node="/camera_11111111")
    world.put(live(new), left(old, actions=["/dock"], ready_timeout=60))
    world.leases_now[NAMESPACE] = lease("host 77")
    world.serve("/dock", *servers)
    world.goals = {OLD_NODE: busy(ACTIVE), NEW_NODE: goals}
    world.run(200)
    assert (world.revision("camera"), world.held) == (revision, held), world.said


@pytest.mark.parametrize(("address", "back"), [("10.42.0.7", True), ("10.42.0.8", False)])
def test_a_version_that_only_waits_beside_the_old_one_has_no_goals(address: str, back: bool) -> None:
    """It has the same node name; the old one works on, and its goals are not held for nobody."""
    world = drained(left_alone(node="/camera", ready_timeout=60))
    world.pods_now = [pod("camera", 2, "10.42.0.8"), pod("camera", 1, "10.42.0.7")]
    world.uris, world.goals = {"/camera": f"http://{address}:4000/"}, {"/camera": busy(ACTIVE)}
    world.run(100)
    assert (world.revision("camera"), world.held) == ("rev1" if back else "rev2", [])


def launch_contract() -> dict[str, Any]:
    """What the engine leaves of an app that is a launch file, whose nodes it found by their pod's address."""
    contracts = step_gate(
        launch_step(), graph_from(launch_graph()), Live(pods=[engine_pod("nav", "10.42.0.8")])
    ).contracts
    assert contracts["nav"].actions == ("/move_base",)
    return contracts["nav"].as_dict()


@pytest.mark.parametrize("node", ["", "/nav"])
def test_a_launch_files_goals_are_found_by_their_actions_name(node: str) -> None:
    world = World()
    contract = {**launch_contract(), "ready_timeout": 60, "revision": "rev2"}
    world.put(live(version("nav", 2, node=node)), left(version("nav", 1, node=node), **contract))
    world.serve("/move_base", "/move_base")
    world.serve("/dock", "/nav")
    world.goals = {"/move_base": busy(ACTIVE), "/nav": busy()}
    world.run(300)
    assert world.done == []
    assert world.said == [f"{NAMESPACE}/nav: is taken back when it rests: /move_base ACTIVE"]


def test_an_action_that_only_the_new_version_has_is_found_by_its_pods_address() -> None:
    world = World()
    world.put(live(version("nav", 2, node="")), left(version("nav", 1, node=""), ready_timeout=60))
    world.pods_now = [pod("nav", 2, "10.42.0.8"), pod("nav", 1, "10.42.0.7")]
    world.serve("/dock", "/docking")
    world.serve("/plan", "/planner")
    world.uris = {"/docking": "http://10.42.0.8:4001/", "/planner": "http://10.42.0.7:4001/"}
    world.goals = {"/docking": busy(ACTIVE), "/planner": busy(ACTIVE)}
    world.run(300)
    assert world.said == [f"{NAMESPACE}/nav: is taken back when it rests: /dock ACTIVE"]
    world.pods_now[0]["spec"]["hostNetwork"] = True  # then the address is anybody's
    world.run(30)
    assert world.revision("nav") == "rev1"


def test_the_master_goes_back_without_a_graph() -> None:
    world = World()
    world.put(live(version("ros-master", 2, node="")), left(version("ros-master", 1, node=""), actions=["/dock"]))
    world.master_away = True
    world.run(200)
    assert world.revision("ros-master") == "rev1"


# ---- a shared master


def shared() -> World:
    world = World("fleet", "robot-r1", "robot-r2")
    world.put(live(version("map", 2, "fleet")), left(version("map", 1, "fleet"), ready_timeout=60), "fleet")
    return world


def test_what_is_the_whole_fleets_has_a_lease_of_its_own() -> None:
    """Whoever changes it has that one, too; runs on robots alone do not keep it from going back."""
    world = shared()
    for taken, revision in ((("robot-r1", "fleet"), "rev2"), (("robot-r1",), "rev1")):
        for _time in range(50):
            for namespace in taken:
                world.take(namespace=namespace)
            world.run(4)
        assert world.revision("map", "fleet") == revision


@pytest.mark.parametrize(("error", "goes_back"), [(ApiError("answered 403", 403), True), (AWAY, False)])
def test_a_robot_that_may_not_be_read_keeps_nobody_from_the_others(error: KubeError, goes_back: bool) -> None:
    """Its namespace may be gone, and what it told of itself still be there. An API that is away is so for all."""
    world = shared()

    def refused(namespace: str) -> None:
        if namespace == "robot-r1":
            raise error

    world.before("deployments", refused)
    world.run(380)
    assert (world.revision("map", "fleet") == "rev1") is goes_back
    assert [line for line in world.said if "robot-r1" in line] == [f"robot-r1: {error}"]


def test_what_is_spoilt_in_a_robots_record_keeps_nobody_from_the_others() -> None:
    """It stands where whoever may write in its namespace has put it."""
    world = World("fleet", "robot-r1", "robot-r2")
    for space in ("robot-r1", "robot-r2"):
        world.put(live(version("camera", 2, space)), left(version("camera", 1, space), ready_timeout=60), space)
    spoilt = [{"revision": "rev1", "deployment": {"metadata": {"name": "camera"}}}]
    world.maps["robot-r1", "camera"]["data"]["history.json"] = json.dumps(spoilt)
    world.run(100)
    assert (world.revision("camera", "robot-r1"), world.revision("camera", "robot-r2")) == ("rev2", "rev1")
    assert [line for line in world.said if "robot-r1" in line] == ["robot-r1: KeyError: 'spec'"]


# ---- what came up once


def came_up() -> World:
    world = left_alone(ready_timeout=60)
    world.there[NAMESPACE, "camera"] = live(version("camera", 2), ready=True)
    world.run(60)
    return world


def falls(world: World, *, crashes: bool = False) -> None:
    world.there[NAMESPACE, "camera"]["status"]["readyReplicas"] = 0
    world.pods_now = [pod("camera", 2, crashes=crashes)]


def test_a_robot_that_is_rebooted_proves_nothing_against_its_version() -> None:
    """Also not when the keeper is started anew with it, or the node is away for hours."""
    world = came_up()
    falls(world)
    world.watch = world.start()
    world.run(HOURS)
    assert (world.revision("camera"), world.done) == ("rev2", [])


def test_what_cannot_be_read_is_no_fault_of_a_version_that_came_up() -> None:
    """Apps that nobody has wait for their master crash for as long as it is away."""
    world = came_up()
    falls(world, crashes=True)
    world.master_away = True
    world.run(HOURS)
    assert world.revision("camera") == "rev2"
    world.master_away = False
    world.run(20)
    assert world.revision("camera") == "rev1"


def test_what_is_not_marked_any_more_is_forgotten() -> None:
    world = came_up()
    assert list(world.files["steps"]) == [NAMESPACE]
    world.there[NAMESPACE, "camera"] = live(version("camera", 2), marked=False)
    world.run(20)
    assert world.files["steps"] == {}


def test_a_full_disk_keeps_no_step_from_going_back(tmp_path: Path) -> None:
    world = left_alone(ready_timeout=60)
    world.put(live(version("lidar", 2), ready=True), left(version("lidar", 1)))
    world.watch.kept = KeptFiles(str(tmp_path / "full"), world.said.append)
    world.watch.kept.directory.rmdir()
    world.run(150)
    assert world.revision("camera") == "rev1"
    assert [line.partition(":")[0] for line in world.said] == ["steps", NAMESPACE]


# ---- the Lease while it goes back


def group(world: World) -> World:
    apps = {"apps": ["lidar", "camera", "fusion"], "ready_timeout": 60}
    for app in apps["apps"]:  # type: ignore[attr-defined]
        world.put(live(version(app, 2)), left(version(app, 1), **apps))
    return world


def test_a_group_that_takes_its_time_keeps_the_lease() -> None:
    world = group(World())
    written: list[float] = []
    world.before("write_lease", lambda *_: written.append(world.at))
    world.before("apply", lambda *_: world.sleep(9.0))
    world.run(120)
    assert [world.revision(app) for app in ("lidar", "camera", "fusion")] == ["rev1"] * 3
    assert max(later - one for one, later in pairwise(written)) < 15.0


def test_a_keeper_that_lost_its_lease_stops_at_once() -> None:
    world = group(World())
    world.fails["lidar"] = lambda: world.take("host 99")  # while this one is applied
    world.run(65)
    assert [world.revision(app) for app in ("lidar", "camera", "fusion")] == ["rev1", "rev2", "rev2"]
    assert world.leases_now[NAMESPACE] == lease("host 99", world.number)
    where = f"{NAMESPACE}/lidar, camera, fusion"
    assert world.said[-1] == f"{where}: is not taken back any further: somebody else changes it now"


def test_goals_that_are_held_when_the_lease_is_lost_are_the_other_ones_affair() -> None:
    world = drained(left_alone(node="/camera", ready_timeout=60))
    world.goals["/camera"] = busy()
    world.on_hold = lambda: world.take("host 99")
    world.run(100)
    assert not [done for done in world.done if done.startswith(("apply", "services"))]
    assert world.held == [("/dock", "/camera")]


def test_goals_are_let_go_where_it_does_not_go_back_after_all() -> None:
    """It got ready just then, so what was read of it is old: nobody would come for them in minutes."""
    world = drained(left_alone(node="/camera", ready_timeout=60))
    world.goals["/camera"] = busy()

    def refused() -> None:
        world.there[NAMESPACE, "camera"] = live(version("camera", 2, node="/camera"), ready=True)
        raise ApiError("the object has been modified", 409)

    world.fails["camera"] = refused
    world.run(200)
    assert (world.revision("camera"), world.held) == ("rev2", [])


# ---- the record of updates


def recorded(world: World, app: str = "camera", outcome: str = "running", namespace: str = NAMESPACE) -> World:
    """As the engine writes it, when the step is applied."""
    result = StepResult(
        "abc", app, (app,), "overlap", {app: {"image": "a:1", "revision": "rev1"}},
        {app: {"image": "a:2", "revision": "rev2"}}, 1000.0, {"apply": 2.0}, "" if outcome == "running" else outcome,
    )  # fmt: skip
    robot = namespace.partition("-")[2]
    made = events_map([result], robot)
    made["metadata"]["resourceVersion"] = "5"
    world.maps[namespace, "robot-updates"] = made
    return world


def event(world: World, namespace: str = NAMESPACE) -> dict[str, Any]:
    (found,) = json.loads(world.maps[namespace, "robot-updates"]["data"]["updates.json"])["updates"]
    return dict(found)


def test_the_record_says_that_the_keeper_went_back() -> None:
    world = recorded(left_alone(ready_timeout=60))
    labels = world.maps[NAMESPACE, "robot-updates"]["metadata"]["labels"]
    assert event(world)["outcome"] == "running"
    world.run(150)
    told = event(world)
    assert (told["outcome"], told["from"], told["to"], told["id"]) == ("rolled-back", "rev1", "rev2", "abc")
    assert told["reason"].startswith("the keeper went back from rev2 to rev1 at 1970-01-01T00:00:00.000000Z: not ready")
    assert world.maps[NAMESPACE, "robot-updates"]["metadata"]["labels"] == labels
    shown = last_steps([world.maps[NAMESPACE, "robot-updates"]])
    assert [(row.robot, row.outcome, row.note) for row in shown] == [("r1", "rolled-back", told["reason"])]


def test_no_run_that_is_gone_is_said_to_be_running() -> None:
    """Whatever became of its version: this one is Ready, and waits for the next run."""
    world = recorded(left_alone())
    world.there[NAMESPACE, "camera"] = live(version("camera", 2), ready=True)
    for _time in range(10):
        world.take()
        world.run(10)
    assert event(world)["outcome"] == "running"
    world.run(30)
    assert (event(world)["outcome"], event(world)["reason"]) == ("failed", CUT_OFF)


def test_a_run_that_waits_for_a_busy_robot_has_let_go_of_its_lease() -> None:
    world = recorded(World(), outcome="waiting")
    world.run(300)
    assert event(world)["outcome"] == "waiting"


def test_a_record_that_a_run_writes_just_then_is_the_runs() -> None:
    world = recorded(left_alone())
    newer = json.loads(json.dumps(world.maps[NAMESPACE, "robot-updates"]))
    newer["metadata"]["resourceVersion"] = "6"
    world.before("apply", lambda *_: world.maps.update({(NAMESPACE, "robot-updates"): newer}), once=True)
    world.run(30)
    assert event(world)["outcome"] == "running"
    world.run(20)
    assert event(world)["outcome"] == "failed"


def test_a_record_that_may_not_be_written_keeps_no_step_from_going_back() -> None:
    world = recorded(left_alone(ready_timeout=60))

    def refused(_namespace: str, body: dict[str, Any]) -> None:
        if body["kind"] == "ConfigMap":
            raise ApiError("answered 403", 403)

    world.before("apply", refused)
    world.run(150)
    assert world.revision("camera") == "rev1"
    assert f"{NAMESPACE}/robot-updates: answered 403" in world.said


def test_what_is_the_whole_fleets_is_in_the_record_of_the_robot_that_changed_it() -> None:
    world = recorded(shared(), "map", namespace="robot-r1")
    world.run(20)
    assert event(world, "robot-r1")["outcome"] == "failed"
    world.run(100)
    assert world.revision("map", "fleet") == "rev1"
    assert event(world, "robot-r1")["outcome"] == "rolled-back"


# ---- whether a server stays


@pytest.mark.parametrize(
    ("deployment", "server", "stays"),
    [
        (live(version("camera", 2, node="/camera")), "/camera", False),
        (live(version("camera", 2, node="/camera"), ready=True), "/camera", True),  # it kept its contract
        (live(version("camera", 2, node="/camera"), marked=False), "/camera", True),  # started again, not replaced
        (live(version("other", 2)), "/camera", True),  # nobody's that we know
        # known by its revision, whichever pod it is in
        (live(version("camera", 2, node="/camera_1a2b3c4d")), "/camera_1a2b3c4d_79d9c6f8b5", False),
    ],
)
def test_a_server_stays_unless_its_version_may_go_back(deployment: dict[str, Any], server: str, stays: bool) -> None:
    world = World()
    world.put(deployment, left())
    assert Staying(world, lambda: world.at)("/dock", server) is stays  # type: ignore[arg-type]


def test_a_launch_files_server_is_known_by_its_action() -> None:
    world = World()
    world.put(live(version("nav", 2, node="/nav")), left(**launch_contract()))
    stays = Staying(world, lambda: world.at)  # type: ignore[arg-type]
    assert not stays("/move_base", "/move_base")
    world.there[NAMESPACE, "nav"]["status"]["readyReplicas"] = 1
    asked = len(world.requests)
    assert stays("/move_base", "/move_base")
    assert world.requests[asked:] == ["deployment"]


def test_whether_a_server_stays_is_known_beside_a_robot_that_may_not_be_read() -> None:
    world = World("fleet", "robot-r1", "robot-r2")
    world.put(live(version("camera", 2, "robot-r2", "/camera")), left(), "robot-r2")

    def refused(namespace: str) -> None:
        if namespace == "robot-r1":
            raise ApiError("answered 403", 403)

    world.before("deployments", refused)
    stays = Staying(world, lambda: world.at)  # type: ignore[arg-type]
    answers = []
    for _look in range(3):
        answers.append(stays("/dock", "/camera"))
        world.at += 5.0
    assert answers == [False] * 3


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
