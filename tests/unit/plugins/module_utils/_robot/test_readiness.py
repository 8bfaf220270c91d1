# SPDX-License-Identifier: GPL-3.0-or-later
"""Readiness gates: what is done about a pod, on a fake clock, a fake graph and a fake API."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from itertools import count, pairwise
from threading import BoundedSemaphore
from typing import Any, cast
from unittest.mock import Mock, call

import pytest
from ansible_collections.rosops.fleet.plugins.module_utils._common.errors import RosError
from ansible_collections.rosops.fleet.plugins.module_utils._robot import readiness
from ansible_collections.rosops.fleet.plugins.module_utils._robot.cluster_api import REFRESH, ApiError, Cluster
from ansible_collections.rosops.fleet.plugins.module_utils._robot.keeper import Keeper
from ansible_collections.rosops.fleet.plugins.module_utils._ros.backend import Backend, MasterState
from ansible_collections.rosops.fleet.plugins.module_utils._ros.client import Ros1Client
from ansible_collections.rosops.fleet.plugins.module_utils._ros.graph import (
    Graph,
    Handshake,
    Node,
    NodeKey,
    Rate,
    Topic,
)
from ansible_collections.rosops.fleet.plugins.module_utils._ros.keeper_client import FORGETFUL
from ansible_collections.rosops.fleet.plugins.module_utils._ros.replies import NodeAnswer
from ansible_collections.rosops.fleet.plugins.module_utils._step.objects import Object
from ansible_collections.rosops.fleet.plugins.module_utils._step.words import APP, READINESS, REVISION, SETTINGS
from ansible_collections.rosops.fleet.tests.unit.plugins.pod_graph import OWN, URI, Clock, World, bus, contract

ADDRESS = "127.0.0.1"
KNOWN = {"app": "talker", "node": "/talker", "expect_node": True, "min_rates": {}, "space": "/"}


def pod(
    uid: str = "new", runs: str = "c1", says: str = "", address: str = ADDRESS, ends: bool = False, **container: Any
) -> Object:
    """`runs` is its container's id, `says` that of the container for which its gate lets it be Ready."""
    said = {"type": READINESS, "status": "True", "message": readiness.PROVEN + says}
    other = {"type": "PodScheduled", "status": "True"}
    state = {"running": {}} if runs else {"terminated": {"exitCode": 1}}
    return {
        "metadata": {
            "name": f"talker-{uid}",
            "uid": uid,
            "labels": {APP: "talker", REVISION: "0a1b2c3d"},
            "annotations": {SETTINGS: json.dumps(KNOWN)},
            **({"deletionTimestamp": "T"} if ends else {}),
        },
        "spec": {"readinessGates": [{"conditionType": READINESS}]},
        "status": {
            "podIP": address,
            "conditions": [other, said] if says else [other],
            "containerStatuses": [{"name": "ros-app", "state": state, "containerID": runs, **container}],
        },
    }


def knowing(found: Object, **changes: Any) -> Object:
    """A pod that is told more."""
    found["metadata"]["annotations"][SETTINGS] = json.dumps({**KNOWN, **changes})
    return found


@pytest.mark.parametrize(
    ("found", "wanted"),
    [
        (pod(), readiness.PROVE),
        # its own startup probe has not passed: it is looked at once more then
        (pod(says="c1", started=False), readiness.PROVE),
        (pod(runs=""), ""),
        (pod(says="c1"), ""),
        (pod(says="c0"), readiness.PROVE),  # that was another container
        (pod(runs="", says="c0"), readiness.WITHDRAW),
        (pod(says="c1", ends=True), readiness.END),
        (pod(name="beside"), ""),  # only another container runs
    ],
)
def test_what_is_due(found: Object, wanted: str) -> None:
    assert readiness.due(found) == wanted


def test_its_settings_have_the_names_that_its_template_gives() -> None:
    found = knowing(pod(), min_rates={"~out": 5, "/in": 7})
    found["metadata"]["labels"]["pod-template-hash"] = "5d"
    settings = readiness.settings_of(found)
    assert (settings.node, settings.revision, settings.version) == ("/talker_0a1b2c3d_5d", "0a1b2c3d", "0a1b2c3d_5d")
    assert settings.min_rates == {"/talker_0a1b2c3d_5d/out": 5, "/in": 7}
    settings = readiness.settings_of(knowing(found, node="/r1/talker", space="/r1", min_rates={"~out": 5}))
    assert (settings.node, *settings.min_rates) == ("/r1/talker_0a1b2c3d_5d", "/r1/talker_0a1b2c3d_5d/out")


