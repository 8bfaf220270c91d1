# SPDX-License-Identifier: GPL-3.0-or-later
from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

import pytest
from ansible_collections.rosops.fleet.plugins.module_utils._common.poll import FAIL, PASS, WAIT, Seen
from ansible_collections.rosops.fleet.plugins.module_utils._ros.idle_hold import SECOND_LOOK, Held, hold_when_idle

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
    assert (found.verdict, found.held == ("/work",), found.called_off) == ended
    assert lasts[0] <= found.elapsed <= lasts[1]
    assert robot.told.count("release /work") == found.called_off
    assert (robot.told[-1] == "release /work") is (found.verdict != PASS)  # else held, and looked at once more
    assert found.problems == ((f"goals of /work are not held: {robot.refuses}",) if robot.refuses else ())
    assert robot.told.count("isolate /worker") >= 2 or robot.refuses or found.verdict == FAIL


def test_who_does_not_wait_looks_twice() -> None:
    assert held(Robot(), timeout=0).verdict == PASS
    robot = Robot(busy=[(0, 9)])
    ended = held(robot, timeout=0)
    assert (ended.verdict, robot.told, ended.last) == (WAIT, [], "1 goal active")
    assert ended.elapsed < 1


def test_a_keeper_that_refuses_or_answered_too_late() -> None:
    robot = Robot(refuses="no answer within 4 s", busy=[(0.15, 99)])
    assert held(robot, timeout=1).held == ()
    assert robot.told[-1] == "release /work"  # it may hold, too
    assert "isolate /worker" not in robot.told, "its clients' goals would be lost"


def test_an_action_that_only_has_to_rest_is_not_held() -> None:
    robot = Robot()
    assert held(robot, servers={}).held == ()
    assert robot.told == []
