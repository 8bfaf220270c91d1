# SPDX-License-Identifier: GPL-3.0-or-later
"""Whether a robot may be changed now, and the holds of other updates: the real door, holds and `rosops-may`."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from typing import Any

import pytest
from ansible_collections.rosops.fleet.plugins.module_utils._common.errors import RosError
from ansible_collections.rosops.fleet.plugins.module_utils._robot import door
from ansible_collections.rosops.fleet.plugins.module_utils._robot.door import AT_ONCE, UNTOLD
from ansible_collections.rosops.fleet.plugins.module_utils._ros.jobs import JOBS
from ansible_collections.rosops.fleet.plugins.module_utils._ros.keeper_client import FORGETFUL
from ansible_collections.rosops.fleet.plugins.module_utils._ros.raw_node import Asked
from ansible_collections.rosops.fleet.tests.unit.plugins.module_utils._robot.robot_at_the_door import (
    OTHERS,
    OWNER,
    SPACE,
    World,
    at_the_door,
    lease_of,
    rosops_may,
)

MAY = rosops_may()
Says = Callable[..., "tuple[int, str]"]


@pytest.fixture
def world(monkeypatch: pytest.MonkeyPatch) -> Iterator[World]:
    with at_the_door(monkeypatch) as made:
        yield made


@pytest.fixture
def may(world: World, capsys: pytest.CaptureFixture[str]) -> Says:
    def run(*words: str) -> tuple[int, str]:
        code = MAY.main(["robot1", *words], world.send)
        return code, capsys.readouterr().err.removeprefix("rosops-may: robot1: ").strip()

    return run


def ask(world: World, path: str, method: str = "GET", **query: str) -> tuple[int, Any]:
    said = world.door.page(Asked(method, path, query))
    assert said.kind == "application/json"
    return said.status, json.loads(said.body)


# --- may it be changed now? -------------------------------------------------------------------------------------------


def test_a_robot_at_rest_may_be_changed(world: World, may: Says) -> None:
    assert may() == (0, "")
    assert ask(world, "/v1/may-change")[1] == {"go": True, "reason": "", "holder": "", "lease": "", "held": []}
    assert world.leases_now == {}


@pytest.mark.parametrize(
    ("why", "reason", "free"),
    [
        (lambda world: world.goal("/base/drive"), "busy on /base: 1 ACTIVE", "arm"),
        (lambda world: world.values.update({"/battery": False}), "value /battery percentage above 0.4: not so", ""),
        # what one app waits for is waited for before anything is done to all of the robot
        (lambda world: world.values.update({"/dock": False}), "value /dock quiet for 3 s: not so", "base"),
        (
            lambda world: setattr(world, "begin", world.begin + 6 * 3600),
            "it may be changed from 2026-07-02 00:00 (Europe/Berlin) on",
            "",
        ),
        *(
            (lambda world, holder=holder: lease_of(holder, world), f"{holder} changes it since before", "")
            for holder in (OTHERS, f"{OWNER}mender", "ros-keeper")
        ),
    ],
)
def test_why_it_may_not(world: World, may: Says, why: Callable[[World], None], reason: str, free: str) -> None:
    """`free` is the app that is not concerned."""
    why(world)
    for words in (), ("--app", "arm"), ("--app", "base"):
        goes = bool(words) and words[1] == free
        assert may(*words) == ((0, "") if goes else (75, f"not now: {reason}"))
        assert may(*words, "--hold", "60", "--owner", "apt")[0] == (0 if goes else 75)
        may("--release", "--owner", "apt")
        assert world.held_until == {}


def test_what_cannot_be_known_is_no_answer(world: World, may: Says) -> None:
    assert may("--app", "lidar") == (1, "answered 404: there is no app lidar; there are arm, base")
    world.master_away = True
    assert may() == (1, "answered 503: the ROS master does not answer")
    world.maps.clear()
    assert may() == (1, f"answered 404: {UNTOLD}")
    world.maps[SPACE, "robot-rest"] = {"data": {"rest.json": '{"apps": 3}'}}
    assert may() == (1, f"answered 404: {UNTOLD}")
    world.away = True
    assert may() == (1, "answered 503: the API server is away")
    assert ask(world, "/v1/may-change") == (503, {"error": "nothing listens"})


def test_a_change_that_begins_while_it_is_looked_is_seen(world: World, may: Says) -> None:
    world.sleeps = lambda: None if world.holder else (lease_of(OTHERS, world), None)[1]
    assert may() == (75, "not now: its Lease changed hands just now")


def test_it_is_only_asked_and_not_by_too_many(world: World) -> None:
    assert ask(world, "/v1/hold", "POST") == (405, {"error": "only GET is answered here"})
    assert ask(world, "/v1/nothing") == (404, {"error": "there is no /v1/nothing"})
    assert ask(world, "/v1/apps", namespace="robot-robot2")[0] == 404
    for _one in range(AT_ONCE):
        world.door.turns.acquire()
    assert ask(world, "/v1/apps") == (503, {"error": f"{AT_ONCE} others ask just now"})


def test_graph_and_apps(world: World) -> None:
    graph = ask(world, "/v1/graph")[1]
    assert sorted(graph["actions"]) == ["/arm/move", "/base/drive"]
    assert ask(world, "/v1/apps")[1]["arm"] == {"state": "unknown", "revision": "rev2", "soaks": False}


# --- holds ------------------------------------------------------------------------------------------------------------

HOLD = ("--hold", "120", "--owner", "apt")
RELEASE = ("--release", "--owner", "apt")


def test_new_goals_wait_until_the_owner_lets_go(world: World, may: Says) -> None:
    assert may(*HOLD) == (0, "")
    assert (world.holder, sorted(world.held_until)) == (f"{OWNER}apt", ["/arm/move", "/base/drive"])
    assert ask(world, "/v1/may-change", owner="apt")[1]["held"] == ["/arm/move", "/base/drive"]
    world.goal("/arm/move")
    world.run(60)
    assert world.goals == {}
    assert may() == (75, f"not now: {world.holder} changes it since {world.leases_now[SPACE]['spec']['acquireTime']}")
    assert may("--release", "--owner", "mender") == (0, "")  # it is not his
    assert world.holder == f"{OWNER}apt"
    assert may(*RELEASE) == (0, "")
    assert (world.holder, world.held_until, world.goals["/arm/move"]) == ("", {}, 1)
    assert may(*RELEASE) == (0, "")


def test_of_one_app_its_own_goals_wait(world: World, may: Says) -> None:
    assert may("--app", "arm", *HOLD) == (0, "")
    assert [*world.held_until] == ["/arm/move"]
    world.goal("/base/drive")
    assert may("--app", "base", *HOLD)[0] == 75  # the owner has the robot, and that app is at work
    assert (world.holder, [*world.held_until]) == (f"{OWNER}apt", ["/arm/move"])
    world.goals.clear()
    assert may("--app", "base", *HOLD) == (0, "")
    assert sorted(world.held_until) == ["/arm/move", "/base/drive"]


def test_it_may_be_made_longer(world: World, may: Says) -> None:
    assert may(*HOLD)[0] == 0
    world.run(100)
    assert may(*HOLD)[0] == 0
    world.goal("/arm/move")
    world.run(110)
    assert (world.holder, world.goals) == (f"{OWNER}apt", {})
    world.values["/battery"] = False  # by the owner's own work, for all we know
    assert may(*HOLD)[0] == 75
    assert (world.holder, len(world.held_until)) == (f"{OWNER}apt", 2)
    world.run(20)
    assert (world.holder, world.held_until) == ("", {})


def test_another_server_that_comes_meanwhile_gets_no_goals_either(world: World, may: Says) -> None:
    assert may(*HOLD)[0] == 0
    world.let_go("/arm/move")  # as the keeper does where a new one is up
    world.run(10)
    assert sorted(world.held_until) == ["/arm/move", "/base/drive"]
    assert world.held_until["/arm/move"] == world.held_until["/base/drive"]


def test_a_goal_that_came_in_between_is_left_to_finish(world: World, may: Says) -> None:
    world.before("hold", lambda *_: world.goal("/base/drive"))
    assert may(*HOLD) == (75, "not now: busy on /base: 2 ACTIVE")
    assert (world.holder, world.held_until) == ("", {})


def test_what_cannot_be_held_is_told(world: World, may: Says) -> None:
    world.hold = lambda *_: "the keeper refused: off"  # type: ignore[method-assign]
    code, told = may("--app", "arm", *HOLD)
    assert (code, told) == (0, "goals of /arm/move are not held: the keeper refused: off")


def test_goals_that_a_run_holds_by_now_are_not_let_go(world: World, may: Says) -> None:
    """The owner is gone by his Lease, and the run was faster than the keeper's look."""
    assert may(*HOLD)[0] == 0
    lease_of("", world)
    lease_of(OTHERS, world)
    world.hold("/arm/move", "/arm", 60.0)
    world.run(10)
    assert "/arm/move" in world.held_until
    lease_of("", world)
    world.run(10)
    assert "/arm/move" in world.held_until  # they end by themselves


