# SPDX-License-Identifier: GPL-3.0-or-later
"""The whole run: one lab, both arms, round after round."""

from __future__ import annotations

import subprocess
import sys
import tempfile
import time
import traceback
from collections.abc import Callable, Mapping
from contextlib import nullcontext
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from lab_environment import CHECKOUT

from .cluster import EDGE, HOSTS, ROBOT, Cluster, wait_for
from .cores import CONTROL_CORES, ROBOT_CORES, listed
from .errors import BenchError
from .fleet import FleetArm
from .plain import PlainArm
from .results import Results
from .rounds import Arm, Plan, clear, run_round
from .scenario import FLEET, NO_HOLD, RELEASE, Case, images
from .stress import Stress
from .trials import Trial, Trials
from .versions import about

sys.path.insert(0, str(CHECKOUT / "tests" / "lab"))

from lablib.names import checkout_id, container_name
from lablib.podman import podman

READY_SECONDS = 120


@dataclass(frozen=True)
class Options:
    """What the command line says."""

    trials: int
    messages: int
    stress: str
    arms: list[str]
    cases: list[Case]
    lab: str
    keep: bool
    plain_names: str
    changer: str
    quiet: float | None = None
    minutes: float | None = None
    loop: bool = False
    before: Path | None = None


class Experiment:
    """Brings the lab up, runs the rounds, takes the lab down."""

    def __init__(self, options: Options, results: Results, trials: Trials, say: Callable[[str], None]) -> None:
        self._options = options
        self._results = results
        self._trials = trials
        self._started = time.monotonic()
        self._say = say
        self._sockets = tempfile.TemporaryDirectory(prefix="bench-")  # short: a socket's path may have 107 characters
        self._cluster = Cluster(options.lab, Path(self._sockets.name), options.before or CHECKOUT)
        name = RELEASE if options.before else FLEET
        self._fleet = FleetArm(self._cluster, results.directory, options.changer, name)
        self.about: dict[str, Any] = {}
        self.problems: list[str] = []

    def run(self, after_round: Callable[[], object]) -> None:
        """Every round; what goes wrong in one is noted, and the next one begins anew."""
        self._set_up()
        options = self._options
        arms = self._arms()
        cases = {case.name: case for case in options.cases}
        longest = 0.0
        for (stress, trial, name), case in self._trials.missing(options.trials, options.arms, options.stress, cases):
            if options.minutes and time.monotonic() - self._started + longest > options.minutes * 60:
                self._say(f"{options.minutes:g} minutes are over; the next run goes on here")
                break
            plan = Plan(cases[case], options.messages, self._say, options.quiet, options.loop)
            self._say(f"trial {trial} of {options.trials}, {name}, {case}{', under stress' if stress else ''}")
            began = time.monotonic()
            try:
                self._round(arms[name], plan, (trial, stress))
            except Exception as error:  # a run takes hours: one round that fails must not cost the others
                with (self._results.directory / "errors.log").open("a", encoding="utf-8") as file:
                    file.write(traceback.format_exc())
                self._note(f"trial {trial}, {name}, {case}, stress {stress}: {error!r}")
                self._keep_journals(_named(stress, trial, name, plan.case))
            after_round()
            longest = max(longest, time.monotonic() - began)
            self._say(f"  {time.monotonic() - began:.0f} s")
        for arm in arms.values():
            clear(self._cluster, arm.namespace)

    def _round(self, arm: Arm, plan: Plan, which: tuple[int, bool]) -> None:
        trial, stress = which
        wait_for("the cluster", self._complaint, READY_SECONDS)  # one that restarted must not cost all rounds to come
        for other in (PlainArm.namespace, FleetArm.namespace):  # nothing of the other arm may use the machine
            clear(self._cluster, other)
        keep = self._results.raw / _named(stress, trial, arm.name, plan.case)
        log = keep.with_name(f"{keep.name}-stress.log")
        hardship = Stress(self._options.lab, ROBOT, log, self._say) if stress else nullcontext()
        measured = run_round(self._cluster, arm, plan, which, keep, hardship)
        self._results.add(measured)
        if not self.about.get("ros"):
            self.about = {**self.about, **about(self._cluster)}
        self._trials.add(Trial(arm.name, stress, trial, self.about, [measured]))
        if measured.details["problem"]:
            self._note(f"trial {trial}, {arm.name}, {plan.case.name}: {measured.details['problem']}")

    def _complaint(self) -> str:
        """What the API server says instead of that it is ready."""
        said = self._cluster.kubectl("get --raw /readyz", check=False).strip()
        return "" if said == "ok" else said or "its API server does not answer"

    def _keep_journals(self, name: str) -> None:
        """What the hosts say of a round that failed: the lab does not outlive the run."""
        for host in (EDGE, ROBOT):
            try:
                said = self._cluster.ssh(host, "journalctl --no-pager --lines=2000", check=False)
            except subprocess.TimeoutExpired as error:  # a host that hangs must not cost the other rounds
                self._note(f"no journal of {host}: {error}")
            else:
                (self._results.raw / f"{name}-{host}.log").write_bytes(said)

    def _note(self, problem: str) -> None:
        self.problems.append(problem)
        self._say(f"  PROBLEM: {problem}")

    def _set_up(self) -> None:
        options = self._options
        self._cluster.lab_command("artifacts")
        self._cluster.lab_command("up", "--lab", options.lab, "--hosts", HOSTS)
        for host, cores in ((ROBOT, ROBOT_CORES), (EDGE, CONTROL_CORES)):
            podman(
                "update",
                f"--cpuset-cpus={listed(cores)}",
                container_name(checkout_id(str(CHECKOUT)), options.lab, host),
            )
        self._cluster.connect()
        variables = self._cluster.variables
        self._say(f"lab {options.lab} is up; site.yml runs")
        self._fleet.prepare([*variables["lab_image_archives"], *variables.get("lab_update_archives", [])])
        self._fleet.site("--skip-tags", "ready")  # there is no app yet: each round waits for its own
        self._cluster.connect()
        self._check_images()

    def _check_images(self) -> None:
        """Every version on both hosts before the first round: a pull would be measured as a slow update."""
        for host in (EDGE, ROBOT):
            there = self._cluster.ssh(host, "k3s ctr images list -q").decode()
            missing = [tag for tag in images(self._options.cases) if f"lab/apps:{tag}" not in there]
            if missing:
                raise BenchError(f"{host} has no lab/apps:{', lab/apps:'.join(missing)}; --cases leaves updates out")

    def _arms(self) -> Mapping[str, Arm]:
        names = self._options.plain_names
        return {
            "plain": PlainArm(self._cluster, names, self._results.directory, self._master()),
            self._fleet.name: self._fleet,
            NO_HOLD: FleetArm(
                self._cluster,
                self._results.directory,
                self._options.changer,
                NO_HOLD,
                {"ros_master_goal_forwarding": False},
            ),
        }

    def _master(self) -> dict[str, Any]:
        """The fleet arm's master as site.yml has made it: the plain arm's has the same image, flags and hooks."""
        for item in self._cluster.deployments(FleetArm.namespace):
            if item["metadata"]["name"] == "ros-master":
                container: dict[str, Any] = item["spec"]["template"]["spec"]["containers"][0]
                return {key: container[key] for key in ("image", "args", "lifecycle")}
        raise BenchError(f"site.yml has left no Deployment ros-master in {FleetArm.namespace}")

    def tear_down(self) -> None:
        """Remove the lab, unless it is to be kept."""
        self._sockets.cleanup()
        if not self._options.keep:
            self._cluster.lab_command("down", "--lab", self._options.lab)


def _named(stress: bool, trial: int, arm: str, case: Case) -> str:
    """What the files of a round are called by."""
    return f"{'stress' if stress else 'calm'}-{trial:02d}-{arm}-{case.app}-{case.update}"