SPACE = "robot-r1"


class Api:
    """A robot's namespace."""

    def __init__(self) -> None:
        self.conditions: list[tuple[str, str, str]] = []
        self.record: Object | None = None
        self.there: list[Object] = []
        self.events: list[Object] = []
        self.evicted: list[str] = []
        self.refuses = 0
        self.read = 0

    def set_condition(self, namespace: str, item: Object, condition: Object) -> None:
        assert namespace == SPACE
        if self.refuses:
            raise ApiError("no", self.refuses)
        assert condition["type"] == READINESS
        self.conditions.append((item["metadata"]["uid"], condition["status"], condition["message"]))

    def stamp(self) -> str:
        return "now"

    def evict(self, namespace: str, item: Object, seconds: int | None) -> None:
        assert (namespace, seconds) == (SPACE, None)
        self.evicted.append(item["metadata"]["uid"])

    def tell(self, namespace: str, item: Object, reason: str, message: str) -> None:
        assert (namespace, item["metadata"]["uid"], reason) == (SPACE, self.evicted[-1], "NodeUnheard")
        assert "register once" in message

    def config_map(self, _namespace: str, name: str) -> Object | None:
        assert name == "talker-update"
        self.read += 1
        return self.record

    def pods_since(self, _namespace: str) -> tuple[list[Object], str]:
        return self.there, "1"

    def watch_pods(self, _namespace: str, version: str) -> Iterator[Object]:
        assert version
        yield from self.events


class Scene(Clock):
    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        super().__init__()
        self.world, self.api, self.restarted_at = World(), Api(), -1.0
        self.done: list[tuple[str, ...]] = []
        self.ended: list[tuple[str, str]] = []  # addresses, and below which name
        self.has_ended = lambda *of_pod: self.ended.append(of_pod)
        self.log: list[str] = []
        self.places = {OWN: URI}  # all others are elsewhere
        self.whole_since = -1.0
        self.away, self.looks = False, 0  # the master, and looks at all that is registered
        self.services: dict[str, Any] = {}  # of each node that something was done to
        self.seen_by_looks = self.world.state
        scene = self

        class OwnNode:
            def __init__(self, name: str, uri: str, services: Any, settings: Any) -> None:
                del settings
                self.name, self.uri = name, uri
                scene.services[name] = services

            def __getattr__(self, what: str) -> Any:
                return lambda _seconds: scene.done.append((what, self.name))

        self.world.addresses = self.addresses  # type: ignore[attr-defined]
        self.world.state = self.state  # type: ignore[method-assign]
        monkeypatch.setattr(readiness, "OwnNode", OwnNode)
        self.gates = readiness.Readiness(
            cast("Cluster", self.api),
            SPACE,
            cast("Ros1Client", self.world),
            lambda node, _uri, _seconds: self.done.append(("keep_latched", node)),
            cast("Keeper", self),
            self.log.append,
            self.now,
            self.sleep,
        )
        monkeypatch.setattr(self.gates, "start", lambda work: work())

    def state(self, types: bool = False) -> MasterState:
        if types:
            return self.seen_by_looks(types)
        self.looks += 1
        if self.away:
            raise RosError("the master is away")
        return MasterState({"/rosout": tuple(self.places)}, {}, {"/add": (OWN,)})

    def addresses(self, names: Iterable[str], services: Iterable[str] = ()) -> tuple[dict[str, str], dict[str, str]]:
        return {name: self.places.get(name, "http://h:1/") for name in names}, dict.fromkeys(services, "rosrpc://h:2")

    def is_whole(self, since: float) -> bool:
        return since >= self.whole_since

    def owe(self, **changes: Any) -> None:
        self.api.record = {"data": {"contract.json": json.dumps({**contract(**changes).as_dict(), "run": "1"})}}


NUMBERS = count()


def master_away(types: bool = False) -> Any:
    """With another reason each time."""
    raise RosError(f"away {next(NUMBERS)} {types}")


@pytest.fixture
def scene(monkeypatch: pytest.MonkeyPatch) -> Scene:
    return Scene(monkeypatch)


