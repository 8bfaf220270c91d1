# SPDX-License-Identifier: GPL-3.0-or-later
"""A control node that dies at any moment of any playbook, and nobody who looks after it for ten minutes.

Every robot of the lab has a run of its own, which is killed at a moment of its own: with ten robots a round is ten
kills, some of them at the same time. ROSOPS_TEST_KILLS (60) is how many there are in all, ROSOPS_TEST_STILL (600) how
many seconds nobody does anything afterwards, ROSOPS_TEST_SEED draws the moments.
"""

from __future__ import annotations

import os
import random
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import pytest
from fleet import ALL_AT_ONCE, Fleet, Variables
from runs import Run, Running

KILLS = int(os.environ.get("ROSOPS_TEST_KILLS", "60"))
STILL = float(os.environ.get("ROSOPS_TEST_STILL", "600"))
SEED = os.environ.get("ROSOPS_TEST_SEED", "robots")
AT_ONCE = 4  # runs
PLAYBOOKS = ("site", "update", "rollback")
GOOD = ("temperature", "add-two-ints", "prime-factors")
# Versions that the gate must refuse: one that dies, one that nobody can hear, one that is slower.
BAD = (
    ("temperature", {"CRASH_AFTER": 0.3}),
    ("temperature", {"NEVER_CONNECT": "true"}),
    ("temperature", {"RATE_HZ": 10}),
    ("prime-factors", {"CRASH_AFTER": 0.3}),
)


@dataclass(frozen=True)
class Kill:
    """One run of one robot, and the moment of its end as a share of the time that such a run takes."""

    robot: str
    playbook: str
    app: str
    wrong: tuple[tuple[str, Any], ...]
    moment: float

    def __str__(self) -> str:
        version = ", ".join(f"{name}={value}" for name, value in self.wrong) or "good"
        return f"{self.robot}: {self.playbook} of {self.app} ({version}) killed at {self.moment:.0%}"


def drawn(robots: list[str], count: int, seed: str) -> list[list[Kill]]:
    """The kills in rounds of one for each robot; every other one has a version that must be refused.

    A rollback goes to a version that was proven once, so the bad ones are those of the two other playbooks.
    """
    lots = random.Random(seed)  # noqa: S311 - which moment it is, is no secret
    kills: list[Kill] = []
    for number in range(count):
        bad = number % 2 == 1
        playbook = lots.choice(PLAYBOOKS[:2]) if bad else PLAYBOOKS[number // 2 % 3]
        app, wrong = lots.choice(BAD) if bad else (lots.choice(GOOD), {})
        robot = robots[number % len(robots)]
        kills.append(Kill(robot, playbook, app, tuple(wrong.items()), lots.uniform(0.02, 1.0)))
    return [kills[at : at + len(robots)] for at in range(0, count, len(robots))]


def wanted_of(fleet: Fleet, kill: Kill) -> Variables:
    """The inventory that the run has. A rollback's is the fleet's own: what it brings is the one before."""
    if kill.playbook == "rollback":
        return {**fleet.variables, "update_apps": [kill.app]}
    return fleet.new_version(kill.robot, kill.app, **dict(kill.wrong))


def start(fleet: Fleet, kill: Kill, wanted: Variables) -> Running:
    limit = ("--limit", f"{kill.robot},edge1")
    patience = {"update_ready_timeout": 30 + 5 * AT_ONCE}  # runs share the machine
    return fleet.playbooks.start(kill.playbook, {**wanted, **ALL_AT_ONCE, **patience}, "-v", *limit)


def batches(fleet: Fleet, kills: Sequence[Kill], wanted: Mapping[Kill, Variables]) -> Iterator[Mapping[Kill, Running]]:
    """Their runs, as many as may go at the same time: the machine is not what is tested."""
    for at in range(0, len(kills), AT_ONCE):
        yield {kill: start(fleet, kill, wanted[kill]) for kill in kills[at : at + AT_ONCE]}


def usual_seconds(fleet: Fleet, robots: list[str]) -> float:
    """How long an update of one app takes. Every app of every robot has a version to go back to then."""
    wanted = fleet.variables
    for app in GOOD:
        wanted = fleet.new_version("robots", app, wanted)
    run = fleet.update(wanted, **ALL_AT_ONCE).must(0)
    kills = [Kill(robot, "update", GOOD[0], (), 1.0) for robot in robots[:AT_ONCE]]
    longest = 0.0
    for run in ended(fleet, kills, {kill: wanted_of(fleet, kill) for kill in kills}).values():
        assert run.status == 0, run
        longest = max(longest, run.ended - run.began)
    fleet.settle()
    return longest


def ended(fleet: Fleet, kills: Sequence[Kill], wanted: Mapping[Kill, Variables]) -> dict[Kill, Run]:
    """Their runs, to the end."""
    return {kill: run.finish() for runs in batches(fleet, kills, wanted) for kill, run in runs.items()}


def killed(fleet: Fleet, kills: Sequence[Kill], wanted: Mapping[Kill, Variables], seconds: float) -> dict[Kill, str]:
    """Their runs, each killed at its moment; the last line that each printed."""
    found = {}
    for runs in batches(fleet, kills, wanted):
        for kill, run in sorted(runs.items(), key=lambda one: one[0].moment):
            time.sleep(max(0.0, run.began + kill.moment * seconds - time.time()))  # the moment is the case
            run.kill()
            found[kill] = (run.output.strip().splitlines() or [""])[-1]
    return found


@pytest.mark.faults
def test_control_node_dies_at_any_moment(fleet: Fleet) -> None:
    robots = fleet.robots
    rounds = drawn(robots, KILLS, SEED)
    seconds = usual_seconds(fleet, robots)
    fleet.figures.append(f"an update of one app takes up to {seconds:.0f} s")
    problems: list[str] = []
    for kills in rounds:
        fleet.settle()
        problems += one_round(fleet, kills, seconds)
        print("\n".join([*fleet.figures, *problems]), flush=True)  # a run takes hours
    assert not problems, "\n".join(problems)


def one_round(fleet: Fleet, kills: list[Kill], seconds: float) -> list[str]:
    """What went wrong with these."""
    before = fleet.revisions()
    watch = fleet.watch()
    wanted = {kill: wanted_of(fleet, kill) for kill in kills}
    last = killed(fleet, kills, wanted, seconds)
    time.sleep(STILL)  # nobody does anything: that is the case, too

    problems = []
    for kill in kills:
        told = f"{kill}, in the line {last[kill][:100]!r}"
        fleet.figures.append(told)
        losses = watch.losses(kill.robot, patience=180)[kill.robot]
        if not losses.nothing or not losses.messages or not losses.requests:
            problems.append(f"{told}: {losses}")
        there = fleet.revisions()[kill.robot]
        if kill.wrong and before[kill.robot][kill.app][0] not in there.get(kill.app, []):
            problems.append(f"{told}: the old version does not serve: {there.get(kill.app)}")
    for kill, run in ended(fleet, kills, wanted).items():
        expected = ("rolled-back",) if kill.wrong else ("updated", "unchanged")
        if run.outcomes.get(kill.robot) not in expected:
            problems.append(f"{kill}: the next run: {run}")
        fleet.figures.append(f"{kill.robot}: the next run: {run.outcomes.get(kill.robot)}")
    for robot, losses in watch.losses(patience=180).items():
        if not losses.nothing:
            problems.append(f"{robot}, with the next run: {losses}")
    return problems
