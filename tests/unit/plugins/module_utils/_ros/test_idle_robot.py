# SPDX-License-Identifier: GPL-3.0-or-later
from __future__ import annotations

import threading
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

import pytest
from ansible_collections.rosops.fleet.plugins.module_utils._common.errors import RosError, SpecError
from ansible_collections.rosops.fleet.plugins.module_utils._common.poll import FAIL, PASS, WAIT, Seen
from ansible_collections.rosops.fleet.plugins.module_utils._ros import idle_robot
from ansible_collections.rosops.fleet.plugins.module_utils._ros.backend import MasterState
from ansible_collections.rosops.fleet.plugins.module_utils._ros.checks import Check
from ansible_collections.rosops.fleet.plugins.module_utils._ros.client import Ros1Client
from ansible_collections.rosops.fleet.plugins.module_utils._ros.gate import Look
from ansible_collections.rosops.fleet.plugins.module_utils._ros.idle_robot import SECOND_LOOK, Held, hold_when_idle
from ansible_collections.rosops.fleet.plugins.module_utils._ros.listener import Listener

WORK = {"/work": "/worker"}


@dataclass
class Robot:
    """What it shows is a list of spans with goals; looking takes a tenth of a second."""

    busy: list[tuple[float, float]] = field(default_factory=list)
    refuses: str = ""
    broken_from: float = 1e9
    time: float = 0.0
    told: list[str] = field(default_factory=list)

    def now(self) -> float:
        return self.time

    def sleep(self, seconds: float) -> None:
        self.time += seconds

    def look(self) -> Seen:
        seen = any(start <= self.time < end for start, end in self.busy)
        self.time += 0.1
        if self.time > self.broken_from:
            return Seen(FAIL, "broken")
        return Seen(WAIT, "1 goal active") if seen else Seen(PASS, "idle")

    def hold(self, servers: Mapping[str, str]) -> Mapping[str, str]:
        self.told += [f"hold {action} of {server}" for action, server in servers.items()]
        return dict.fromkeys(servers, self.refuses)

    def isolate(self, servers: Mapping[str, str]) -> None:
        self.told += [f"isolate {server}" for server in servers.values()]
        assert not {*servers} - {"/work"}

    def release(self, actions: Iterable[str]) -> Mapping[str, str]:
        self.told += [f"release {action}" for action in actions]
        return dict.fromkeys(actions, "")


def held(robot: Robot, timeout: float = 60, servers: dict[str, str] | None = None) -> Held:
    return hold_when_idle(robot, WORK if servers is None else servers, timeout, 0.2, now=robot.now, sleep=robot.sleep)


@pytest.mark.parametrize(
    ("robot", "ended", "lasts"),
    [
        (Robot(), (PASS, True, 0), (0, 1)),
        (Robot(busy=[(0, 5)]), (PASS, True, 0), (5, 7)),  # a goal under way is waited for
        # idle in both looks, and a goal of 25 s came before the keeper held: the server has it, and finishes it
        (Robot(busy=[(0.15, 25)]), (PASS, True, 1), (25, 27)),
        # a short one is no reason to let go
        (Robot(busy=[(0.15, 0.15 + SECOND_LOOK / 2)]), (PASS, True, 0), (1, 3)),
        (Robot(busy=[(0.15, 99)]), (WAIT, False, 1), (60, 61)),  # nothing stays held when the time is over
        (Robot(broken_from=0.25), (FAIL, False, 1), (0, 1)),  # nor where it cannot be looked at
        # without a keeper an idle action is enough
        (Robot(refuses="nothing listens there"), (PASS, False, 0), (0, 1)),
    ],
)
def test_goals_are_held_when_none_is_under_way(
    robot: Robot, ended: tuple[str, bool, int], lasts: tuple[float, float]
) -> None:
    found = held(robot)
    assert (found.verdict, found.held == ("/work",), robot.told.count("release /work")) == ended
    assert lasts[0] <= robot.time <= lasts[1]
    assert (robot.told[-1] == "release /work") is (found.verdict != PASS)  # else held, and looked at once more
    assert found.problems == ((f"goals of /work are not held: {robot.refuses}",) if robot.refuses else ())
    assert robot.told.count("isolate /worker") >= 2 or robot.refuses or found.verdict == FAIL