def test_a_hold_that_is_made_longer_as_it_ends_does_not_end(world: World, may: Says) -> None:
    assert may(*HOLD)[0] == 0
    world.before("write_lease", lambda *_: lease_of(f"{OWNER}apt", world, 120), once=True)
    world.run(125)
    held = {**world.held_until}
    world.run(10)
    assert (world.holder, len(world.held_until)) == (f"{OWNER}apt", 2)
    assert held == {} or min(held.values()) > world.at - 10


def test_nobody_takes_what_another_one_took_at_the_same_time(world: World, may: Says) -> None:
    world.before("send", lambda method, *_: lease_of(OTHERS, world) if method in ("PUT", "POST") else None)
    assert may(*HOLD) == (75, "not now: somebody else was faster")
    assert world.holder == OTHERS


def test_nobody_takes_what_was_changed_since_it_was_looked_at(world: World, may: Says) -> None:
    lease_of("", world)
    asked: list[str] = []

    def changed(method: str, path: str, _body: Any) -> None:
        asked.append(f"{method} {path.rpartition('/')[2]}")
        if asked[1:] == ["GET robot-update"]:
            lease_of(OTHERS, world)
            lease_of("", world)

    world.before("send", changed)
    assert may(*HOLD) == (75, "not now: somebody else began to change it just now")
    assert world.holder == ""