def test_a_pod_is_ready_once_its_nodes_are_in_the_graph(scene: Scene) -> None:
    scene.gates.take(pod())
    assert scene.api.conditions[-1] == ("new", "True", readiness.PROVEN + "c1")
    assert scene.at >= 0.5  # nothing said what it is still going to register
    scene.gates.take(pod(says="c1"))
    assert len([one for one in scene.api.conditions if one[1] == "True"]) == 1
    assert scene.log == ["robot-r1: talker-new is ready"]


def test_a_look_has_its_turn_and_the_pause_between_two_is_others(scene: Scene, monkeypatch: pytest.MonkeyPatch) -> None:
    turn, looks = BoundedSemaphore(1), list[bool]()
    state, sleep = scene.world.state, scene.gates.sleep

    def looked(types: bool = False) -> MasterState:
        looks.append(turn.acquire(blocking=False))
        return state(types)

    def slept(seconds: float) -> None:
        with turn:
            sleep(seconds)

    monkeypatch.setattr(scene.world, "state", looked)
    scene.gates.turn, scene.gates.sleep = turn, slept
    scene.gates.take(pod())
    assert len(looks) > 2
    assert not any(looks)


def test_until_then_its_condition_says_why_not(scene: Scene) -> None:
    scene.owe()
    scene.world.replies(OWN, bus=bus())
    scene.when = [(5.0, lambda: scene.world.replies(OWN, bus=bus(("/out", "/listener"))))]
    scene.gates.take(pod())
    said = [(status, text) for _uid, status, text in scene.api.conditions]
    assert said[-2:] == [
        ("False", f"not ready: edge {OWN} -> /out -> /listener: /listener is not connected to {OWN}"),
        ("True", readiness.PROVEN + "c1"),
    ]
    assert len(said) <= 3, said
    assert scene.api.read <= 7  # the record is not read at each of fifty looks


def test_what_waiting_cannot_mend_is_told_at_once(scene: Scene) -> None:
    scene.owe(topics={"/out": {"type": "std_msgs/Bool", "publishers": {OWN: {}}}})
    scene.when = [(0.3, lambda: scene.gates.pods.clear())]  # it is gone by then
    scene.gates.take(pod())
    ((_uid, status, text),) = scene.api.conditions
    assert (status, text[:60]) == ("False", "cannot become ready: topic /out: the type is std_msgs/String")


def test_the_reason_changes_once_a_second_at_most(scene: Scene, monkeypatch: pytest.MonkeyPatch) -> None:
    scene.owe()
    monkeypatch.setattr(scene.world, "state", master_away)
    scene.when = [(4.05, lambda: scene.gates.pods.clear())]
    scene.gates.take(pod())
    assert len(scene.api.conditions) in (4, 5)


def test_what_a_contract_says_is_proven_before_the_apps_own_command_has_passed(scene: Scene) -> None:
    """The kubelet, which waits for both, takes up to a second to count a gate."""
    scene.owe()
    scene.when = [(3.0, lambda: scene.gates.take(pod(says="c1", started=True)))]
    scene.gates.take(pod(started=False))
    assert scene.api.conditions == [("new", "True", readiness.PROVEN + "c1")]
    assert (scene.at >= 3.0, scene.log) == (True, ["robot-r1: talker-new is ready"])


def test_without_a_contract_the_command_says_that_all_is_registered(scene: Scene) -> None:
    scene.when = [(3.0, lambda: scene.gates.take(pod(says="c1", started=True)))]
    scene.gates.take(pod(started=False))
    assert scene.api.conditions[-2:] == [
        ("new", "False", "not ready: command readiness: it has not passed yet"),
        ("new", "True", readiness.PROVEN + "c1"),
    ]
    assert scene.at >= 3.0


@pytest.mark.parametrize("lost", [2.0, 3.0])
def test_what_is_lost_until_the_command_has_passed_takes_the_proof_back(scene: Scene, lost: float) -> None:
    """Also by the last look, which begins when that has."""
    scene.owe()
    scene.when = [
        (lost, lambda: scene.world.replies(OWN, bus=bus())),
        (3.0, lambda: scene.gates.take(pod(says="c1", started=True))),
        (3.6, lambda: scene.world.replies(OWN, bus=bus(("/out", "/listener")))),
    ]
    scene.gates.take(pod(started=False))
    assert [status for _uid, status, _text in scene.api.conditions] == ["True", "False", "True"]
    assert "/listener is not connected" in scene.api.conditions[1][2]
    assert scene.at >= 3.6