def test_who_does_not_wait_looks_twice() -> None:
    assert held(Robot(), timeout=0).verdict == PASS
    robot = Robot(busy=[(0, 9)])
    ended = held(robot, timeout=0)
    assert (ended.verdict, robot.told, ended.last) == (WAIT, [], "1 goal active")
    assert robot.time < 1


def test_a_keeper_that_refuses_or_answered_too_late() -> None:
    robot = Robot(refuses="no answer within 4 s", busy=[(0.15, 99)])
    assert held(robot, timeout=1).held == ()
    assert robot.told[-1] == "release /work"  # it may hold, too
    assert "isolate /worker" not in robot.told, "its clients' goals would be lost"


# ---- the jobs of a step

KEEPER, SERVER = "http://10.43.0.18:11411", "/worker_1a2b3c4d_79d9c6f8b5"  # in its pod
ACTIONS = [{"name": "/work", "server": "/worker_1a2b3c4d"}, {"name": "/drive"}]
ENDS = {"/work/status": (SERVER,)}, {"/work/goal": (SERVER, "/gui"), "/work/cancel": (SERVER,)}
ASKED = {
    "master_uri": "http://m:1", "keeper_uri": KEEPER, "actions": ACTIONS, "seconds": 7.0, "timeout": 1,
    "interval": 0.05,
}  # fmt: skip


