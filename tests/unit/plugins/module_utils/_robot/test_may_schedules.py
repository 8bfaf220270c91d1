# SPDX-License-Identifier: GPL-3.0-or-later
"""Four who would change one robot, three by `rosops-may` and one run, in whatever order their calls come.

Whose turn it is, what the robot does, what its messages say, whether the API answers, who is killed and when the keeper
begins anew is drawn. A change that begins against a condition, or a hold that outlives its end, is a failure.
"""

from __future__ import annotations

import os
import random
import threading
from collections.abc import Callable
from contextlib import closing
from types import SimpleNamespace
from typing import Any

import pytest
from ansible_collections.rosops.fleet.plugins.module_utils._common.poll import PASS
from ansible_collections.rosops.fleet.plugins.module_utils._robot.step_watch import LOOK
from ansible_collections.rosops.fleet.plugins.module_utils._ros.conditions import conditions_from
from ansible_collections.rosops.fleet.plugins.module_utils._ros.idle_robot import IdleRobot, hold_when_idle
from ansible_collections.rosops.fleet.plugins.plugin_utils._kube.lease import Lease
from ansible_collections.rosops.fleet.plugins.plugin_utils._update import cluster as update_cluster
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.cluster import KubeCluster
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.world import HeldError
from ansible_collections.rosops.fleet.tests.unit.plugins.module_utils._robot.robot_at_the_door import (
    INVENTORY,
    MIDNIGHT,
    OTHERS,
    OWNER,
    SERVERS,
    SPACE,
    World,
    at_the_door,
    rosops_may,
)

SCHEDULES = 1000 if os.environ.get("ROSOPS_TEST_ALL") else 20
TURNS = 300
MAY = rosops_may()


class Killed(BaseException):
    """A caller is no more."""


class Turns:
    """Callers in threads, of which one moves at a time: the one whose turn it is."""

    def __init__(self) -> None:
        self.waiting: dict[threading.Thread, threading.Semaphore] = {}
        self.scheduler = threading.Semaphore(0)
        self.killed: set[threading.Thread] = set()
        self.errors: list[BaseException] = []

    def spawn(self, who: str, work: Callable[[], None]) -> threading.Thread:
        def run() -> None:
            me = threading.current_thread()
            self.waiting[me].acquire()
            try:
                work()
            except Killed:
                pass
            except BaseException as error:
                self.errors.append(error)
            del self.waiting[me]
            self.scheduler.release()

        thread = threading.Thread(target=run, daemon=True, name=who)
        self.waiting[thread] = threading.Semaphore(0)
        thread.start()
        return thread

    def give(self, thread: threading.Thread) -> None:
        """Let it move until it pauses, or ends."""
        self.waiting[thread].release()
        self.scheduler.acquire()

    def kill(self, thread: threading.Thread) -> None:
        """Where it stands: nothing that it would do at its end is done."""
        self.killed.add(thread)
        self.give(thread)

    def pause(self) -> None:
        """Called by a caller between two of its calls; what works for one has no turns of its own."""
        me = threading.current_thread()
        if me in self.waiting:
            self.scheduler.release()
            self.waiting[me].acquire()
            if me in self.killed:
                raise Killed