def test_the_last_look_begins_after_the_command_has_passed(scene: Scene, monkeypatch: pytest.MonkeyPatch) -> None:
    scene.owe()
    state = scene.world.state

    def passes_meanwhile(types: bool = False) -> MasterState:
        if scene.when and scene.at >= 1.2:
            scene.gates.take(pod(says="c1", started=True))
        return state(types)

    monkeypatch.setattr(scene.world, "state", passes_meanwhile)
    scene.when = [(1.6, lambda: scene.world.replies(OWN, bus=bus()))]
    scene.when += [(2.6, lambda: scene.world.replies(OWN, bus=bus(("/out", "/listener"))))]
    scene.gates.take(pod(started=False))
    assert [status for _uid, status, _text in scene.api.conditions] == ["True", "False", "True"]


@pytest.mark.parametrize(("passes", "times"), [(0.5, 1), (3.0, 2)])
def test_what_the_old_pod_latches_while_the_command_is_awaited_is_kept_too(
    scene: Scene, passes: float, times: int
) -> None:
    scene.owe()
    scene.places = {OWN: URI, "/talker_00000000": "http://127.0.0.9:1/"}
    scene.gates.take(pod("old", says="c1", address="127.0.0.9"))
    scene.when = [(passes, lambda: scene.gates.take(pod(says="c1", started=True)))]
    scene.gates.take(pod(started=False))
    assert scene.done == [("keep_latched", "/talker_00000000")] * times


def test_another_container_is_another_proof(scene: Scene) -> None:
    scene.gates.take(pod(runs="c2", says="c1"))
    assert scene.api.conditions[0] == ("new", "False", readiness.ANEW)
    assert scene.api.conditions[-1] == ("new", "True", readiness.PROVEN + "c2")
    scene.api.conditions.clear()
    scene.gates.take(pod(runs="", says="c2"))
    assert scene.api.conditions == [("new", "False", readiness.ENDED)]


def test_a_container_that_ends_meanwhile_is_looked_at_no_more(scene: Scene) -> None:
    scene.world.replies(OWN, bus=bus())
    scene.when = [(2.0, lambda: scene.gates.take(pod(runs="")))]
    scene.gates.take(pod())
    assert {status for _uid, status, _text in scene.api.conditions} == {"False"}
    assert not scene.gates.at_work


@pytest.mark.parametrize(("status", "again"), [(404, False), (409, False), (0, True), (500, True)])
def test_an_api_that_refuses(scene: Scene, status: int, again: bool) -> None:
    """What has gone needs no word; everything else is tried again."""
    scene.api.refuses = status
    scene.when = [(3.0, lambda: setattr(scene.api, "refuses", 0))]
    scene.gates.take(pod())
    assert bool(scene.api.conditions) == again


@pytest.mark.parametrize("ends", [False, True])
def test_a_pod_that_has_gone_before_its_turn_is_nobodys_trouble(scene: Scene, ends: bool) -> None:
    works: list[Callable[[], None]] = []
    scene.gates.start = works.append  # type: ignore[method-assign]
    scene.gates.take(pod(ends=ends))
    scene.gates.pods.clear()
    works[0]()
    assert (scene.log, scene.gates.at_work) == ([], set())


def test_what_the_old_pod_has_latched_is_kept_before_the_new_one_is_ready(scene: Scene) -> None:
    scene.places = {OWN: URI, "/talker_00000000": "http://127.0.0.9:1/", "/x": "http://["}
    old = pod("old", says="c1", address="127.0.0.9")
    scene.gates.take(old)
    scene.gates.take(pod("gone", address="127.0.0.8", ends=True))
    scene.gates.take(pod("third", says="c1", address=""))
    scene.done.clear()
    scene.looks = 0
    scene.gates.take(pod())
    assert scene.done == [("keep_latched", "/talker_00000000")]
    assert scene.services["/talker_00000000"] == {}
    assert scene.looks == 1  # at the master, however many pods the app has
    scene.gates.take({**old, "metadata": {**old["metadata"], "deletionTimestamp": "T"}})
    steps = ["unregister", "forget", "shut_down"]
    assert scene.done[1:] == [(step, "/talker_00000000") for step in steps]


