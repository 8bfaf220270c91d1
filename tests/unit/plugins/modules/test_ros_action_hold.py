# SPDX-License-Identifier: GPL-3.0-or-later
from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Any

import pytest
from ansible_collections.rosops.fleet.plugins.module_utils._common.errors import RosError
from ansible_collections.rosops.fleet.plugins.module_utils._common.poll import FAIL, PASS, WAIT
from ansible_collections.rosops.fleet.plugins.module_utils._ros import idle_robot
from ansible_collections.rosops.fleet.plugins.module_utils._ros.backend import MasterState
from ansible_collections.rosops.fleet.plugins.module_utils._ros.checks import Check
from ansible_collections.rosops.fleet.plugins.module_utils._ros.gate import Look
from ansible_collections.rosops.fleet.plugins.module_utils._ros.listener import Listener
from ansible_collections.rosops.fleet.plugins.modules import ros_action_hold

KEEPER = "http://10.43.0.18:11411"
ACTIONS = [{"name": "/work", "server": "/worker_1a2b3c4d"}, {"name": "/drive"}]
SERVER = "/worker_1a2b3c4d_79d9c6f8b5"  # in its pod
ENDS = {"/work/status": (SERVER,)}, {"/work/goal": (SERVER, "/gui"), "/work/cancel": (SERVER,)}


class FakeKeeper:
    calls: list[tuple[Any, ...]] = []  # noqa: RUF012 - one per test
    there: dict[str, Any] = {}  # noqa: RUF012
    says = ""

    def __init__(self, uri: str, caller: str) -> None:
        assert uri in (KEEPER, "")
        assert caller

    def hold(self, *params: Any) -> str:
        self.calls.append(("hold", *params))
        return self.says

    def release(self, action: str) -> str:
        self.calls.append(("release", action))
        return self.says

    def held(self) -> dict[str, Any]:
        return self.there


class Run:
    def __init__(self, monkeypatch: pytest.MonkeyPatch, main: Callable[..., dict[str, Any]]) -> None:
        self.main, self.looked, self.heard, self.verdict = main, list[Any](), list[Any](), PASS
        monkeypatch.setattr(FakeKeeper, "calls", [])
        monkeypatch.setattr(ros_action_hold, "KeeperCalls", FakeKeeper)
        monkeypatch.setattr(idle_robot, "look", self.look)
        self.told = list[Any]()
        monkeypatch.setattr(ros_action_hold.Ros1Client, "state", lambda _self: MasterState(*ENDS))
        monkeypatch.setattr(idle_robot, "tell_publishers", lambda *told: self.told.append(told[:3]))
        monkeypatch.setattr(
            ros_action_hold.Ros1Client, "addresses", lambda _self, names: ({one: one for one in names},)
        )

    def look(self, _ros: Any, conditions: Any, ears: Any) -> Look:
        self.heard.append(ears)
        self.looked.append([(action.name, action.state, action.server) for action in conditions.actions])
        return Look(self.verdict, [Check("action", "/work", self.verdict, "1 goal active")])

    def __call__(self, **params: Any) -> dict[str, Any]:
        return self.main(ros_action_hold, **{"actions": ACTIONS, "interval": 0.05, **params})


@pytest.fixture
def run(monkeypatch: pytest.MonkeyPatch, main: Callable[..., dict[str, Any]]) -> Run:
    return Run(monkeypatch, main)


def test_all_have_to_be_idle_and_those_with_a_server_are_held(run: Run) -> None:
    result = run(keeper_uri=KEEPER, seconds=7)
    assert (result["changed"], result["verdict"], result["held"]) == (True, PASS, ["/work"])
    assert FakeKeeper.calls == [("hold", "/work", SERVER, 7.0)]
    assert run.told[0] == (SERVER, "/work/goal", [])
    assert run.looked[0] == [("/work", "idle", "/worker_1a2b3c4d"), ("/drive", "idle", "")]


