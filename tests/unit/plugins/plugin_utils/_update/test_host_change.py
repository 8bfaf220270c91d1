# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""A change of a host on which robots work: every fault at every call of it.

The host is simulated: its change is made, half made, or not; what is there works or does not; the API is away while it
starts. Time passes only in calls. An outcome's word is held against what is there, never against what was said.
"""

from __future__ import annotations

import contextlib
import copy
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import pytest
from ansible_collections.rosops.fleet.plugins.module_utils._common.errors import KubeError, NotReadyError, RosError
from ansible_collections.rosops.fleet.plugins.module_utils._ros.graph import Graph
from ansible_collections.rosops.fleet.plugins.module_utils._ros.graph_json import graph_from
from ansible_collections.rosops.fleet.plugins.plugin_utils._kube.applied import Applied
from ansible_collections.rosops.fleet.plugins.plugin_utils._model import names
from ansible_collections.rosops.fleet.plugins.plugin_utils._model.context import Robot
from ansible_collections.rosops.fleet.plugins.plugin_utils._update import host_change
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.events import step_id
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.hands import SLICE
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.host_change import HostChange, Place
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.outcome import UNPROVEN, StepResult
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.settings import Settings
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.step import actions_to_rest
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.world import (
    AwayError,
    Calm,
    CancelledError,
    HeldError,
    Live,
    LostError,
    Object,
    Seen,
    World,
)
from ansible_collections.rosops.fleet.tests.unit.robots import robot

FOREVER = 1e9
START = 20.0  # seconds until what was changed serves again
BEAT = 10.0  # between two words of a kubelet
ROBOTS = (robot(name="robot1"), robot(name="robot2"))
GRAPH: dict[str, Any] = {
    "nodes": {name: {"pid": 1, "uri": f"http://{name}/"} for name in ("/driver", "/planner", "/rqt_gui_1")},
    "topics": {
        "/scan": {
            "type": "sensor_msgs/LaserScan", "publishers": ["/driver"], "subscribers": ["/planner"],
            "connections": [{"publisher": "/driver", "subscriber": "/planner"}], "rates": {"/driver": 10.0},
        }
    },
    "services": {},
    "actions": {
        "/plan": {"up": True, "servers": ["/planner"], "clients": []},
        "/gone": {"up": False, "servers": [], "clients": ["/ui"]},
    },
}  # fmt: skip
FAULTS = ("killed", "cancelled", "robot-away", "away-after", "refused", "lost-answer", "api-blip", "api-gone")


class Killed(BaseException):
    """The control node is gone."""


@dataclass
class Site:
    """What is there. `version` is what is installed, `bad` are versions that do not work and how."""

    version: str = "old"
    previous: str = "old"  # what the last proven one was
    is_proven: bool = True
    bad: Mapping[str, str] = field(default_factory=dict)
    deployments: tuple[str, ...] = ("robot1",)
    ready_before: bool = True
    app: str = "app 1"  # the version of the robots' app
    maps: dict[tuple[str, str], Object] = field(default_factory=dict)
    busy_until: float = 0.0
    busy: tuple[str, ...] = ("robot1", "robot2")  # who is
    goals: Mapping[str, tuple[float, float]] = field(default_factory=dict)  # robot -> when one comes, how long it takes
    starts: dict[str, float] = field(default_factory=dict)
    holds: dict[str, float] = field(default_factory=dict)  # robot -> until when its goals are held
    slow: float = 0.0  # seconds of a look at the actions
    robots: tuple[Robot, ...] = ROBOTS
    left: str = UNPROVEN
    charged_at: float = 0.0  # when messages say what the robots ask for
    lost_then: bool = False  # the Lease, once the change was made
    late_keeper: bool = False  # it holds, and says so too late
    keeper_away: bool = False  # when goals are to be let go
    master_silent: bool = False
    other_run: bool = False
    lost: bool = False
    cannot_undo: bool = False
    api_later: float = 0.0

    time: float = 0.0
    up_at: float = 0.0  # the API and the kubelet serve since then
    down: tuple[float, float] = (FOREVER, FOREVER)  # a fault took the API away
    away_until: float = -1.0
    calls: list[str] = field(default_factory=list)
    said: list[str] = field(default_factory=list)
    fault: str = ""
    at: int = 0
    claimed: list[str] = field(default_factory=list)
    held: set[str] = field(default_factory=set)
    interrupted: list[str] = field(default_factory=list)
    changes: int = 0
    last_beat: str = ""
    since: float | None = None

    # --- the world ----------------------------------------------------------------------------------------------------

    def now(self) -> float:
        return self.time

    def wall(self) -> float:
        return 1.8e9 + self.time

    def sleep(self, seconds: float) -> None:
        self.time += seconds

    @contextlib.contextmanager
    def call(self, name: str, seconds: float = 0.5) -> Iterator[None]:
        self.calls.append(name)
        fault = self.fault if len(self.calls) == self.at else ""
        if fault == "killed":
            raise Killed
        if fault == "cancelled":
            raise CancelledError("the run was cancelled")
        if fault == "robot-away":
            self.away_until = self.time + 30
        if fault.startswith("api"):
            self.down = (self.time, FOREVER if fault == "api-gone" else self.time + 5)
        self.time += seconds
        cluster = name.startswith("api")
        if not cluster and self.away_until > self.time:
            raise AwayError("no route to host")
        if fault == "refused":
            raise (KubeError if cluster else RosError)(f"refused at {name}")
        if cluster and (self.time < self.up_at or self.down[0] <= self.time < self.down[1]):
            self.time += 5
            raise KubeError("the API cannot be reached")
        yield
        if fault == "lost-answer":
            raise (KubeError if cluster else RosError)(f"the answer of {name} was lost")
        if fault == "away-after" and not cluster:
            raise AwayError("the connection broke")

    # --- the change ---------------------------------------------------------------------------------------------------

    name, before, after = "k3s", "v1.34.2", "v1.34.3"

    @property
    def unproven(self) -> bool:
        return not self.is_proven

    def make(self) -> None:
        with self.call("make"):
            self.interrupted += [name for name in self.deployments if self.works_until(name) > self.time]
            if self.is_proven or self.version != "new":  # else it is there already
                self.install("new")

    def undo(self) -> None:
        with self.call("undo"):
            if self.cannot_undo:
                raise NotReadyError("the disk is full")
            self.install(self.previous)

    def install(self, version: str) -> None:
        self.version, self.is_proven = version, False
        self.up_at = self.time + START
        self.changes += 1

    def works(self) -> None:
        with self.call("works"):
            self.time = max(self.time, self.up_at - self.api_later)
            if self.bad.get(self.version) == "works":
                raise NotReadyError(f"{self.version} keeps ending")

    def proven(self) -> None:
        with self.call("proven"):
            assert self.version not in self.bad, f"{self.version} is proven, and does not work"
            assert not self.is_proven or self.changes == 0
            self.previous, self.is_proven = self.version, True

    # --- the cluster --------------------------------------------------------------------------------------------------

    def beat(self, node: str) -> str:
        with self.call("api beat"):
            assert node == "node1"
            if self.bad.get(self.version) != "beat":
                self.last_beat = f"{self.changes}: {self.time // BEAT}"
            return self.last_beat

    def read(self, namespaces: Iterable[str]) -> Live:
        with self.call("api read"):
            well = self.ready_before and self.bad.get(self.version) != "rollout"
            here = [name for name in self.deployments if f"robot-{name}" in namespaces]
            maps = [item for (_name, namespace), item in self.maps.items() if namespace in namespaces]
            return Live(
                [deployment(name, well, self.app) for name in here],
                maps,
                [service(one, namespaces) for one in ("ros-master", "ros-keeper")],
            )

    @contextlib.contextmanager
    def claim(self, namespace: str) -> Iterator[None]:
        with self.call("api claim"):
            if self.other_run:
                raise HeldError("somebody changes this robot")
        self.claimed.append(namespace)
        try:
            yield
        finally:
            self.claimed.remove(namespace)

    def apply(self, objects: Sequence[Object], dry_run: bool = False) -> Sequence[Applied]:
        with self.call("api apply"):
            assert not dry_run
            assert {item["metadata"]["namespace"] for item in objects} <= {*self.claimed}
            for item in objects:
                robot = item["metadata"]["namespace"].removeprefix("robot-")
                assert item["metadata"]["name"] == "host-change-node1"
                assert item["metadata"]["labels"][names.LABEL_ROBOT] == robot
                self.maps[map_key(item)] = item
            return []

    def delete(self, objects: Sequence[Object], dry_run: bool = False) -> Sequence[Applied]:
        with self.call("api delete"):
            assert not dry_run
            for item in objects:
                self.maps.pop(map_key(item), None)
            return []

    def confirm(self) -> None:
        with self.call("api confirm"):
            if self.lost or (self.lost_then and self.changes):
                raise LostError("somebody else has this robot now")

    def wait(self, objects: Sequence[Object], timeout: float) -> None:
        with self.call("api rollout"):
            if self.bad.get(self.version) == "rollout":
                self.time += timeout
                raise NotReadyError("node1 is not Ready")
            assert objects[0] == {"apiVersion": "v1", "kind": "Node", "metadata": {"name": "node1"}}
            kinds = [item["kind"] for item in objects]
            assert kinds == ["Node", *["Deployment"] * (len(self.deployments) if self.ready_before else 0)]
            assert 0.0 <= timeout <= 60.0

    # --- the host -----------------------------------------------------------------------------------------------------

    def there(self) -> None:
        with self.call("there"):
            pass

    def graph(self, master: str, _rate_seconds: float = 0.0, nodes: Sequence[str] = ()) -> Graph:
        with self.call("graph"):
            assert master in ("http://10.43.0.1:11311", "http://10.43.0.2:11311")
            assert not nodes, "nobody asked for rates"
            if self.master_silent:
                raise RosError("the master does not answer")
            return graph_from(self.shown())

    def shown(self) -> dict[str, Any]:
        """The graph, as long as nothing has broken it."""
        found = copy.deepcopy(GRAPH)
        if self.bad.get(self.version) == "graph":
            del found["nodes"]["/driver"], found["topics"]["/scan"]
        return found

    def hold(self, master: str, keeper: str, calm: Calm, seconds: float, timeout: float) -> Seen:
        with self.call("hold"):
            assert [action["name"] for action in calm.actions] == ["/plan"]
            assert seconds <= 60
            self.time += self.slow
            name = f"robot{master.partition('10.43.0.')[2].partition(':')[0]}"
            self.time += min(timeout, max(self.works_until(name) - self.time, 0.0))
            if self.works_until(name) > self.time:
                return Seen("wait", "/plan has a goal")
            self.time += min(timeout, max(self.charged_at - self.time, 0.0)) if calm.when else 0.0
            if calm.when and self.charged_at > self.time:
                return Seen("wait", f"{calm.when[0]['topic']}: not yet")
            if keeper:
                self.held |= {"/plan"}
                self.holds[name] = self.time + seconds
            return Seen("pass", "", ("/plan",) if keeper and not self.late_keeper else ())

    def works_until(self, name: str) -> float:
        """When the robot is idle; a goal that is held begins when it is let go."""
        found, held = self.busy_until if name in self.busy else 0.0, self.holds.get(name, 0.0)
        if name in self.goals and name not in self.starts and self.time >= max(self.goals[name][0], held):
            self.starts[name] = max(self.goals[name][0], held)
        return max(found, self.starts[name] + self.goals[name][1] if name in self.starts else 0.0)

    def release(self, _master: str, _keeper: str, _actions: Sequence[Object]) -> None:
        with self.call("release"):
            if self.keeper_away:
                raise RosError("nothing listens at http://10.43.0.1:11411/")
            self.held = set()

    def ready(self, master: str, conditions: Object, timeout: float, stable: float = 0.0) -> Seen:
        with self.call("ready"):
            assert master.startswith("http://10.43.0.")
            assert (timeout, stable) == (SLICE + 1.0, 1.0)
            assert "/rqt_gui_1" not in conditions["nodes"]
            assert all("min_rate" not in topic for topic in conditions["topics"])
            self.time += stable
            missing = sorted({*conditions["nodes"]} - {*self.shown()["nodes"]})
            if missing:
                self.time += timeout
                return Seen("wait", f"{missing} are missing")
            return Seen("pass")

    # --- a run --------------------------------------------------------------------------------------------------------

    def run(self, fault: str = "", at: int = 0, cluster: bool = True, **limits: Any) -> StepResult | None:
        self.calls, self.said, self.fault, self.at = [], [], fault, at
        here: Any = self
        world = World(here, here, self.said.append)
        since = limits.pop("since", None)
        limits["since"] = {} if since is None else {self.name: since}
        wanted = Settings(**{"busy_timeout": 60.0, "ready_timeout": 60.0, **limits})
        place = Place(here, "node1", self.robots) if cluster else Place()
        before = self.version
        try:
            found, _learned, self.since, _over = HostChange(self, place, wanted, world).take()
        except Killed:
            return None
        finally:
            self.fault = ""
        self.truth(found, before, wanted)
        return found

    def truth(self, found: StepResult, before: str, limits: Settings) -> None:
        word = found.outcome
        if limits.check:
            assert (self.version, self.held, self.changes) == (before, set(), 0)
            return
        if word == "updated":
            assert (self.version, self.is_proven) == ("new", True), found
        if word == "rolled-back":
            assert (self.version, self.is_proven) == (self.previous, True), found
        if "nothing was touched" in found.reason or word in ("deferred-busy", "waiting"):
            assert self.version == before, found
        if word == "failed" and self.version != before:
            assert "unproven" in found.reason or "way back failed" in found.reason, found
        assert not self.claimed
        if word in ("updated", "rolled-back") and not self.at:
            assert not self.maps, "a contract that was fulfilled is kept"
        if self.away_until < 0 and not self.keeper_away and "release" not in self.calls[: self.at][-1:]:
            assert not self.held, f"{found}: goals are held still"
        assert not self.interrupted, "a robot was interrupted at its work"


def map_key(item: Object) -> tuple[str, str]:
    return item["metadata"]["name"], item["metadata"]["namespace"]


def deployment(name: str, ready: bool, version: str) -> dict[str, Any]:
    return {
        "apiVersion": "apps/v1", "kind": "Deployment",
        "metadata": {"name": "app", "namespace": f"robot-{name}", "annotations": {names.ANNOTATION_HASH: version}},
        "spec": {"replicas": 1}, "status": {"availableReplicas": int(ready)},
    }  # fmt: skip


def service(name: str, namespaces: Iterable[str]) -> dict[str, Any]:
    (namespace,) = namespaces
    address = f"10.43.0.{2 if namespace == 'robot-robot2' else 1}"
    port = {"ros-master": 11311, "ros-keeper": 11411}[name]
    metadata = {"name": name, "namespace": namespace}
    return {"metadata": metadata, "spec": {"clusterIP": address, "ports": [{"port": port}]}}


def outcome(site: Site, **limits: Any) -> tuple[str, str]:
    found = site.run(**limits)
    assert found is not None
    return found.outcome, found.reason


def test_a_robot_at_rest_is_changed_and_proven() -> None:
    site = Site()
    found = site.run()
    assert found is not None
    assert found.told().startswith("k3s v1.34.2 -> v1.34.3 in ")
    assert (found.handoff, found.started, found.after) == (
        "replace", site.wall() - site.time, {"k3s": {"image": "v1.34.3", "revision": ""}},
    )  # fmt: skip
    assert found.id == step_id("node1", ["k3s"], found.started)
    assert {"gate", "wait", "apply", "verify"} == {*found.phases}
    assert [name for name in site.calls if name in ("hold", "make", "works", "ready", "proven", "release")] == [
        "hold", "make", "works", "ready", "proven", "release",
    ]  # fmt: skip


def test_the_api_of_the_robot_itself_is_away_meanwhile() -> None:
    site = Site(api_later=15.0)  # than its unit says that it works
    assert outcome(site) == ("updated", "")
    assert site.calls.count("api beat") > 2


def test_a_host_on_which_no_robot_works_is_not_waited_for() -> None:
    site = Site(deployments=())
    assert outcome(site)[0] == "updated"
    assert not {"hold", "graph", "api claim"} & set(site.calls)


def test_other_settings_of_the_same_version_are_told_as_such() -> None:
    site = Site()
    site.after = site.before
    found = site.run()
    assert found is not None
    assert found.told().startswith("k3s v1.34.2 (settings) in ")


WHY = {
    "works": "new keeps ending",
    "beat": "has not been heard of since",
    "rollout": "is not Ready",
    "graph": "missing",
}


@pytest.mark.parametrize("kind", WHY)
def test_what_does_not_prove_itself_is_taken_back(kind: str) -> None:
    site = Site(bad={"new": kind})
    found = site.run()
    assert found is not None
    assert (found.outcome, WHY[kind] in found.reason, "rollback" in found.phases) == ("rolled-back", True, True)
    assert site.version == "old"
    assert "k3s: it is taken back" in site.said
    if kind in ("beat", "graph"):  # the others say so themselves
        assert any("not yet" in text for text in site.said), "a long wait says what it waits for"


def test_a_way_back_that_fails_is_said() -> None:
    site = Site(bad={"new": "works"}, cannot_undo=True)
    word, reason = outcome(site)
    assert word == "failed"
    assert "the way back failed, too: the disk is full" in reason


@pytest.mark.parametrize(
    ("limits", "word"),
    [({}, "updated"), ({"on_busy": "defer"}, "deferred-busy"), ({"busy_timeout": 20.0}, "deferred-busy")],
)
def test_a_robot_that_works_is_waited_for(limits: dict[str, Any], word: str) -> None:
    site = Site(busy_until=45.0)
    assert outcome(site, **limits)[0] == word
    if word == "updated":
        assert any("/plan has a goal" in text for text in site.said)


def test_what_a_robot_s_messages_have_to_say_is_waited_for() -> None:
    charged = {"topic": "battery", "field": "percentage", "above": 0.4}
    asked = robot(name="robot1", update_when=[charged])
    site = Site(robots=(asked,), charged_at=45.0)
    assert outcome(site)[0] == "updated"
    assert site.time > 45.0
    assert any(text.startswith("k3s waits until robot1 is idle") and "/battery: not yet" in text for text in site.said)
    assert outcome(Site(robots=(asked,), charged_at=45.0), on_busy="defer")[0] == "deferred-busy"
    assert outcome(Site(robots=ROBOTS, charged_at=FOREVER))[0] == "updated"


def test_a_robot_s_window_is_waited_for() -> None:
    """The clock stands at 08:00 where the time is 0."""
    asked = robot(name="robot1", update_windows=[{"from": "08:01", "to": "09:00"}])
    site = Site(robots=(asked,), time=15.0)
    assert outcome(site)[0] == "updated"
    assert site.time > 60.0
    assert any("it may be changed from 2027-01-15 08:01 (UTC) on" in text for text in site.said)
    assert outcome(Site(robots=(asked,)), on_busy="defer")[0] == "deferred-busy"
    assert outcome(Site(robots=(asked,)), on_busy="force")[0] == "updated"


def test_what_the_kubelet_said_while_the_robot_was_waited_for_proves_nothing() -> None:
    """It said a lot meanwhile, and nothing after the change."""
    site = Site(bad={"new": "beat"}, busy_until=45.0)
    assert outcome(site)[0] == "rolled-back"


def test_a_hold_whose_answer_was_lost_is_ended_too() -> None:
    assert outcome(Site(late_keeper=True))[0] == "updated"


def test_goals_that_nobody_can_let_go_are_told_of_and_the_change_stands() -> None:
    site = Site(keeper_away=True)
    assert (outcome(site)[0], site.held) == ("updated", {"/plan"})
    assert any("goals of /plan may be held for another 60 s: nothing listens" in text for text in site.said)


def test_whoever_waits_may_come_back() -> None:
    """A look is short; the time that a busy robot has goes on from the first one."""
    site, looks, since = Site(busy_until=45.0), 0, None
    while (found := outcome(site, look_timeout=10.0, since=since)[0]) == "waiting":
        looks, since = looks + 1, site.since
        assert since is not None
        assert since < 10
        assert not site.held
    assert (found, looks) == ("updated", 3)


def test_the_last_look_is_no_wait() -> None:
    site, since = Site(busy_until=FOREVER), None
    for _look in range(20):
        word, since = outcome(site, look_timeout=10.0, since=since)[0], site.since
        if word != "waiting":
            break
    assert word == "deferred-busy"
    assert 60 < site.time < 120


def test_another_run_is_left_alone() -> None:
    assert outcome(Site(other_run=True)) == ("deferred-busy", "nothing was touched: somebody changes this robot")


def test_a_robot_that_went_to_another_run_is_not_changed() -> None:
    """The control node slept between the wait and the change."""
    site = Site(lost=True)
    assert outcome(site) == ("deferred-busy", "nothing was touched: somebody else has this robot now")
    assert site.changes == 0


@pytest.mark.parametrize(("policy", "word"), [("wait", "failed"), ("defer", "failed"), ("force", "updated")])
def test_a_graph_that_cannot_be_read_is_no_idle_robot(policy: str, word: str) -> None:
    assert outcome(Site(master_silent=True), on_busy=policy)[0] == word


def test_what_was_not_well_before_is_no_part_of_the_proof() -> None:
    assert outcome(Site(ready_before=False))[0] == "updated"


def test_without_a_cluster_the_change_proves_itself() -> None:
    """The API is dead, and this is how to mend it."""
    assert outcome(Site(), cluster=False)[0] == "updated"
    assert outcome(Site(bad={"new": "works"}), cluster=False)[0] == "rolled-back"


@pytest.mark.parametrize(
    ("busy", "policy", "word", "said"),
    [
        (0.0, "wait", "updated", "idle now"),
        (FOREVER, "wait", "updated", "busy now: /plan has a goal"),
        (FOREVER, "defer", "deferred-busy", "busy now: /plan has a goal"),
    ],
)
def test_check_mode_says_what_it_would_meet(busy: float, policy: str, word: str, said: str) -> None:
    site = Site(busy_until=busy)
    assert outcome(site, check=True, on_busy=policy)[0] == word
    assert any(said in text for text in site.said)


def test_several_robots_of_one_host_all_rest() -> None:
    site = Site(deployments=("robot1", "robot2"))
    assert outcome(site)[0] == "updated"
    assert site.calls.count("api claim") == site.calls.count("hold") == site.calls.count("ready") == 2


def killed_in_its_proof(kind: str) -> Site:
    clean = Site(bad={"new": kind})
    clean.run()
    site = Site(bad={"new": kind})
    assert site.run("killed", clean.calls.index("works") + 1) is None
    site.time += 60.0
    site.held = set()  # the keeper has let the goals go by then
    assert (site.version, site.is_proven) == ("new", False)
    return site


@pytest.mark.parametrize("kind", ["graph", "rollout"])
def test_a_change_that_was_cut_off_is_held_to_what_was_there_before_it(kind: str) -> None:
    site = killed_in_its_proof(kind)
    assert outcome(site)[0] == "rolled-back"
    assert (site.version, site.is_proven) == ("old", True)


def test_a_change_that_took_the_robots_master_away_is_taken_back() -> None:
    """Nobody can be asked whether the robot is at work; it is not, without its graph."""
    site = killed_in_its_proof("graph")
    site.master_silent = True
    assert outcome(site)[0] == "rolled-back"


def test_after_an_app_was_updated_the_graph_is_recorded_anew() -> None:
    """Its step has proven it, and its nodes may have other names now."""
    site = killed_in_its_proof("graph")
    site.app, site.bad = "app 2", {}
    site.shown = lambda: {**GRAPH, "nodes": {"/planner": GRAPH["nodes"]["/planner"]}}  # type: ignore[method-assign]
    assert outcome(site)[0] == "updated"


def test_a_robot_that_was_held_while_another_one_worked_is_looked_at_again() -> None:
    """Nothing is held for longer than a minute: the first robot has another goal by then."""
    site = Site(deployments=("robot1", "robot2"), busy_until=100.0, busy=("robot2",), goals={"robot1": (80.0, 40.0)})
    assert outcome(site, busy_timeout=300.0)[0] == "updated"
    assert site.time > 120.0


def test_robots_that_cannot_be_held_together_are_left() -> None:
    """Each look takes so long that the first one's hold is over when the second one's begins."""
    site = Site(deployments=("robot1", "robot2"), slow=60.0)
    word, reason = outcome(site, busy_timeout=100.0)
    assert (word, site.changes) == ("deferred-busy", 0)
    assert reason == "nothing was touched: robot1, robot2 were not idle at the same time"


def test_what_another_run_has_by_now_is_not_taken_back_under_it() -> None:
    site = Site(bad={"new": "works"}, lost_then=True)
    word, reason = outcome(site)
    assert (word, site.version, site.changes) == ("failed", "new", 1)
    assert "somebody else has this robot now" in reason


@pytest.mark.parametrize("bad", [{}, {"new": "works"}, {"new": "graph"}, {"new": "rollout"}])
@pytest.mark.parametrize("fault", FAULTS)
def test_every_fault_at_every_call(bad: dict[str, str], fault: str) -> None:
    """Whatever happened: an outcome that is true, and the next run brings it to where it has to be."""
    clean = Site(bad=bad)
    clean.run()
    for at in range(1, len(clean.calls) + 1):
        site = Site(bad=bad)
        found = site.run(fault, at)
        assert found is None or found.outcome in (
            "updated", "rolled-back", "deferred-offline", "deferred-busy", "failed",
        )  # fmt: skip
        assert (found is None) == (fault == "killed")
        site.down, site.away_until, site.held = (FOREVER, FOREVER), -1.0, set()
        site.time += 60.0
        again = site.run()
        assert again is not None
        assert again.outcome == ("rolled-back" if bad else "updated"), (fault, at, found, again)


# --- what was well before ------------------------------------------------------------------------------------------


def test_only_what_was_well_before_is_asked_of_the_proof() -> None:
    site: Any = Site()
    ward = host_change.Ward(ROBOTS[0], site, World(site, site))
    for wanted, there, well in (({"replicas": 2}, 1, False), ({"replicas": 2}, 2, True), ({}, 1, True), ({}, 0, False)):
        item = {**deployment("robot1", True, "app 1"), "spec": wanted, "status": {"availableReplicas": there}}
        ward.live = Live([item])
        assert bool(ward.available()) is well, (wanted, there)


def test_a_host_without_a_node_keeps_its_contract_under_a_name_of_its_own() -> None:
    assert host_change.contract_name("") == "host-change"


# --- which nodes are a robot's own ------------------------------------------------------------------------------------


def shared_graph() -> Graph:
    nodes = {
        "/robot1/planner": {"pid": 1, "uri": "http://a/"},
        "/robot1/silent": {"uri": "http://b/"},
        "/robot1/dead": {"uri": "http://c/", "refused": True},
        "/robot2/planner": {"pid": 1, "uri": "http://d/"},
    }
    actions = {f"{name}/plan": {"up": True, "servers": [name], "clients": []} for name in nodes}
    return graph_from({"nodes": nodes, "actions": actions})


def test_where_robots_share_a_master_only_the_own_ones_rest() -> None:
    graph = shared_graph()
    shared = robot(name="robot1", master={"mode": "shared"})
    nodes = host_change.own_nodes(graph, shared)
    assert nodes == ["/robot1/dead", "/robot1/planner", "/robot1/silent"]
    # a server that does not answer may be at work, one that is gone is not
    assert [one["server"] for one in actions_to_rest(graph, nodes)] == ["/robot1/planner", "/robot1/silent"]
    assert host_change.conditions(graph, nodes)["nodes"] == ["/robot1/planner"]
