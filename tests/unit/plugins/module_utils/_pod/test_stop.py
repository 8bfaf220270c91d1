# SPDX-License-Identifier: GPL-3.0-or-later
"""The stop hook's order of things, on a fake clock and a fake node."""

from __future__ import annotations

import contextlib
import threading
import time
from collections.abc import Callable, Sequence
from typing import Any
from unittest.mock import Mock

import pytest
from ansible_collections.rosops.fleet.plugins.module_utils._pod import stop as stop_command
from ansible_collections.rosops.fleet.plugins.module_utils._pod.own_node import OwnNode
from ansible_collections.rosops.fleet.plugins.module_utils._pod.state import Settings
from ansible_collections.rosops.fleet.plugins.module_utils._ros.graph import StatusReading

IDLE, ACTIVE, DONE = StatusReading(((), ())), StatusReading(((1,),)), StatusReading(((3,), (3,)))


class Node(OwnNode):
    """What is done to it stands in `done`, with the time. What is in `hanging` takes all the time that it is given."""

    def __init__(self, statuses: dict[str, list[StatusReading]] | None = None) -> None:
        super().__init__("/server", "", {}, Settings("/server"))
        self.at = 0.0
        self.statuses = statuses or {}
        self.under_way: list[int] = []
        self.unkept = ""
        self.done: list[tuple[str, float]] = []
        self.raising: set[str] = set()
        self.hanging: set[str] = set()

    def now(self) -> float:
        return self.at

    def sleep(self, seconds: float) -> None:
        self.at += seconds

    def together(self, tasks: Sequence[Callable[[], Any]], seconds: float, failed: Any = stop_command.why) -> list[Any]:
        """All begin at the same time, and none is waited for longer than said."""
        began, ended, found = self.at, self.at, []
        for task in tasks:
            self.at = began
            try:
                found.append(task())
            except OSError as error:
                found.append(failed(error))
            ended = max(ended, self.at)
        assert ended <= began + max(seconds, 0.2) + 1e-6
        self.at = ended
        return found

    def _note(self, what: str, seconds: float = 0.0) -> None:
        self.done.append((what, round(self.at, 3)))
        if what.split()[0] in self.raising:
            raise OSError("it is gone")
        if what.split()[0] in self.hanging:
            self.at += seconds
            raise TimeoutError("timed out")

    @property
    def order(self) -> list[str]:
        """Without repetitions."""
        return list(dict.fromkeys(what for what, _at in self.done))

    def actions(self, seconds: float = 2.0) -> list[str]:
        self._note("actions", seconds)
        return list(self.statuses)

    def status(self, action: str, seconds: float = 2.0) -> StatusReading:
        if "status" in self.hanging:
            self.at += seconds
            return StatusReading(error="timed out")
        self.at += 0.2  # servers say it five times a second
        readings = self.statuses[action]
        return readings.pop(0) if len(readings) > 1 else readings[0]

    def isolate(self, action: str, seconds: float = 2.0) -> None:
        self._note(f"isolate {action}", seconds)

    def calls(self, seconds: float = 2.0) -> int:
        self._note("calls", seconds)
        return self.under_way.pop(0) if self.under_way else 0

    def hand_over(self, seconds: float = 2.0) -> str:
        self._note("hand_over", seconds)
        return self.unkept

    def unregister(self, seconds: float = 2.0) -> None:
        self._note("unregister", seconds)

    def forget(self, seconds: float = 2.0) -> None:
        self._note("forget", seconds)

    def shut_down(self, seconds: float = 2.0) -> None:
        with contextlib.suppress(TimeoutError):
            self._note("shutdown", seconds)


def stop(node: Node, hold: Any = None, expect_node: bool = True, deadline: float = 30) -> list[str]:
    clock = stop_command.Time(deadline, node.now, node.sleep, node.together)
    return stop_command.stop([node], expect_node, hold, clock)