def test_a_master_that_is_silent_just_then_is_told(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    def silent(_self: Any) -> None:
        raise RosError("no answer")

    monkeypatch.setattr(ros_action_hold.Ros1Client, "state", silent)
    result = run(keeper_uri=KEEPER)
    assert (result["held"], FakeKeeper.calls) == ([], [])
    assert result["reason"].endswith("goals of /work are not held: no answer")


def test_what_messages_must_say_is_listened_to_from_look_to_look(run: Run) -> None:
    """And for longer than this call lasts, if need be: then it is not so yet."""
    run(keeper_uri=KEEPER, timeout=1, values=[{"topic": "/cmd_vel", "quiet": 5.0}])
    assert len(run.looked) > 1
    (ears,) = {*run.heard}
    assert ears.__func__ is Listener.checks
    bad = run(keeper_uri=KEEPER, values=[{"topic": "/cmd_vel"}])
    assert (bad["failed"], bad["errors"][0].partition(":")[0]) == (True, "values[0]")
    run(keeper_uri=KEEPER)
    assert run.heard[-1] is None


def test_what_messages_say_instead_is_told_with_its_topic(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    check = Check("value", "/battery percentage above 0.4", WAIT, "is 0.2, not above 0.4")
    monkeypatch.setattr(idle_robot, "look", lambda *_given, **_more: Look(WAIT, [check]))
    assert run(timeout=0)["reason"] == "value /battery percentage above 0.4: is 0.2, not above 0.4"


def test_busy_is_an_answer_and_no_failure(run: Run) -> None:
    run.verdict = WAIT
    result = run(keeper_uri=KEEPER, timeout=0)
    assert (result.get("failed"), result["changed"], result["verdict"]) == (None, False, WAIT)
    assert result["reason"] == "1 goal active"
    assert FakeKeeper.calls == []


def test_what_cannot_be_seen_is_a_failure(run: Run) -> None:
    run.verdict = FAIL
    result = run(keeper_uri=KEEPER)
    assert result["failed"]
    assert "1 goal active" in result["msg"]


@pytest.mark.parametrize("params", [{}, {"keeper_uri": KEEPER, "_ansible_check_mode": True}])
def test_check_mode_and_a_robot_without_keeper_only_look(run: Run, params: dict[str, Any]) -> None:
    result = run(**params)
    assert (result["changed"], result["verdict"], result["held"]) == (False, PASS, [])
    assert FakeKeeper.calls == []


def test_for_no_seconds_nothing_is_held_and_one_look_is_enough(run: Run) -> None:
    result = run(keeper_uri=KEEPER, seconds=0)
    assert (result["changed"], result["verdict"], result["held"]) == (False, PASS, [])
    assert (FakeKeeper.calls, len(run.looked)) == ([], 1)


def test_a_keeper_that_cannot_is_a_warning(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    warned: list[str] = []
    monkeypatch.setattr(FakeKeeper, "says", "nothing listens there")
    # Ansible keeps warnings per process, so that what other tests did would matter
    monkeypatch.setattr(ros_action_hold.AnsibleModule, "warn", lambda _self, text: warned.append(text))
    result = run(keeper_uri=KEEPER)
    assert (result["changed"], result["verdict"]) == (False, PASS)
    assert warned == ["goals of /work are not held: nothing listens there"]
    assert result["reason"] == warned[0]


@pytest.mark.parametrize("state", ["held", "released"])
def test_a_keeper_that_hangs_is_asked_for_all_actions_at_once(
    run: Run, monkeypatch: pytest.MonkeyPatch, state: str
) -> None:
    """One after the other, the first of fifteen would be let go by itself before the last one is held."""
    actions = [{"name": f"/work{number}", "server": "/worker"} for number in range(8)]
    asked = threading.Barrier(len(actions))

    def hang(_self: FakeKeeper, *_params: Any) -> str:
        asked.wait(timeout=30)  # passed by all together, or by none
        return ""

    monkeypatch.setattr(FakeKeeper, "hold", hang)
    monkeypatch.setattr(FakeKeeper, "release", hang)
    monkeypatch.setattr(FakeKeeper, "there", {action["name"]: {} for action in actions})
    result = run(keeper_uri=KEEPER, state=state, actions=actions)
    assert (result["changed"], result["reason"]) == (True, "")


def test_release_lets_go_what_is_held_and_nothing_else(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(FakeKeeper, "there", {"/work": {}, "/other": {}})
    assert run(keeper_uri=KEEPER, state="released")["changed"]
    assert FakeKeeper.calls == [("release", "/work")]
    monkeypatch.setattr(FakeKeeper, "there", {})
    assert not run(keeper_uri=KEEPER, state="released")["changed"]


def test_release_in_check_mode_and_without_success(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(FakeKeeper, "there", {"/work": {}})
    assert run(keeper_uri=KEEPER, state="released", _ansible_check_mode=True)["changed"]
    assert FakeKeeper.calls == []
    monkeypatch.setattr(FakeKeeper, "says", "it hung up")
    result = run(keeper_uri=KEEPER, state="released", timeout=0)
    assert (result["failed"], result["held"], result["msg"]) == (True, ["/work"], "it hung up")


def test_a_keeper_that_is_away_for_a_moment_is_told_to_let_go(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    """A kubelet that starts again takes it out of its Service for some seconds."""
    answers: list[Any] = [ConnectionRefusedError("nothing listens there"), RosError("no answer"), {"/work": {}}]

    def held(_self: FakeKeeper) -> dict[str, Any]:
        answer = answers.pop(0)
        if isinstance(answer, Exception):
            raise answer
        return dict(answer)

    monkeypatch.setattr(FakeKeeper, "held", held)
    assert run(keeper_uri=KEEPER, state="released", timeout=30)["changed"]
    assert FakeKeeper.calls == [("release", "/work")]
    answers.append(ConnectionRefusedError("nothing listens there"))
    assert run(keeper_uri=KEEPER, state="released", timeout=0)["msg"] == "nothing listens there"


def test_release_needs_a_keeper(run: Run) -> None:
    assert "keeper_uri" in run(state="released")["msg"]
