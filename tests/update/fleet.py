# SPDX-License-Identifier: GPL-3.0-or-later
"""The scenario's fleet: what its inventory says, how it is changed, and what its apps notice of that."""

from __future__ import annotations

import copy
import itertools
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import evidence
import yaml
from cluster import Cluster, Hosts, Pod, running
from evidence import Losses
from runs import CHECKOUT, Playbooks, Run, Running, wait_until

ROBOTS_VARIABLES = CHECKOUT / "molecule" / "update" / "inventory" / "group_vars" / "robots.yml"
ROBOTS = ["robot1", "robot2"]  # of the scenario; a lab made by hand may have more
ALL_AT_ONCE: dict[str, Any] = {"update_waves": ["100%"]}
LEAST = 3.0  # seconds that an account has to tell of: subscribers write theirs once in a second
LIMIT = ("--limit", "robot1,edge1")  # of a run for one robot

Variables = dict[str, Any]
Accounts = dict[str, list[dict[str, Any]]]  # of a robot's apps, as Hosts.logs has them


class Fleet:
    """The robots, and the variables that stand for the operator's inventory."""

    def __init__(self, lab: str, inventory: Path, output: Path) -> None:
        self.hosts = Hosts(lab)
        self.robots = self.hosts.robots
        self.connect()
        self.playbooks = Playbooks(inventory, output)
        self.variables: Variables = {"scenario_changes": {}}  # what converge brought
        self.figures: list[str] = []
        self._proven: dict[str, Any] = {}
        self._clock = time.time() - time.monotonic()
        self._versions = itertools.count(int(time.time()) % 100_000)

    def connect(self) -> None:
        """To the cluster that there is."""
        self.cluster = Cluster(Path(self.hosts.variables["lab_dir"]) / "kube" / "edge.yaml")

    # --- what the operator does -------------------------------------------------------------------------------------

    def changed(self, host: str, app: str, on: Variables | None = None, **keys: Any) -> Variables:
        """The inventory (or `on`) with keys of an app changed for a robot (or for `robots`)."""
        return with_changes(self.variables if on is None else on, {host: {app: keys}})

    def new_version(self, host: str, app: str, on: Variables | None = None, **env: Any) -> Variables:
        """The same with a version of the app that was never there. `env` says what is wrong with it."""
        return self.changed(host, app, on, env={"ROSOPS_APPS_VERSION": f"v{next(self._versions)}", **env})

    def update(self, variables: Mapping[str, Any], *arguments: str, **settings: Any) -> Run:
        """`update.yml` with this inventory. When all went well it is the fleet's inventory from then on."""
        run = self.playbooks.run("update", {**variables, **settings}, *arguments)
        if run.status == 0 and "--check" not in arguments:
            self.accept(variables)
        return run

    def start_update(self, variables: Mapping[str, Any], *arguments: str, **settings: Any) -> Running:
        """The same in the background."""
        return self.playbooks.start("update", {**variables, **settings}, "-v", *arguments)

    def accept(self, variables: Mapping[str, Any]) -> None:
        """The fleet runs what this inventory says."""
        self.variables = copy.deepcopy(dict(variables))
        self._proven = self.revisions()

    def return_to(self, variables: Mapping[str, Any]) -> None:
        """Have the fleet run what this inventory says, whatever it runs now."""
        self.variables, self._proven = copy.deepcopy(dict(variables)), {}
        self.settle()

    # --- what is there ----------------------------------------------------------------------------------------------

    def pods(self) -> dict[str, dict[str, list[Pod]]]:
        return {robot: self.cluster.pods(robot) for robot in self.robots}

    def running(self) -> dict[str, dict[str, list[tuple[str, tuple[str, ...]]]]]:
        """Robot -> app -> (UID, containers) of its pods."""
        return {robot: running(pods) for robot, pods in self.pods().items()}

    def assert_still_running(self, before: Mapping[str, Any], *robots: str) -> None:
        """Every pod is the one that it was when `running` said so, and none of its containers was started again."""
        now = self.running()
        changed = [
            f"{robot}: {app}: {before[robot].get(app)} -> {now[robot].get(app)} {self.cluster.last_words(robot, app)}"
            for robot in robots or self.robots
            for app in sorted({*before[robot], *now[robot]})
            if before[robot].get(app) != now[robot].get(app)
        ]
        assert not changed, "\n".join(changed)

    def assert_taken_back(self, before: Mapping[str, Any]) -> None:
        """robot1's pods are those that were there before, never started again, and alone."""
        self.wait_settled()
        self.assert_still_running(before, "robot1")

    def revisions(self) -> dict[str, dict[str, list[tuple[str, str]]]]:
        """Robot -> app -> (image, revision) of its pods."""
        return {
            robot: {app: [(pod.image, pod.revision) for pod in there] for app, there in pods.items()}
            for robot, pods in self.pods().items()
        }

    def unsettled(self) -> list[str]:
        """Why the fleet is not at rest; empty if it is."""
        return [problem for robot in self.robots for problem in self.cluster.unsettled(robot)]

    def wait_settled(self, seconds: float = 120) -> None:
        """Until every app of every robot is rolled out and ready."""
        wait_until(self.unsettled, lambda problems: not problems, seconds, "a fleet at rest")

    def wait_for_goal(self, robot: str, since: float) -> None:
        """Until one that was sent since then has succeeded.

        One that its client at the edge had sent to a robot that is away is lost only when its time is over.
        """

        def sent(logs: Accounts) -> float:
            goals = logs.get(evidence.GOALS, [])
            return evidence.newest([goal for goal in goals if goal["outcome"] == evidence.SUCCEEDED], "sent")

        self._wait_for_newer(robot, sent, since, 240, "a goal from the edge that comes through again")

    def wait_for_answer(self, robot: str, since: float) -> None:
        """Until a request that was sent from the edge since then was answered, and so all before have ended."""

        def asked(logs: Accounts) -> float:
            return evidence.newest([request for request in logs.get(evidence.REQUESTS, []) if request["ok"]])

        self._wait_for_newer(robot, asked, since, 60, "a request from the edge that is answered")

    def _wait_for_newer(
        self, robot: str, newest: Callable[[Accounts], float], since: float, seconds: float, what: str
    ) -> None:
        wait_until(lambda: newest(self.hosts.logs(robot)), lambda found: found > since, seconds, what, pause=1)

    def settle(self) -> None:
        """Have the fleet run what its inventory says, whatever the test before left behind."""
        self.hosts.forget_connections()
        if self._proven and not self.unsettled() and self.revisions() == self._proven:
            return
        run = self.update(self.variables, **ALL_AT_ONCE)
        if run.status != 0:
            self.playbooks.run("site", self.variables)
            run = self.update(self.variables, **ALL_AT_ONCE)
        assert run.status == 0, f"the fleet could not be brought to a known state: {run}"
        self.wait_settled()
        self.accept(self.variables)

    def clock_was_set(self) -> str:
        """What makes a loss of none: the sensor numbers its samples by the wall clock. Empty if it was not."""
        seconds = time.time() - time.monotonic() - self._clock
        return f"; the machine's clock was set by {seconds:.1f} s since the first case" if abs(seconds) > 1.0 else ""

    def watch(self) -> Watch:
        """Keep account of what the apps lose from now on."""
        return Watch(self)