def held(node: Node) -> stop_command.Hold:
    def hold(action: str, server: str, seconds: float, within: float) -> str:
        assert server == "/server"
        assert seconds >= 300
        node._note(f"hold {action}", within)
        return ""

    return hold


END = ["calls", "hand_over", "unregister", "forget", "shutdown"]


def test_a_node_without_actions_ends_at_once() -> None:
    node = Node()
    assert stop(node) == []
    order = ["actions", "calls", "hand_over", "unregister", "forget", "calls", "shutdown"]
    assert [what for what, _at in node.done] == order
    assert node.at == 0


@pytest.mark.parametrize(
    ("statuses", "calls", "ends", "remarks"),
    [
        ({}, [2] * 400, 20.0, []),  # a plan, a map that is saved: no matter which handoff the app has
        ({}, [1] * 1000, 27.0, ["stopped with 1 service calls under way"]),  # as long as the deadline allows
        ({}, [0, 1, 1], 0.1, []),  # they came before the service was taken away
        ({"/move": [ACTIVE, ACTIVE, IDLE, ACTIVE, DONE, DONE]}, [], 1.1, []),  # one idle look is not enough
        ({"/a": [IDLE], "/b": [ACTIVE, ACTIVE, IDLE]}, [], 0.8, []),  # all actions have to rest
    ],
)
def test_what_is_under_way_is_let_end(
    statuses: dict[str, list[StatusReading]], calls: list[int], ends: float, remarks: list[str]
) -> None:
    node = Node(statuses)
    node.under_way = calls
    assert stop(node, held(node)) == remarks
    assert dict(node.done)["shutdown"] == pytest.approx(ends, abs=0.11)
    assert node.at < 30
    assert {f"hold {action}" for action in statuses} <= {*node.order}


def test_nodes_that_the_app_names_itself_are_drained_and_left_to_roslaunch() -> None:
    node = Node({"/move_base": [ACTIVE, ACTIVE, IDLE]})
    node.under_way = [1, 1]
    assert stop(node, held(node), expect_node=False) == []
    assert node.order == ["actions", "hold /move_base", "isolate /move_base", "calls", "hand_over", "unregister"]
    assert node.statuses["/move_base"] == [IDLE]


def test_an_idle_server_is_cut_off_before_it_is_stopped() -> None:
    node = Node({"/move": [IDLE]})
    assert stop(node, held(node)) == []
    assert node.order == ["actions", "hold /move", "isolate /move", *END]
    assert [what for what, _at in node.done].count("isolate /move") == 2  # seen idle twice, each time after a cut


def test_a_server_that_is_cut_off_late_is_cut_off(monkeypatch: pytest.MonkeyPatch) -> None:
    node = Node({"/move": [IDLE]})
    monkeypatch.setattr(node, "isolate", Mock(side_effect=[OSError("it is busy"), None, None]))
    assert stop(node, held(node)) == []


@pytest.mark.parametrize(
    ("hold", "remark"),
    [
        (None, "goals of /move are not held: there is no keeper"),
        (lambda *_: "nothing listens at x", "goals of /move are not held: nothing listens at x"),
    ],
)
def test_without_a_keeper_it_drains_without_cutting_off(hold: Any, remark: str) -> None:
    """Goals of a client that is cut off would be lost with nobody to hold them."""
    node = Node({"/move": [ACTIVE, IDLE]})
    assert stop(node, hold) == [remark]
    assert "isolate /move" not in node.order
    assert node.order[-5:] == END


@pytest.mark.parametrize(("total", "share"), [(30.0, 27.0), (3.0, 2.0)])
def test_the_deadline_holds_and_says_what_was_cut_short(total: float, share: float) -> None:
    node = Node({"/move": [ACTIVE]})
    remarks = stop(node, held(node), deadline=total)
    assert remarks == [f"stopped with open goals after {remarks[0].split()[5]} s: /move busy on /server: 1 ACTIVE"]
    assert share <= dict(node.done)["shutdown"] <= share + 0.5
    assert node.at <= total