@pytest.mark.parametrize(("on_host", "ended"), [(False, [(ADDRESS, "/")]), (True, [])])
def test_of_a_pod_that_ends_nothing_is_given_back(scene: Scene, on_host: bool, ended: list[tuple[str, str]]) -> None:
    """With its host's network the address is others', too."""
    ends = pod(ends=True)
    ends["spec"]["hostNetwork"] = on_host
    scene.gates.take(ends)
    assert scene.ended == ended


def test_a_pod_that_ends_by_itself_leaves_the_graph(scene: Scene) -> None:
    steps = ["keep_latched", "unregister", "forget", "shut_down"]
    scene.gates.take(pod())
    for _event in range(2):  # a second one finds nothing left, as the real node is gone
        scene.gates.take(pod(says="c1", ends=True))
    assert [step for step, _node in scene.done] == steps * 2
    assert scene.services == {OWN: {"/add": "rosrpc://h:2"}}
    scene.away = True  # without a master the node that was seen is ended
    scene.gates.take(pod(says="c1", ends=True))
    assert [step for step, _node in scene.done] == steps * 3
    scene.gates.seen.clear()
    scene.gates.take(pod(says="c1", ends=True))
    assert len(scene.done) == 12


def test_a_pod_that_ends_takes_no_other_robots_nodes_along(scene: Scene) -> None:
    """A pod's address is what its host says, on a master that robots share, too."""
    scene.places = dict.fromkeys(("/r1/talker_1", "/r1/deep/camera", "/r11/talker_1", "/map"), URI)
    scene.gates.take(knowing(pod(says="c1", ends=True), node="/r1/talker", space="/r1"))
    assert {node for _step, node in scene.done} == {"/r1/talker_1", "/r1/deep/camera"}
    assert scene.ended == [(ADDRESS, "/r1")]


@pytest.mark.parametrize("known", [{}, {"expect_node": False, "launch": "overlap"}])
@pytest.mark.parametrize(
    ("starting", "times", "evicted"),
    [
        (pod(), (3.0, 99.0), 1),
        (pod(), (3.0, 6.0), 0),  # it only takes its time
        (pod(), (-5.0, 99.0), 0),  # it was there before its pod
        (pod(), (3.0, None), 0),  # a master that does not answer says nothing of its nodes
        (pod(started=False), (3.0, 99.0), 0),  # it is still starting, and may register with the new master
    ],
)
def test_a_node_that_told_a_master_that_has_gone_is_begun_anew(
    scene: Scene, known: dict[str, Any], starting: Object, times: tuple[float, float | None], evicted: int
) -> None:
    """Whether a launch file names it or we. `times`: when the master was restarted, and when the node comes to it."""
    restarted, comes = times
    registered = dict(scene.world.publishers)
    scene.world.publishers = {"/in": ["/source"]}
    scene.world.subscribers, scene.world.services = {}, {}

    def restart() -> None:
        scene.restarted_at = restarted
        if comes is None:
            scene.world.state = master_away  # type: ignore[method-assign]

    come = (comes or 99.0, lambda: setattr(scene.world, "publishers", registered))
    scene.when = [(3.0, restart), come, (20.0, lambda: scene.gates.pods.clear())]
    scene.gates.take(knowing(starting, **known))
    assert len(scene.api.evicted) == evicted


def test_an_api_that_fails_just_then_keeps_no_node_from_being_begun_anew(
    scene: Scene, monkeypatch: pytest.MonkeyPatch
) -> None:
    vars(scene.world).update(publishers={"/in": ["/source"]}, subscribers={}, services={})
    evict, failures = scene.api.evict, iter([ApiError("it is away"), ApiError("busy", 429)])

    def fails(*asked: Any) -> None:
        for error in failures:
            raise error
        evict(*asked)

    monkeypatch.setattr(scene.api, "evict", fails)
    scene.when = [(3.0, lambda: setattr(scene, "restarted_at", 3.0)), (30.0, lambda: scene.gates.pods.clear())]
    scene.gates.take(pod())
    assert scene.api.evicted