def test_what_goes_wrong_after_it_was_taken_gives_it_back(world: World, may: Says) -> None:
    real, asked = world.send, list[str]()

    def fails(method: str, path: str, body: Any) -> tuple[int, Any]:
        asked.append(path)
        if "/proxy/" in path and len(asked) == 4:
            return 500, {"message": "the door is away"}
        return real(method, path, body)

    world.send = fails  # type: ignore[method-assign]
    assert may(*HOLD) == (1, "answered 500: the door is away")
    assert (world.holder, world.held_until) == ("", {})


# --- jobs of an update ------------------------------------------------------------------------------------------------


def post(world: World, name: str, body: Any, **query: str) -> tuple[int, Any]:
    data = body if isinstance(body, bytes) else json.dumps(body).encode()
    said = world.door.page(Asked("POST", f"/v1/jobs/{name}", query, body=data))
    return said.status, json.loads(said.body)


@pytest.fixture
def jobs(monkeypatch: pytest.MonkeyPatch) -> list[tuple[str, Any]]:
    """Those that were done, with their arguments."""
    done: list[tuple[str, Any]] = []
    made = {name: lambda given, name=name: {"done": done.append((name, dict(given)))} for name in JOBS}
    monkeypatch.setattr(door, "JOBS", made)
    return done


def test_questions_of_an_update_are_answered_to_whoever_asks(world: World, jobs: list[tuple[str, Any]]) -> None:
    for name in ("graph", "ready", "hold"):
        assert post(world, name, {"master_uri": "http://elsewhere", "timeout": 1.0})[0] == 200
    assert jobs == [(name, {"master_uri": world.uri, "timeout": 1.0}) for name in ("graph", "ready", "hold")]