EVERYTHING = ("actions", "hold", "isolate", "status", "calls", "hand_over", "unregister", "forget", "shutdown")


@pytest.mark.parametrize("hanging", [*((one,) for one in EVERYTHING), EVERYTHING, EVERYTHING[1:]])
@pytest.mark.parametrize("deadline", [30.0, 6.0, 2.0])
def test_whoever_hangs_the_stop_ends_in_time(hanging: tuple[str, ...], deadline: float) -> None:
    """The kubelet kills the node otherwise, in the middle of a goal of another action."""
    node = Node({f"/action{number}": [ACTIVE] for number in range(12)})
    node.hanging = {*hanging}
    stop(node, held(node), deadline=deadline)
    assert "shutdown" in node.order
    assert node.at <= deadline + 0.3


def test_what_is_done_together_waits_for_nobody_who_hangs() -> None:
    ended, fails = threading.Event(), Mock(side_effect=OSError("it is gone"))
    began = time.monotonic()
    found = stop_command.together([lambda: 1, fails, lambda: ended.wait(60)], 0.2)
    ended.set()
    assert time.monotonic() - began < 30
    assert found == [1, "OSError: it is gone", found[2]]
    assert found[2].endswith("timed out")


def test_the_time_to_find_the_node_belongs_to_the_stop(monkeypatch: pytest.MonkeyPatch) -> None:
    """Eight calls of whoever hangs, two seconds each, were not counted."""
    wanted = Settings("/x", expect_node=True, stop_deadline=4)
    found, stopped = Mock(return_value=([Node()], "")), Mock(return_value=[])
    for name, fake in (("load_settings", lambda _environ: wanted), ("own_nodes", found), ("stop", stopped)):
        monkeypatch.setattr(stop_command, name, fake)
    began = time.monotonic()
    assert stop_command.main([]) == 0
    found.assert_called_once_with(wanted, pytest.approx(0.5))
    assert began + 4 <= stopped.call_args.args[-1].end <= time.monotonic() + 4


def test_what_the_keeper_does_not_take_is_said() -> None:
    node = Node()
    node.unkept = "/map: 90000000 bytes"
    assert stop(node) == ["what /server has latched goes with it: /map: 90000000 bytes"]
    node.raising = {"hand_over"}
    assert stop(node) == ["what /server has latched goes with it: OSError: it is gone"]


@pytest.mark.parametrize("expect_node", [True, False])
@pytest.mark.parametrize("what", ["calls", "hand_over", "unregister", "forget", "actions", "isolate", "hold"])
def test_whatever_fails_the_node_is_drained_and_stopped(what: str, expect_node: bool) -> None:
    node = Node({"/move": [ACTIVE, ACTIVE, IDLE, IDLE]})
    node.raising = {what}
    remarks = stop(node, held(node), expect_node)
    assert ("shutdown" if expect_node else "unregister") in node.order
    assert node.statuses["/move"] == [IDLE] or what in ("actions", "hold")
    assert bool(remarks) == (what != "calls" and (expect_node or what != "forget"))
    assert what != "isolate" or remarks == ["clients of /move were not cut off from it: OSError: it is gone"]


def test_main_never_fails(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    told: list[str] = []
    monkeypatch.setattr(stop_command, "tell", told.append)
    monkeypatch.setattr(stop_command, "load_settings", Mock(side_effect=RuntimeError("no such thing")))
    assert stop_command.main([]) == 0
    assert told == ["rosops.fleet: stop hook: RuntimeError: no such thing"]
    monkeypatch.setattr(stop_command, "load_settings", lambda _environ: Settings("/x", stop_deadline=30))
    monkeypatch.setattr(stop_command, "own_nodes", lambda *_: ([], "no node is registered from here"))
    assert stop_command.main([]) == 0
    assert told[1:] == ["rosops.fleet: left to SIGTERM: no node is registered from here"]
    assert capsys.readouterr().out == ""