class Schedule:
    """One robot, and what four callers make of it."""

    def __init__(self, world: World, seed: int) -> None:
        self.world, self.dice, self.turns = world, random.Random(seed), Turns()  # noqa: S311 - to be drawn again by its number
        # who changes it now -> the actions that must get no goals, and until when he may
        self.changing: dict[str, tuple[tuple[str, ...], float]] = {}
        self.until: dict[str, float] = {}  # owner -> the end of his hold, and when the keeper has to have seen it
        self.ends: dict[str, float] = {}
        self.run_s: dict[str, float] = {}  # action -> until when a run holds its goals
        self.begun: list[str] = []
        world.sleeps = self.sometimes

    def sometimes(self) -> None:
        """A look is long, and not every moment of it is of interest."""
        if self.dice.random() < 0.1:
            self.turns.pause()

    def at_work(self) -> dict[str, tuple[str, ...]]:
        """Whoever takes longer than he said has nobody's promise."""
        return {who: actions for who, (actions, until) in self.changing.items() if self.world.at < until}

    def check(self, who: str, actions: tuple[str, ...], values: tuple[str, ...], until: float) -> None:
        """A change begins: nothing may speak against it."""
        world = self.world
        assert not self.at_work(), f"{who} begins while {self.at_work()} is at work"
        assert not [one for one in actions if world.goals.get(one)], f"{who} begins on a robot at work"
        assert all(world.values[one] for one in values), f"{who} begins against {values}"
        assert (world.wall() - MIDNIGHT) % 86400 < 6 * 3600, f"{who} begins out of the window"
        self.changing[who] = actions, until
        self.begun.append(who)

    # ---- who

    def tool(self, owner: str, app: str = "", longer: bool = False) -> None:
        """Another updater, by the file that is shipped."""
        seconds = self.dice.choice([20, 60, 200])
        words = ["robot1", *(("--app", app) if app else ()), "--owner", owner]
        actions = ("/arm/move",) if app else tuple(SERVERS)
        for _time in range(4):
            wrote = self.world.number
            code = MAY.main([*words, "--hold", str(seconds)], self.send)
            if code == 0:
                assert (self.world.holder, self.world.number > wrote) == (OWNER + owner, True)
                self.check(owner, actions, ("/battery", "/dock"), self.until[owner])
                self.work()
                if longer:
                    MAY.main([*words, "--hold", str(seconds)], self.send)
                    self.work()
                self.changing.pop(owner, None)
                MAY.main(["robot1", "--owner", owner, "--release"], self.send)
            assert code in (0, 1, 75)

    def work(self) -> None:
        for _turn in range(self.dice.randrange(6)):
            self.turns.pause()

    def send(self, method: str, path: str, body: dict[str, Any] | None) -> tuple[int, dict[str, Any]]:
        self.turns.pause()
        status, said = self.world.send(method, path, body)
        spec = (body or {}).get("spec") or {}
        if status < 300 and spec.get("holderIdentity"):
            owner, until = spec["holderIdentity"][len(OWNER) :], self.world.at + spec["leaseDurationSeconds"]
            self.ends[owner] = self.until[owner] = until
        return status, said

    def run(self) -> None:
        """A run of the collection, as far as it takes the robot: its Lease, its hold, and then its change."""
        world = self.world
        api = SimpleNamespace(
            get=lambda _ref: world.lease(SPACE),
            create=lambda body: world.write_lease(SPACE, body),
            replace=lambda body: world.write_lease(SPACE, body) or world.lease(SPACE),
        )
        lease = Lease(api, SPACE, OTHERS, lambda: world.at, world.wall)  # type: ignore[arg-type]
        cluster = KubeCluster(SimpleNamespace(allowed_by=lambda _: None), lambda _: None, OTHERS)  # type: ignore[arg-type]
        keeper: Any = SimpleNamespace(hold=self.run_holds, release=world.release)
        for _time in range(2):
            for _turn in range(self.dice.randrange(1, 40)):
                self.turns.pause()
            try:
                cluster._take(lease)
            except HeldError:
                continue
            except Exception:
                assert world.away
                continue
            self.turns.pause()
            idle = [{"name": name, "server": node, "state": "idle"} for name, node in SERVERS.items()]
            values = [{"topic": "/battery", "field": "percentage", "above": 0.4}]
            robot = IdleRobot(world, keeper, conditions_from({"actions": idle, "values": values}), lambda: 60.0)  # type: ignore[arg-type]
            with closing(robot):
                ended = hold_when_idle(robot, SERVERS, 1.0, 0.2, now=lambda: world.at, sleep=world.sleep)
            opens = INVENTORY.windows.opens_at(world.wall())
            if ended.verdict == PASS and opens <= world.wall() and not world.away and lease.renew().mine:
                self.check("run", tuple(SERVERS), ("/battery",), min([world.at + 15, *self.run_s.values()]))
                self.turns.pause()
                self.changing.pop("run")
            for action in ended.held:
                world.release(action)
            if not world.away:
                lease.release()

    def run_holds(self, action: str, server: str, seconds: float) -> str:
        self.run_s[action] = self.world.at + seconds
        return self.world.hold(action, server, seconds)

    # ---- whatever happens

    def play(self) -> None:
        """All of it."""
        callers = {
            "apt": lambda: self.tool("apt"),
            "mender": lambda: self.tool("mender", longer=True),
            "argo": lambda: self.tool("argo", "arm"),
            "run": self.run,
        }
        threads = [self.turns.spawn(who, work) for who, work in callers.items()]
        for _turn in range(TURNS):
            there = [one for one in threads if one in self.turns.waiting]
            if there and self.dice.random() < 0.7:
                self.turns.give(self.dice.choice(there))
            else:
                self.happens()
            self.hold_s_end()
            if self.turns.errors:
                break
        for thread in [*self.turns.waiting]:  # whoever is left is killed where it stands
            self.turns.kill(thread)
        for error in self.turns.errors:
            raise error
        world, self.changing = self.world, {}
        world.away = False
        world.run(max([world.at, *self.ends.values()]) - world.at + 2 * LOOK)
        assert not world.holder.startswith(OWNER), "a hold outlives its owner's end"
        assert world.held_until == {}, "goals are held for nobody"

    def happens(self) -> None:
        dice, world = self.dice, self.world
        what = dice.randrange(12)
        if what < 4:
            seconds = dice.choice([1, 1, 5, 20])
            world.run(seconds)
            if world.away:  # nobody can see a Lease meanwhile, until the next look
                self.ends = {owner: end + seconds + LOOK for owner, end in self.ends.items()}
        elif what < 5:
            self.goal(dice.choice([*SERVERS]))
        elif what < 9:
            world.goals.clear()
        elif what == 9:
            topic = dice.choice([*world.values])
            world.values[topic] = not world.values[topic] or dice.random() < 0.5
        elif what == 10:
            world.away = not world.away and dice.random() < 0.3
        elif dice.random() < 0.3:
            world.start()
        elif dice.random() < 0.1 and self.turns.waiting:
            victim = dice.choice([*self.turns.waiting])
            self.turns.kill(victim)
            self.changing.pop(victim.name, None)
        elif dice.random() < 0.1:
            world.begin += 5 * 3600.0

    def goal(self, action: str) -> None:
        before = self.world.goals.get(action, 0)
        self.world.goal(action)
        reached = self.world.goals.get(action, 0) > before
        assert not (reached and any(action in held for held in self.at_work().values())), "a goal came into a change"

    def hold_s_end(self) -> None:
        """Nobody's goals are held for longer than his hold, and nobody has the Lease for longer."""
        world = self.world
        owners = max([0.0, *self.ends.values()]) + LOOK
        late = [one for one, until in world.held_until.items() if until > max(owners, self.run_s.get(one, 0.0))]
        assert late == [], f"goals of {late} are held beyond the end of all holds"
        owner = world.holder[len(OWNER) :] if world.holder.startswith(OWNER) else ""
        assert not owner or world.away or world.at <= self.ends[owner] + 2 * LOOK, f"{owner} has the Lease still"


@pytest.mark.parametrize("first", range(0, SCHEDULES, 20))
def test_no_change_begins_against_a_condition_and_no_hold_outlives_its_owner_s_end(
    monkeypatch: pytest.MonkeyPatch, first: int
) -> None:
    monkeypatch.setattr(MAY.sys, "stderr", SimpleNamespace(write=lambda _text: None))
    begun = list[str]()
    for seed in range(first, first + 20):
        with at_the_door(monkeypatch) as world:
            monkeypatch.setattr(update_cluster.time, "time", world.wall)
            schedule = Schedule(world, seed)
            try:
                schedule.play()
            except AssertionError as error:
                raise AssertionError(f"schedule {seed}: {error}") from error
            begun += schedule.begun
    assert {"apt", "mender", "argo", "run"} <= {*begun}  # else nothing was tried
