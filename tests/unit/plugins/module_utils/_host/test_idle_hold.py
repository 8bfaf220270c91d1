# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

from ansible_collections.rosops.fleet.plugins.module_utils._common.poll import FAIL, PASS, WAIT, Seen
from ansible_collections.rosops.fleet.plugins.module_utils._host.idle_hold import SECOND_LOOK, Held, hold_when_idle

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

    def isolate(self, action: str, server: str) -> None:
        self.told.append(f"isolate {server}")
        assert action == "/work"

    def release(self, actions: Iterable[str]) -> Mapping[str, str]:
        self.told += [f"release {action}" for action in actions]
        return dict.fromkeys(actions, "")


def held(robot: Robot, timeout: float = 60, servers: dict[str, str] | None = None) -> Held:
    return hold_when_idle(robot, WORK if servers is None else servers, timeout, 0.2, now=robot.now, sleep=robot.sleep)


def test_an_idle_server_is_held_and_looked_at_again() -> None:
    robot = Robot()
    ended = held(robot)
    assert (ended.verdict, ended.held, ended.called_off) == (PASS, ("/work",), 0)
    assert robot.told == ["hold /work of /worker", "isolate /worker", "isolate /worker"]
    assert ended.elapsed < 1


def test_a_goal_under_way_is_waited_for() -> None:
    robot = Robot(busy=[(0, 5)])
    ended = held(robot)
    assert (ended.verdict, ended.held) == (PASS, ("/work",))
    assert ended.elapsed > 5


def test_a_goal_that_slips_in_before_the_hold_is_left_to_finish() -> None:
    """Idle in both looks, and a goal of 25 s came before the keeper held: the server has it."""
    robot = Robot(busy=[(0.15, 25)])
    ended = held(robot)
    assert (ended.verdict, ended.held, ended.called_off) == (PASS, ("/work",), 1)
    assert ended.elapsed > 25
    assert robot.told.count("release /work") == 1
    assert robot.told[-1] == "isolate /worker", "released, then held again once it was idle"


def test_a_short_goal_that_slips_in_is_no_reason_to_let_go() -> None:
    robot = Robot(busy=[(0.15, 0.15 + SECOND_LOOK / 2)])
    ended = held(robot)
    assert (ended.verdict, ended.called_off, ended.held) == (PASS, 0, ("/work",))


def test_nothing_stays_held_when_the_time_is_over() -> None:
    robot = Robot(busy=[(0.15, 99)])
    ended = held(robot, timeout=1)
    assert (ended.verdict, ended.held, ended.last) == (WAIT, (), "1 goal active")
    assert robot.told[-1] == "release /work"


def test_who_does_not_wait_looks_twice() -> None:
    assert held(Robot(), timeout=0).verdict == PASS
    robot = Robot(busy=[(0, 9)])
    ended = held(robot, timeout=0)
    assert (ended.verdict, robot.told) == (WAIT, [])
    assert ended.elapsed < 1


def test_without_a_keeper_an_idle_action_is_enough_and_it_is_told() -> None:
    robot = Robot(refuses="nothing listens there")
    ended = held(robot)
    assert (ended.verdict, ended.held) == (PASS, ())
    assert ended.problems == ("goals of /work are not held: nothing listens there",)
    assert "isolate /worker" not in robot.told, "its clients' goals would be lost"


def test_a_keeper_that_answered_too_late_is_told_to_let_go() -> None:
    robot = Robot(refuses="no answer within 4 s", busy=[(0.15, 99)])
    assert held(robot, timeout=1).held == ()
    assert robot.told[-1] == "release /work"


def test_an_action_that_only_has_to_rest_is_not_held() -> None:
    robot = Robot()
    assert held(robot, servers={}).held == ()
    assert robot.told == []


def test_what_cannot_be_looked_at_is_let_go() -> None:
    robot = Robot(broken_from=0.25)
    ended = held(robot)
    assert (ended.verdict, ended.held) == (FAIL, ())
    assert robot.told[-1] == "release /work"