class World:
    """What the jobs ask and do; `held` are answers of the keeper, one after the other, the last one stays."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.calls, self.looked, self.heard, self.told = (list[Any]() for _one in range(4))
        self.found = Check("action", "/work", PASS, "1 goal active")
        self.says, self.held = "", list[Any]([{"/work": {}, "/other": {}}])
        self.together: threading.Barrier | None = None
        monkeypatch.setattr(idle_robot, "look", self.look)
        monkeypatch.setattr(idle_robot, "tell_publishers", lambda *told: self.told.append(told[:3]))
        monkeypatch.setattr(idle_robot.KeeperCalls, "hold", lambda _keeper, *asked: self.ask("hold", *asked))
        monkeypatch.setattr(idle_robot.KeeperCalls, "release", lambda _keeper, *asked: self.ask("release", *asked))
        monkeypatch.setattr(idle_robot.KeeperCalls, "held", lambda _keeper: self.answer())
        monkeypatch.setattr(Ros1Client, "state", lambda _self: MasterState(*ENDS))
        monkeypatch.setattr(Ros1Client, "addresses", lambda _self, names: ({one: one for one in names},))

    def look(self, _ros: Any, conditions: Any, ears: Any) -> Look:
        self.heard.append(ears)
        self.looked.append([(action.name, action.state, action.server) for action in conditions.actions])
        return Look(self.found.verdict, [self.found])

    def ask(self, *asked: Any) -> str:
        self.calls.append(asked)
        if self.together:
            self.together.wait(timeout=30)  # passed by all together, or by none
        return self.says

    def answer(self) -> Any:
        answer = self.held.pop(0) if len(self.held) > 1 else self.held[0]
        if isinstance(answer, Exception):
            raise answer
        return answer


@pytest.fixture
def world(monkeypatch: pytest.MonkeyPatch) -> World:
    return World(monkeypatch)


def hold(**changes: Any) -> dict[str, Any]:
    return idle_robot.hold({**ASKED, **changes})


def release(timeout: float = 0, *actions: str) -> dict[str, Any]:
    asked = {"keeper_uri": KEEPER, "actions": actions or ["/work"], "timeout": timeout, "interval": 0.01}
    return idle_robot.release(asked)


def test_all_have_to_be_idle_and_those_with_a_server_are_held(world: World) -> None:
    assert hold() == {"changed": True, "verdict": PASS, "reason": "", "held": ["/work"]}
    assert world.calls == [("hold", "/work", SERVER, 7.0)]
    assert world.told[0] == (SERVER, "/work/goal", [])
    assert world.looked[0] == [("/work", "idle", "/worker_1a2b3c4d"), ("/drive", "idle", "")]
    assert {*world.heard} == {None}


@pytest.mark.parametrize(
    ("changes", "looks"), [({"keeper_uri": ""}, 2), ({"actions": [{"name": "/work"}]}, 2), ({"seconds": 0}, 1)]
)
def test_who_only_looks_holds_nothing(world: World, changes: dict[str, Any], looks: int) -> None:
    assert hold(**changes) == {"changed": False, "verdict": PASS, "reason": "", "held": []}
    assert (world.calls, len(world.looked)) == ([], looks)


def test_a_master_that_is_silent_just_then_and_a_keeper_that_cannot_are_told(
    world: World, monkeypatch: pytest.MonkeyPatch
) -> None:
    world.says = "nothing listens there"
    assert (hold()["held"], hold()["reason"]) == ([], "goals of /work are not held: nothing listens there")

    def silent(_self: Any) -> None:
        raise RosError("no answer")

    monkeypatch.setattr(Ros1Client, "state", silent)
    assert (hold()["held"], hold()["reason"]) == ([], "goals of /work are not held: no answer")


def test_what_messages_must_say_is_listened_to_from_look_to_look(world: World, monkeypatch: pytest.MonkeyPatch) -> None:
    """And for longer than this call lasts, if need be: then it is not so yet."""
    closed = list[Listener]()
    monkeypatch.setattr(Listener, "close", lambda ears: closed.append(ears))
    hold(values=[{"topic": "/cmd_vel", "quiet": 5.0}])
    assert len(world.looked) > 1
    (ears,) = {*world.heard}
    assert ears.__func__ is Listener.checks
    assert closed == [ears.__self__]  # a keeper goes on, and would read for ever
    with pytest.raises(SpecError, match=r"values\[0\]"):
        hold(values=[{"topic": "/cmd_vel"}])


@pytest.mark.parametrize("verdict", [WAIT, FAIL])
@pytest.mark.parametrize(("kind", "said"), [("action", "1 goal active"), ("value", "value /work: 1 goal active")])
def test_busy_is_an_answer(world: World, verdict: str, kind: str, said: str) -> None:
    """Of messages with their topic; an action's reason has its server."""
    world.found = Check(kind, "/work", verdict, "1 goal active")
    assert hold(timeout=0) == {"changed": False, "verdict": verdict, "reason": said, "held": []}
    assert world.calls == []


def test_a_keeper_that_hangs_is_asked_for_all_actions_at_once(world: World) -> None:
    """One after the other, the first of fifteen would be let go by itself before the last one is held."""
    names = [f"/work{number}" for number in range(8)]
    world.together = threading.Barrier(len(names))
    assert hold(actions=[{"name": name, "server": "/worker"} for name in names])["held"] == names
    world.held = [dict.fromkeys(names)]
    assert release(0, *names)["changed"]


def test_what_is_held_and_nothing_else_is_let_go_also_by_a_keeper_that_is_away_for_a_moment(world: World) -> None:
    world.held[:0] = [ConnectionRefusedError("nothing listens there"), RosError("no answer")]
    assert release(30) == {"changed": True}
    assert world.calls == [("release", "/work")]
    world.held = [{}]
    assert release() == {"changed": False}
    world.held = [{"/work": {}}]
    world.says = "it hung up"
    with pytest.raises(RosError, match="it hung up"):
        release()
    world.held = [ConnectionRefusedError("nothing listens there")]
    with pytest.raises(RosError, match="nothing listens there"):
        release()