class Watch:
    """What the apps lost since it was made."""

    def __init__(self, fleet: Fleet) -> None:
        self._fleet = fleet
        self._since = time.time()

    def losses(self, *robots: str, goals: bool = True, patience: float = 60, within: str = "") -> dict[str, Losses]:
        """Robot by robot, up to now; the figures are shown at the end of the tests. `within`: see Hosts.logs."""
        until = max(time.time(), self._since + LEAST)
        found = {}
        for robot in robots or self._fleet.robots:
            found[robot] = self._fleet.hosts.losses(robot, self._since, until, goals, patience, within)
            self._fleet.figures.append(f"{robot}: {until - self._since:.0f} s: {found[robot]}")
        return found

    def assert_nothing_lost(self, *robots: str, goals: bool = True) -> dict[str, Losses]:
        """There was something to lose, and no message, request or goal was lost, and no goal executed twice."""
        found = self.losses(*robots, goals=goals)
        for robot, losses in found.items():
            assert losses.nothing, f"{robot}: {losses}{self._fleet.clock_was_set()}"
            assert losses.messages > 0, f"{robot}: {losses}"
            assert losses.requests > 0, f"{robot}: {losses}"
            assert losses.goals > 0 or not goals, f"{robot}: {losses}"
        return found

    def assert_only_lookups_failed(self, *robots: str) -> None:
        """No message and no goal was lost.

        A client that looks its service up for every request, as this one does, has nobody to ask while there is no
        master, or no way to it.
        """
        for losses in self.losses(*robots).values():
            others = {error for error in losses.failed if "master" not in error and "unavailable" not in error}
            assert (losses.lost, losses.unsuccessful, losses.twice, others) == (0, [], [], set()), losses
            assert len(losses.failed) <= 100, losses  # of ten a second
            # as long as the old pod's host goes on sending to it: by the kernel's own values it was 135 s
            assert losses.answer_ms < 20_000, losses


def scenario_apps() -> list[Variables]:
    """The apps of the inventory, for whoever changes one otherwise than by `changed`."""
    return list(yaml.safe_load(ROBOTS_VARIABLES.read_text("utf-8"))["scenario_apps"])


def with_changes(variables: Mapping[str, Any], changes: Mapping[str, Any]) -> Variables:
    """The variables with more of `scenario_changes`, merged as the inventory merges them."""
    found = copy.deepcopy(dict(variables))
    found["scenario_changes"] = _merged(found["scenario_changes"], changes)
    return found


def _merged(one: Mapping[str, Any], other: Mapping[str, Any]) -> dict[str, Any]:
    both = dict(one)
    for key, value in other.items():
        old = both.get(key)
        both[key] = _merged(old, value) if isinstance(old, Mapping) and isinstance(value, Mapping) else value
    return both