def test_nothing_is_proven_by_a_master_that_has_not_been_given_all_back(scene: Scene) -> None:
    """A subscriber that it does not know may be there: whoever took it for one that left would lose its messages."""
    scene.whole_since = 30.0
    scene.gates.take(pod())
    *_, waits, proven = scene.api.conditions
    assert waits == ("new", "False", f"not ready: master {scene.world.uri}: {FORGETFUL}")
    assert proven == ("new", "True", readiness.PROVEN + "c1")
    assert scene.at >= 30.0


def test_pods_without_our_gate_are_nobodys_business(scene: Scene) -> None:
    plain = pod()
    plain["spec"] = {}
    scene.gates.take(plain)
    scene.gates.take({**pod(), "metadata": {**pod()["metadata"], "annotations": {}}})
    assert not scene.gates.pods


def test_it_follows_what_happens(scene: Scene) -> None:
    def event(kind: str, version: str, item: Object | None = None) -> Object:
        made = item or {"metadata": {}}
        return {"type": kind, "object": {**made, "metadata": {**made["metadata"], "resourceVersion": version}}}

    scene.api.there = [pod("old", says="c1")]
    scene.api.events = [event("ADDED", "2", pod()), event("DELETED", "3", pod("old")), event("BOOKMARK", "9")]
    scene.gates.seen["gone"] = cast("readiness.OwnNode", None)  # while nobody told of it
    assert scene.gates.follow("") == "9"
    assert (list(scene.gates.pods), list(scene.gates.seen)) == (["new"], ["new"])
    scene.api.events = [{"type": "ERROR", "object": {"message": "etcd is away", "code": 500}}]
    with pytest.raises(ApiError, match="etcd is away") as error:  # so there is a pause before it is asked again
        scene.gates.follow("9")
    assert error.value.status == 500


def test_an_api_that_is_away_is_told_of_once(scene: Scene, monkeypatch: pytest.MonkeyPatch) -> None:
    found = iter(
        ["7", ApiError("too old", 410), ApiError("it is away"), ApiError("it is away"), ValueError("bad"), "8"]
    )
    asked: list[str] = []

    def follow(version: str) -> str:
        asked.append(version)
        one: Any = next(found, None)
        if one is None:
            scene.gates.over = True
            return ""
        if isinstance(one, Exception):
            raise one
        return str(one)

    monkeypatch.setattr(scene.gates, "follow", follow)
    scene.gates.run()
    assert asked == ["", "7", "", "", "", "", "8"]
    told = ["it is away", "ValueError: bad", "the Kubernetes API answers"]
    assert scene.log == [f"robot-r1: readiness of pods: {words}" for words in told]
    assert scene.at == 3 * readiness.AGAIN


@pytest.mark.parametrize("status", [403, 404])
def test_a_namespace_that_refuses_is_asked_ever_more_seldom(scene: Scene, status: int) -> None:
    """It may be gone, and its robot still listed; or be a new one, whose Role the API does not know yet."""
    asked, gone = list[float](), list[bool]()

    def refused(_namespace: str) -> tuple[list[Object], str]:
        asked.append(scene.at)
        if scene.at < 1500:
            raise ApiError("no", status)
        scene.gates.over = True
        return [pod(says="c1")], "1"

    scene.api.pods_since = refused  # type: ignore[method-assign]
    scene.gates.pods = {"old": pod("old")}  # looked at just now
    scene.when = [(1.5, lambda: gone.extend([not scene.gates.pods]))]
    scene.gates.run()
    assert gone == [True]
    pauses = [after - before for before, after in pairwise(asked)]
    assert pauses == [1, 2, 4, 8, 16, 32, 64, 128, 256, *[readiness.SELDOM] * 4]
    assert [line.rpartition(": ")[2] for line in scene.log] == ["no", "the Kubernetes API answers"]
    assert not scene.gates.pods


class ManyApi(Api):
    """A cluster of robots that share a master, each with a pod."""

    def __init__(self) -> None:
        super().__init__()
        self.robots: list[str] = []
        self.said: list[tuple[str, str, str]] = []
        self.away = False

    def namespaces(self) -> list[str]:
        if self.away:
            raise ApiError("away")
        return ["fleet", *self.robots]

    def pods_since(self, namespace: str) -> tuple[list[Object], str]:
        name = namespace.rpartition("-")[2]
        made = knowing(pod(f"of-{name}", address=f"10.0.0.{name[1:]}"), node=f"/{name}/talker", space=f"/{name}")
        return [made] if namespace in self.robots else [], "1"

    def set_condition(self, namespace: str, item: Object, condition: Object) -> None:
        self.said.append((namespace, item["metadata"]["name"], condition["status"]))


