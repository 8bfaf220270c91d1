# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Robots that drive, dock and lose charge as they like: no step begins against what their messages say."""

from __future__ import annotations

import os
import random
from bisect import bisect
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

from ansible_collections.rosops.fleet.plugins.plugin_utils._update.world import Object
from ansible_collections.rosops.fleet.tests.unit.plugins.plugin_utils._update.scenarios import begin, settings
from ansible_collections.rosops.fleet.tests.unit.plugins.plugin_utils._update.simulation import BEAT, Simulation

SCHEDULES = 100 if os.environ.get("ROSOPS_TEST_ALL") else 30
STILL = 2.0
# Between the look that found all well and the change: calls to the keeper and the cluster. Who drives off then is at
# work beside the change, as with a goal that comes in the same moment.
BETWEEN = 3.0


@dataclass(frozen=True)
class Day:
    """What is so from which second on."""

    times: list[float]
    values: list[Any]

    def at(self, time: float) -> Any:
        return self.values[bisect(self.times, time) - 1]

    def among(self, since: float, until: float) -> list[Any]:
        return self.values[bisect(self.times, since) - 1 : bisect(self.times, until)]


def day(chance: random.Random, value: Callable[[], Any], begin: float) -> Day:
    """Something else every 1 to 30 seconds, for half an hour, and then no more."""
    times, values = [0.0], [value()]
    while times[-1] < begin + 1800.0:
        times.append(max(times[-1], begin) + chance.uniform(1.0, 30.0))
        values.append(value())
    return Day(times, values)


class Robot:
    """Its schedule, as messages and as the truth."""

    def __init__(self, chance: random.Random, sim: Simulation) -> None:
        self.battery = day(chance, lambda: chance.choice((0.15, 0.39, 0.41, 0.9)), sim.time)
        self.speed = day(chance, lambda: chance.choice((0.0, 0.0, 0.7, -0.2)), sim.time)
        self.docked = day(chance, lambda: chance.random() < 0.5, sim.time)
        sim.messages = {
            "/battery": lambda time: {"percentage": self.battery.at(time)},
            "/odom": lambda time: {"twist": {"linear": {"x": self.speed.at(time)}}},
            "/docked": lambda time: {"data": self.docked.at(time)},
        }

    def permits(self, when: Object, time: float) -> bool:
        """Some time in the moment before it."""
        moments = [time - BETWEEN + BEAT * number for number in range(round(BETWEEN / BEAT) + 1)]
        return any(all(TRUTH[one["topic"]](self, moment) for one in when) for moment in moments)


TRUTH: dict[str, Callable[[Robot, float], bool]] = {
    "/battery": lambda robot, time: robot.battery.at(time) > 0.4,
    "/odom": lambda robot, time: not any(robot.speed.among(time - STILL + BEAT, time)),
    "/docked": lambda robot, time: bool(robot.docked.at(time)),
}
ASKED = (
    {"topic": "/battery", "field": "percentage", "above": 0.4},
    {"topic": "/odom", "field": "twist.linear", "still": STILL},
    {"topic": "/docked", "field": "data", "equals": True},
)


def run_on_schedule(number: int, counted: Counter[str]) -> None:
    chance = random.Random(number)  # noqa: S311 - a schedule
    sim, wanted = begin(chance.choice(("overlap", "drain", "replace", "group", "two-steps")), "good")
    when = chance.sample(ASKED, chance.randint(1, 3))
    robot, wanted = Robot(chance, sim), replace(wanted, when=when)
    sim.advance(chance.uniform(0.0, 60.0))
    policy = chance.choice(("wait", "wait", "defer"))
    look, since, outcome = chance.choice((None, 0.0, 8.0)), dict[str, float](), "waiting"
    while outcome == "waiting":
        found = sim.run(wanted, settings(on_busy=policy, busy_timeout=300.0, look_timeout=look, since=since))
        assert found is not None
        counted[outcome := found.outcome] += 1
        since, look = sim.engine.waiting, 8.0
        sim.advance(chance.uniform(0.0, 20.0))  # other robots have their turn
    assert outcome == "deferred-busy" or (outcome == "updated" and sim.steps), found
    counted["steps"] += len(sim.steps)
    against = [time for time in sim.steps if not robot.permits(when, time)]
    assert not against, f"schedule {number}: begun after {against} s against {when}"


def test_no_step_begins_against_what_messages_say() -> None:
    counted = Counter[str]()
    for number in range(SCHEDULES):
        run_on_schedule(number, counted)
    # else it shows nothing
    assert min(counted["updated"], counted["deferred-busy"], counted["waiting"]) >= SCHEDULES / 10, counted
    assert counted["steps"] >= SCHEDULES / 2, counted
