# SPDX-License-Identifier: GPL-3.0-or-later
"""A change of a host under its robots, in the simulated world: every fault at every call, and what it waits for.

The change is made, half made, or not; what is there works or does not; the API is away while it starts. An outcome's
word is held against what is there, never against what was said.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from types import SimpleNamespace
from typing import Any
from unittest.mock import Mock

import pytest
from ansible_collections.rosops.fleet.plugins.module_utils._common.errors import FleetError, NotReadyError, RosError
from ansible_collections.rosops.fleet.plugins.module_utils._ros.graph_json import graph_from
from ansible_collections.rosops.fleet.plugins.module_utils._step.rest import actions_to_rest, nodes_below
from ansible_collections.rosops.fleet.plugins.plugin_utils._model import names
from ansible_collections.rosops.fleet.plugins.plugin_utils._model.context import Robot
from ansible_collections.rosops.fleet.plugins.plugin_utils._objects.app import app_objects
from ansible_collections.rosops.fleet.plugins.plugin_utils._objects.master import master_objects
from ansible_collections.rosops.fleet.plugins.plugin_utils._objects.namespace import namespace_objects
from ansible_collections.rosops.fleet.plugins.plugin_utils._update import host_change
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.change import word_of
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.hands import Settings, World
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.host_change import HostChange, Ward
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.outcome import UNPROVEN, StepResult, step_id
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.world import HeldError, Live, LostError, Object, Seen
from ansible_collections.rosops.fleet.tests.unit.robots import robot
from ansible_collections.rosops.fleet.tests.unit.simulated.objects import addressed, app
from ansible_collections.rosops.fleet.tests.unit.simulated.robot import EPOCH, FOREVER
from ansible_collections.rosops.fleet.tests.unit.simulated.scenarios import ALL, OLD, drawn, points, settings
from ansible_collections.rosops.fleet.tests.unit.simulated.world import (
    KILLS,
    Killed,
    SimulatedCluster,
    SimulatedHost,
    Simulation,
)

START = 20.0  # seconds until what was changed serves again
BEAT = 10.0  # between two words of a kubelet
SHARE = 1 if ALL else 13
APPS = (
    app("sensor", OLD, placement="local"),
    app("planner", OLD, placement="local", pattern="action", readiness={"actions": ["plan"]}),
)
TWO = [robot(*APPS, name=name, master={"mode": "shared", "image": OLD}) for name in ("robot1", "robot2")]


class Site(Simulation):
    """Robots on one host, and the change of its k3s. `bad` are versions that do not work, and how."""

    def __init__(self, bad: Mapping[str, str] | None = None, robots: Sequence[Robot] = ()) -> None:
        super().__init__()
        self.robots, self.bad = robots or [robot(*APPS)], bad or {}
        self.there, self.previous, self.unproven = "old", "old", False
        self.changes, self.up_at, self.api_later, self.last_beat = 0, 0.0, 0.0, ""
        self.ready_before, self.to = True, "v1.34.3"
        self.lost_then = self.cannot_undo = False
        self.since: float | None = None
        self.engine: Any = SimpleNamespace(settings=Settings())
        for one in map(addressed, self.robots):
            for item in [*namespace_objects(one), *master_objects(one), *app_objects(one)]:
                self.put(item)
        self.advance(10.0)

    # --- the change -------------------------------------------------------------------------------------------------

    def make(self) -> None:
        with self.call("make", 0.5):
            working = [goal for goal in self.goals if goal.process and not goal.ended]
            assert not working or self.forced, f"a robot was interrupted at its work: {working}"
            if not (self.unproven and self.there == "new"):  # else it is there already
                self.becomes("new")

    def undo(self) -> None:
        with self.call("undo", 0.5):
            if self.cannot_undo:
                raise NotReadyError("the disk is full")
            self.becomes(self.previous)

    def becomes(self, version: str) -> None:
        self.there, self.unproven, self.changes = version, True, self.changes + 1
        self.up_at = self.time + START
        self.api_until = max(self.api_until, self.up_at)
        for pod in self.pods:
            if pod.app == "sensor" and pod.process:
                pod.process.alive, pod.ready = self.is_well("graph"), self.is_well("rollout")
        self.changed()

    def is_well(self, how: str) -> bool:
        return self.bad.get(self.there) != how

    def works(self) -> None:
        with self.call("works", 0.5):
            self.advance(max(self.up_at - self.api_later - self.time, 0.0))
            if not self.is_well("works"):
                raise NotReadyError(f"{self.there} keeps ending")

    def proves(self) -> None:
        with self.call("proven", 0.5):
            assert self.there not in self.bad, f"{self.there} is proven, and does not work"
            self.previous, self.unproven = self.there, False

    # --- a run ------------------------------------------------------------------------------------------------------

    def change(self, fault: str = "", at: int = 0, cluster: bool = True, **more: Any) -> StepResult | None:
        self.calls, self.said, self.phases, self.faults = [], [], [], {at: fault}
        self.unheld, self.cancelled, self.begun, self.silent = True, False, self.time, 0.0
        since = more.pop("since", None)
        limits = settings(**{"ready_timeout": 60.0, "since": {} if since is None else {"k3s": since}, **more})
        self.checking, self.forced = limits.check, limits.on_busy == "force"
        place = (HostCluster(self), self.robots) if cluster else ()
        was = self.there
        work: Any = SimpleNamespace(
            name="k3s", node="node1", before="v1.34.2", after=self.to, left=UNPROVEN, unproven=self.unproven,
            make=self.make, works=self.works, undo=self.undo, proven=self.proves,
        )  # fmt: skip
        change = HostChange(work, limits, World(SimulatedHost(self), self, self.say, self.stands), *place)
        try:
            found = change.take()
        except Killed:
            return None
        self.since = change.since
        self.is_true(found, was, limits.check)
        return found

    def is_true(self, found: StepResult, was: str, check: bool) -> None:
        word = found.outcome
        if check:
            assert (self.there, self.mine(), self.changes, self.claims) == (was, [], 0, 0)
            return
        assert self.holder != "the run", "it has its Lease still"
        if word in ("updated", "rolled-back"):
            there = "new" if word == "updated" else self.previous
            assert (self.there, self.unproven) == (there, False), found
            assert self.faults != {0: ""} or not contracts(self), "a contract that was fulfilled is kept"
        if "nothing was touched" in found.reason or word in ("deferred-busy", "waiting"):
            assert self.there == was, found
        if word == "failed" and self.there != was:
            assert "unproven" in found.reason or "way back failed" in found.reason, found
        if "somebody else has this robot" in found.reason:
            assert "release" not in self.calls, "goals are let go that may be held for somebody else's change"
        elif self.unheld and word != "deferred-offline" and self.robot_until <= self.time:
            assert not self.mine(), f"{found}: goals are held still"


class HostCluster(SimulatedCluster):
    sim: Site

    def beat(self, node: str) -> str:
        with self.sim.call("read", 0.1, what="beat"):
            assert node == "node1"
            if self.sim.is_well("beat"):
                self.sim.last_beat = f"{self.sim.changes}: {self.sim.time // BEAT}"
            return self.sim.last_beat

    def read(self, namespaces: Iterable[str]) -> Live:
        found = super().read(namespaces)
        for item in found.deployments:
            there = [pod for pod in self.sim.of((item["metadata"]["namespace"], item["metadata"]["name"])) if pod.ready]
            item["status"] = {"availableReplicas": len(there) * self.sim.ready_before}
        return found

    def wait(self, objects: Sequence[Object], timeout: float, **how: Any) -> None:
        assert objects[0] == {"apiVersion": "v1", "kind": "Node", "metadata": {"name": "node1"}}
        assert bool(objects[1:]) == (self.sim.ready_before and bool(self.sim.robots))
        super().wait(objects[1:], timeout, **how)

    def confirm(self) -> None:
        if self.sim.lost_then and self.sim.changes:
            raise LostError("somebody else has this robot now")


def contracts(site: Site) -> list[str]:
    return [name for _kind, _namespace, name in site.objects if name.startswith("host-change")]


def result(site: Site, **limits: Any) -> StepResult:
    found = site.change(**limits)
    assert found is not None
    return found


def outcome(site: Site, **limits: Any) -> tuple[str, str]:
    found = result(site, **limits)
    return found.outcome, found.reason


def busy(seconds: float, **more: Any) -> Site:
    site = Site(**more)
    site.goal("/plan", seconds)
    site.advance(1.0)
    return site


@pytest.mark.parametrize(
    ("to", "told", "after"), [("v1.34.3", "v1.34.2 -> v1.34.3", ""), ("v1.34.2", "v1.34.2 (settings)", "settings")]
)
def test_a_robot_at_rest_is_changed_and_proven(to: str, told: str, after: str) -> None:
    site = Site()
    site.to = to
    found = result(site)
    assert found.told().startswith(f"k3s {told} in ")
    assert (found.handoff, found.after) == ("replace", {"k3s": {"image": to, "revision": after}})
    assert (found.started, found.id) == (EPOCH + 10.0, step_id("node1", ["k3s"], found.started))
    assert {"gate", "wait", "apply", "verify"} == {*found.phases}
    order = [name for name in site.calls if name in ("hold", "make", "works", "ready", "proven", "release")]
    assert order == ["hold", "make", "works", "ready", "proven", "release"]


def test_the_api_of_the_robot_itself_is_away_meanwhile() -> None:
    site = Site()
    site.api_later = 15.0  # than its unit says that it works
    assert outcome(site) == ("updated", "")
    assert site.calls[site.calls.index("works") :].count("read") >= 2


WHY = {
    "works": "new keeps ending",
    "beat": "has not been heard of since",
    "rollout": "is not rolled out",
    "graph": "/sensor",
}


@pytest.mark.parametrize(
    ("how", "cluster", "calls"),
    [
        ({"robots": ()}, True, {"hold", "graph", "claim"}),  # nobody works there
        ({}, False, {"hold", "graph", "claim", "read"}),  # the API is dead, and this is how to mend it
        ({"ready_before": False}, True, set()),  # what was not well before is no part of the proof
    ],
)
def test_what_is_not_there_is_not_asked(how: dict[str, Any], cluster: bool, calls: set[str]) -> None:
    site = Site()
    vars(site).update(how)
    assert outcome(site, cluster=cluster) == ("updated", "")
    assert not calls & {*site.calls}


@pytest.mark.parametrize(
    ("how", "there", "words"),
    [
        ("cannot_undo", "new", "the way back failed, too: the disk is full"),
        ("lost_then", "new", "somebody else has this robot now"),  # it is not taken back under that run
    ],
)
def test_a_way_back_that_is_none_is_said(how: str, there: str, words: str) -> None:
    site = Site({"new": "works"})
    setattr(site, how, True)
    word, reason = outcome(site)
    assert (word, site.there, site.changes, words in reason) == ("failed", there, 1, True)


@pytest.mark.parametrize("kind", WHY)
def test_what_does_not_prove_itself_is_taken_back(kind: str) -> None:
    site = busy(45.0, bad={"new": kind})  # what a kubelet said while it was waited for proves nothing
    found = result(site)
    assert (found.outcome, WHY[kind] in found.reason, "rollback" in found.phases) == ("rolled-back", True, True)
    assert site.there == "old"
    assert "k3s: it is taken back" in site.said
    if kind in ("beat", "graph"):  # the others say so themselves
        assert any("not yet" in text for text in site.said), "a long wait says what it waits for"


@pytest.mark.parametrize(
    ("limits", "word"),
    [
        ({}, "updated"), ({"on_busy": "defer"}, "deferred-busy"), ({"busy_timeout": 20.0}, "deferred-busy"),
        ({"on_busy": "force"}, "updated"), ({"look_timeout": 10.0}, "updated"),
    ],
)  # fmt: skip
def test_a_robot_that_works_is_waited_for(limits: dict[str, Any], word: str) -> None:
    """A look may be short; the time that a busy robot has goes on from the first one."""
    site, looks, since = busy(45.0), 1, None
    while (found := result(site, **limits, since=since)).outcome == "waiting":
        looks, since = looks + 1, site.since
        assert since is not None
    if since:
        assert (found.started, found.phases["wait"] > 30.0) == (pytest.approx(EPOCH + since, abs=0.01), True)
    assert (found.outcome, looks) == (word, 4 if "look_timeout" in limits else 1)
    said = any("busy on /planner" in text for text in site.said)
    assert said == (word == "updated" and not site.forced) or {*limits} & {"busy_timeout", "look_timeout"}


def test_what_a_robot_says_and_its_windows_are_waited_for() -> None:
    charged = {"topic": "battery", "field": "percentage", "above": 0.4}
    window = {"from": "01:00", "to": "05:00"}
    for more, said in (
        ({"update_when": [charged]}, "/battery"),
        ({"update_windows": [window]}, "it may be changed from"),
    ):
        for policy, word in (("wait", "updated"), ("defer", "deferred-busy"), ("force", "updated")):
            site = Site(robots=[robot(*APPS, **more)])
            site.messages = {"/battery": lambda time: {"percentage": 0.5 if time > 55.0 else 0.1}}
            site.skew = site.robots[0].windows.opens_at(EPOCH) - EPOCH - 55.0
            assert (outcome(site, on_busy=policy)[0], site.time > 55.0) == (word, policy == "wait"), (more, policy)
            waited = [text for text in site.said if text.startswith("k3s waits until robot1 is idle") and said in text]
            assert bool(waited) == (policy == "wait")


def test_goals_that_nobody_can_let_go_are_told_of_and_the_change_stands(monkeypatch: pytest.MonkeyPatch) -> None:
    site = Site()
    monkeypatch.setattr(
        SimulatedHost, "release", Mock(side_effect=RosError("nothing listens at http://10.43.0.1:11411/"))
    )
    site.unheld = False
    monkeypatch.setattr(site, "mine", lambda: [])
    assert outcome(site)[0] == "updated"
    assert any("goals of /plan may be held for another 60 s: nothing listens" in text for text in site.said)


@pytest.mark.parametrize(
    ("call", "words"), [("works", "the host went away: no route"), ("undo", "; before that: new keeps ending")]
)
def test_a_host_that_goes_away_is_told_with_what_was_before(call: str, words: str) -> None:
    clean, site = Site({"new": "works"}), Site({"new": "works"})
    clean.change()
    found = result(site, fault="robot-gone", at=clean.calls.index(call) + 1)
    assert (found.outcome, words in found.reason) == ("deferred-offline", True), found


@pytest.mark.parametrize(
    ("call", "error"),
    [("claim", HeldError("somebody changes this robot")), ("confirm", LostError("somebody else has this robot now"))],
)
def test_a_robot_that_another_run_has_is_left_alone(
    call: str, error: FleetError, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Also when the control node slept between the wait and the change: what is held may be held for that run."""
    monkeypatch.setattr(HostCluster, call, Mock(side_effect=error))
    site = Site()
    assert outcome(site) == ("deferred-busy", f"nothing was touched: {error}")
    assert (site.changes, word_of(error)) == (0, "deferred-busy")