def test_one_keeper_opens_the_gates_of_all_robots(scene: Scene, monkeypatch: pytest.MonkeyPatch) -> None:
    """Of those that join, too; and it ends with those that go. Both robots' apps have one name."""
    api, threads, gates = ManyApi(), dict[str, readiness.Readiness](), dict[str, readiness.Readiness]()
    nodes = {f"/r{number}/talker_0a1b2c3d": f"http://10.0.0.{number}:1/" for number in (1, 2)}
    scene.world.publishers = {f"{node}/out": [node] for node in nodes}
    scene.world.subscribers, scene.world.services = {}, {}
    answers = {node: NodeAnswer(uri, 71, bus=[], publications=[], subscriptions=[]) for node, uri in nodes.items()}
    scene.world.answers, scene.world.sums, scene.world.hz = answers, {}, {}
    scene.places = nodes

    def made(namespace: str) -> readiness.Readiness:
        one = replace(scene.gates, cluster=cast("Cluster", api), namespace=namespace)
        monkeypatch.setattr(one, "start", lambda work: threads.update({namespace: one}) if work == one.run else work())
        gates[namespace] = one
        return one

    every = readiness.AllGates(cast("Cluster", api), made)
    api.robots = ["robot-r1"]
    every.look()
    assert [*threads] == ["fleet", "robot-r1"]
    api.robots.append("robot-r2")
    every.look()
    assert [*threads] == ["fleet", "robot-r1", "robot-r2"]  # none of them twice
    for one in threads.values():
        one.follow("")
    ready = [(namespace, name) for namespace, name, status in api.said if status == "True"]
    assert ready == [(f"robot-r{number}", f"talker-of-r{number}") for number in (1, 2)]
    assert [*threads["robot-r2"].pods] == ["of-r2"]
    api.robots.remove("robot-r1")
    every.look()
    assert {space: one.over for space, one in gates.items()} == {"fleet": False, "robot-r1": True, "robot-r2": False}
    gates["robot-r1"].run()  # its thread, back from its last watch
    assert not gates["robot-r1"].pods
    api.robots.append("robot-r1")  # a robot of that name joins
    every.look()
    assert threads["robot-r1"] is gates["robot-r1"] is not threads["robot-r2"]
    assert not gates["robot-r1"].over


def test_an_api_that_is_away_ends_nobodys_gates() -> None:
    class StopError(BaseException):
        """The loop has no end of its own."""

    api, sleep = ManyApi(), Mock(side_effect=[None, StopError])
    api.away = True
    every = readiness.AllGates(cast("Cluster", api), pytest.fail, sleep, {"fleet": cast("readiness.Readiness", None)})
    with pytest.raises(StopError):
        every.run()
    assert ([*every.gates], sleep.mock_calls) == (["fleet"], [call(REFRESH)] * 2)


def test_what_the_version_before_sends_is_listened_to_once() -> None:
    class Ros:
        listened = 0

        def rates(self, graph: Graph, seconds: Any, patient: bool) -> dict[str, Rate]:
            assert patient
            assert [*seconds] == [*graph.topics] == ["/out"]
            self.listened += 1
            (key,) = graph.topic("/out").publishers
            return {"/out": Rate(9.0, 9, 1.0, by={key: Rate(9.0, 9, 1.0, known=9.0)})}

        def handshakes(self, graph: Graph, _topics: Any) -> dict[str, Handshake]:
            return {"/out": Handshake(graph.topic("/out").publishers[0], "aa", latching=True)}

    old, other, peer = NodeKey("/a", "u"), NodeKey("/b", "v"), NodeKey("/c", "w")
    topics = {
        "/out": Topic("/out", publishers=(old, other), subscribers=(peer,), connections=((old, peer), (other, peer))),
        "/unheard": Topic("/unheard", publishers=(old,)),
    }
    graph, ros = Graph({key: Node(*key) for key in (old, other, peer)}, topics), Ros()
    sent = readiness.Sent(cast("Backend", ros))
    for _look in range(2):
        found = sent(graph, ["/a"]).topic("/out")
        assert (dict(found.rates), found.md5sum, found.latched) == ({old: 9.0}, "aa", (old,))
    assert ros.listened == 1