@pytest.mark.parametrize("result", [{"verdict": "pass"}, {"graph": {}}])
def test_a_master_that_was_begun_anew_is_asked_until_it_has_all_again(
    world: World, monkeypatch: pytest.MonkeyPatch, result: dict[str, Any]
) -> None:
    """What it does not know yet would be taken for what has left."""
    asked: list[float] = []
    monkeypatch.setattr(door, "JOBS", {"ready": lambda _given: asked.append(world.at) or result})
    world.whole_since = world.at + 3
    assert post(world, "ready", {}) == (200, result)
    assert asked[-1] >= world.whole_since > asked[-2]
    world.whole_since = world.at + 60
    found = post(world, "ready", {})[1]
    assert (found["failed"], found["msg"].endswith(FORGETFUL)) == (True, True)
    assert post(world, "ready", {"timeout": 1.0})[1]["failed"]
    monkeypatch.setattr(door, "JOBS", {"ready": lambda _given: {"verdict": "wait"}})
    assert post(world, "ready", {}) == (200, {"verdict": "wait"})


def test_a_master_that_is_busy_for_a_moment_is_not_asked_all_once_more(
    world: World, monkeypatch: pytest.MonkeyPatch
) -> None:
    looks = iter([False, False, True])
    monkeypatch.setattr(world.door, "is_whole", lambda _since: next(looks))
    monkeypatch.setattr(door, "JOBS", {"ready": lambda _given: {"verdict": "pass", "at": world.at}})
    asked = world.at
    assert post(world, "ready", {}) == (200, {"verdict": "pass", "at": asked})
    assert world.at == asked + 2 * door.MOMENT


def test_a_robot_whose_master_was_begun_anew_is_not_changed(world: World, may: Says) -> None:
    world.whole_since = world.at + 60
    assert may() == (75, f"not now: the ROS master: {FORGETFUL}")
    world.whole_since = 0.0
    assert may() == (0, "")


CHANGES = [("register", {}), ("reap", {}), ("release", {"keeper_uri": "x"}), ("hold", {"keeper_uri": "x"})]


@pytest.mark.parametrize(("name", "given"), CHANGES)
def test_a_change_is_done_for_the_holder_of_the_lease_alone(
    world: World, jobs: list[tuple[str, Any]], name: str, given: dict[str, Any]
) -> None:
    me = "host 1, process 2 (ab12)"
    assert post(world, name, given, holder=me) == (
        200,
        {"failed": True, "msg": f"nobody changes this robot now, and not {me}"},
    )
    lease_of(OTHERS, world)
    for holder in (me, ""):
        assert post(world, name, given, holder=holder)[1]["failed"]
    assert jobs == []
    lease_of(me, world)
    assert post(world, name, given, holder=me)[0] == 200
    assert [one for one, _given in jobs] == [name]
    assert jobs[0][1].get("keeper_uri") == (world.uri if given else None)  # its own, whatever is said


def test_what_is_no_job(world: World, jobs: list[tuple[str, Any]]) -> None:
    assert post(world, "reboot", {})[0] == 404
    assert post(world, "graph", b"[1")[0] == 404
    assert post(world, "graph", [1])[0] == 404
    assert post(world, "ready", {"timeout": 901})[0] == post(world, "graph", {"rate_seconds": float("nan")})[0] == 404
    for wrong in ({"interval": 0}, {"interval": 901}, {"node_timeout": 1e9}, {"timeout": [1]}, {"interval": "soon"}):
        assert post(world, "hold", wrong)[0] == 404
    assert post(world, "graph", b"[" * 100_000)[0] == post(world, "graph", b'{"a": ' + b"9" * 1_000_000)[0] == 404
    assert post(world, "graph", {}, namespace="robot-robot2") == (
        404,
        {"error": "this keeper does not look after robot-robot2"},
    )
    assert jobs == []


def test_what_goes_wrong_in_a_job_is_its_result(world: World, monkeypatch: pytest.MonkeyPatch) -> None:
    def fails(_given: Any) -> Any:
        raise RosError("the master does not answer", looks=3)

    monkeypatch.setattr(door, "JOBS", {"graph": fails})
    assert post(world, "graph", {}) == (200, {"failed": True, "msg": "the master does not answer", "looks": 3})