@pytest.mark.parametrize(("policy", "word"), [("wait", "failed"), ("force", "updated")])
def test_a_graph_that_cannot_be_read_is_no_idle_robot(policy: str, word: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(SimulatedHost, "graph", Mock(side_effect=RosError("the master does not answer")))
    assert outcome(Site(), on_busy=policy)[0] == word


@pytest.mark.parametrize(
    ("seconds", "policy", "word", "said"),
    [
        (0.0, "wait", "updated", "k3s: robot1: idle now"),
        (FOREVER, "wait", "updated", "k3s: robot1: busy now: busy on /planner"),
        (FOREVER, "force", "updated", "k3s: robot1: busy now: busy on /planner"),
        (FOREVER, "defer", "deferred-busy", "k3s: robot1: busy now: busy on /planner"),
    ],
)
def test_check_mode_says_what_it_would_meet(seconds: float, policy: str, word: str, said: str) -> None:
    site = busy(seconds)
    assert outcome(site, check=True, on_busy=policy)[0] == word
    assert any(said in text for text in site.said), site.said


@pytest.mark.parametrize(("policy", "word"), [("wait", "failed"), ("force", "updated")])
def test_check_mode_where_nobody_can_tell_says_what_a_run_would_come_to(
    policy: str, word: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(SimulatedHost, "hold", lambda *_given: Seen("fail", "no answer"))
    assert [outcome(Site(), check=check, on_busy=policy)[0] for check in (True, False)] == [word, word]


def killed_in_its_proof(kind: str) -> Site:
    clean, site = Site({"new": kind}), Site({"new": kind})
    clean.change()
    assert site.change("killed", clean.calls.index("works") + 1) is None
    site.advance(60.0)
    site.holder = ""
    assert (site.there, site.unproven, contracts(site)) == ("new", True, ["host-change-node1"])
    return site


@pytest.mark.parametrize("until", [-1.0, FOREVER], ids=["", "and took the master away"])
@pytest.mark.parametrize("kind", ["graph", "rollout"])
def test_a_change_that_was_cut_off_is_held_to_what_was_there_before_it(
    kind: str, until: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Nobody can be asked whether the robot is at work where its master is away; it is not, without its graph."""
    site = killed_in_its_proof(kind)
    site.master_until, becomes = until, site.becomes

    def mends(version: str) -> None:
        becomes(version)
        site.master_until = -1.0 if version == "old" else until

    monkeypatch.setattr(site, "becomes", mends)
    assert outcome(site)[0] == "rolled-back"
    assert (site.there, site.unproven) == ("old", False)


def test_after_an_app_was_updated_the_graph_is_recorded_anew() -> None:
    """Its step has proven it, and its nodes may have other names now."""
    site = killed_in_its_proof("graph")
    site.bad = {}
    for (kind, _namespace, name), item in site.objects.items():
        if (kind, name) == ("Deployment", "sensor"):
            item["metadata"]["annotations"][names.ANNOTATION_HASH] = "another"
            for pod in site.of(("robot-robot1", name)):
                pod.template, pod.ready = "another", True
    assert outcome(site)[0] == "updated"


@pytest.mark.parametrize("said", ["", "{", "[]", '{"well": 1}'])
def test_a_contract_that_somebody_spoilt_is_recorded_anew(said: str) -> None:
    site = killed_in_its_proof("graph")
    spoilt = {"contract.json": said} if said else {}
    site.bad, site.objects["ConfigMap", "robot-robot1", "host-change-node1"]["data"] = {}, spoilt
    assert outcome(site)[0] == "updated"


# --- several robots -------------------------------------------------------------------------------------------------


def test_several_robots_of_one_host_all_rest() -> None:
    site = Site(robots=TWO)
    assert outcome(site)[0] == "updated"
    assert site.calls.count("claim") == site.calls.count("hold") == site.calls.count("ready") == 2


def test_a_robot_that_was_held_while_another_one_worked_is_looked_at_again() -> None:
    """Nothing is held for longer than a minute: the first robot has another goal by then."""
    site = Site(robots=TWO)
    site.goal("/robot2/plan", 100.0)
    later = site.goal("/robot1/plan", 40.0, after=65.0)
    site.quiet = lambda *_given: None  # type: ignore[method-assign] # one look ends, and another one's begins
    site.advance(1.0)
    assert outcome(site, busy_timeout=300.0)[0] == "updated"
    assert later.ended


def test_robots_that_cannot_be_held_together_are_left(monkeypatch: pytest.MonkeyPatch) -> None:
    """Each look takes so long that the first one's hold is over when the second one's begins."""
    hold = SimulatedHost.hold

    def slow(host: SimulatedHost, *given: Any) -> Seen:
        host.sim.advance(60.0)
        return hold(host, *given)

    monkeypatch.setattr(SimulatedHost, "hold", slow)
    site = Site(robots=TWO)
    word, reason = outcome(site, busy_timeout=100.0)
    assert (word, site.changes) == ("deferred-busy", 0)
    assert reason == "nothing was touched: robot1, robot2 were not idle at the same time"


def test_where_robots_share_a_master_only_the_own_ones_rest() -> None:
    nodes = {
        "/robot1/planner": {"pid": 1, "uri": "http://a/"},
        "/robot1/silent": {"uri": "http://b/"},
        "/robot1/dead": {"uri": "http://c/", "refused": True},
        "/robot1/rqt_gui_1": {"pid": 1, "uri": "http://e/"},
        "/robot2/planner": {"pid": 1, "uri": "http://d/"},
    }
    actions = {f"{name}/plan": {"up": True, "servers": [name], "clients": []} for name in nodes}
    graph = graph_from({"nodes": nodes, "actions": actions})
    own = nodes_below(graph, "/robot1")
    assert own == ["/robot1/dead", "/robot1/planner", "/robot1/silent"]
    # a server that does not answer may be at work, one that is gone is not
    assert [one["server"] for one in actions_to_rest(graph, own)] == ["/robot1/planner", "/robot1/silent"]
    assert host_change.conditions(graph, own)["nodes"] == ["/robot1/planner"]


# --- whatever happens -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("bad", [{}, {"new": "works"}, {"new": "graph"}, {"new": "rollout"}])
def test_every_fault_at_every_call(bad: dict[str, str]) -> None:
    """An outcome that is true, and the next run brings it to where it has to be."""
    clean = Site(bad)
    clean.change()
    for fault, at in drawn(points(clean), SHARE, len("".join(bad.values())), KILLS):
        site = Site(bad)
        found = site.change(fault, at)
        assert (found is None) == (fault in KILLS)
        site.restore()
        site.holder = ""
        site.advance(60.0)
        again = result(site)
        assert again.outcome == ("rolled-back" if bad else "updated"), (fault, at, found, again)


# --- what was well before -------------------------------------------------------------------------------------------


def test_only_what_was_well_before_is_asked_of_the_proof() -> None:
    site = Site()
    ward = Ward(site.robots[0], Settings(), HostCluster(site), World(SimulatedHost(site), site))
    (item, *_more) = app_objects(site.robots[0])
    for wanted, there, well in (({"replicas": 2}, 1, False), ({"replicas": 2}, 2, True), ({}, 1, True), ({}, 0, False)):
        ward.live = Live([{**item, "spec": wanted, "status": {"availableReplicas": there}}])
        assert bool(ward.available()) is well, (wanted, there)
