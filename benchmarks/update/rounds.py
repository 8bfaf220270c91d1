# SPDX-License-Identifier: GPL-3.0-or-later
"""One round of an arm: all its applications up, a quiet beginning, every update in turn, then what the logs say."""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

from .cluster import Cluster, wait_for
from .loop import ControlLoop, lateness
from .measure import ACTION_SECONDS, Measured, Round, measure
from .readers import Sampling, read_logs, wipe_logs
from .rollouts import restarts
from .scenario import RATE, Case
from .step import Step
from .usage import usage
from .windows import Span, before, last_end

SETTLE = 8.0  # seconds from the last app's readiness to the round's beginning
PAUSE = 3.0  # seconds between two updates
TAIL = 4.0  # seconds from the round's end until its logs are read: they are written once a second
CLEAR_SECONDS = 120


class Arm(Protocol):
    """What the two arms have in common."""

    name: str
    namespace: str

    def deploy(self, cases: list[Case]) -> None:
        """Everything at its first version, up."""

    def update(self, case: Case) -> Step:
        """Make one update and wait until it is over."""


@dataclass(frozen=True)
class Plan:
    """How a round goes."""

    cases: list[Case]
    messages: int
    quiet: float
    say: Callable[[str], None]
    loop: bool = False

    @property
    def seconds(self) -> float:
        """The least time that a round lasts."""
        return self.messages / RATE


def clear(cluster: Cluster, namespace: str) -> None:
    """No application, no master, no logs: the next round begins as the first one did."""
    cluster.kubectl(f"-n {namespace} delete deployments --all --ignore-not-found --cascade=foreground --wait=false")
    cluster.kubectl(f"-n {namespace} delete pods --all --ignore-not-found --grace-period=1 --wait=false")
    wait_for(f"no pod in {namespace}", lambda: ", ".join(_names(cluster, namespace)), CLEAR_SECONDS)
    cluster.kubectl(f"-n {namespace} delete configmaps -l app.kubernetes.io/managed-by --ignore-not-found")
    wipe_logs(cluster, namespace)


def _names(cluster: Cluster, namespace: str) -> list[str]:
    return [pod["metadata"]["name"] for pod in cluster.pods(namespace)]


def run_round(  # noqa: PLR0913 - what a round is made of
    cluster: Cluster,
    arm: Arm,
    plan: Plan,
    which: tuple[int, bool],
    keep: Path,
    hardship: AbstractContextManager[object],
) -> list[Measured]:
    """One round; `which` is its trial and whether the robot is under stress, which `hardship` sees to once all is up.

    `keep` is a path to name files by.
    """
    trial, stress = which
    arm.deploy(plan.cases)
    with ControlLoop(cluster) if plan.loop else nullcontext() as loop:
        foreign = {pod["metadata"]["uid"] for pod in cluster.pods() if pod["metadata"]["namespace"] != arm.namespace}
        load = os.getloadavg()[0]  # of the machine before the stress: others' work on it is in every figure
        with hardship:
            time.sleep(SETTLE)
            with Sampling(cluster, keep) as sampling:
                steps, quiet = _updates(arm, plan)
                end = _end(plan, steps, quiet)
                time.sleep(max(0.0, end + TAIL - time.time()))
                started_again = restarts(cluster.pods(arm.namespace))
                logs = read_logs(cluster, arm.namespace, keep)
            ticks = loop.ticks(end) if loop else []
    this = Round(arm.name, stress, trial, plan.messages, quiet, Span(quiet.start, end))
    samples = sampling.samples()
    busy = Span(min((step.run.start for step in steps), default=quiet.end), end)
    common = {
        "usage_quiet": usage(samples, quiet, foreign),
        "usage_updates": usage(samples, busy, foreign),
        "pods_restarted": started_again,
        "load_before": round(load, 2),
        "round_s": round(end - quiet.start, 1),
    }
    found = []
    for case, step in zip(plan.cases, steps, strict=True):
        spans = {"before": before(quiet, step.span.seconds), "step": step.span, "run": step.run}
        late = {"loop": {name: lateness(ticks, span) for name, span in spans.items()}} if ticks else {}
        found.append(_whole(measure(case, step, logs, this), {**common, **late}))
    return found


def _updates(arm: Arm, plan: Plan) -> tuple[list[Step], Span]:
    start = time.time()
    time.sleep(plan.quiet)
    quiet = Span(start, time.time())
    steps = []
    for case in plan.cases:
        step = arm.update(case)
        steps.append(step)
        took = "-" if step.seconds is None else f"{step.seconds:.1f} s"
        plan.say(f"  {arm.name} {case.name}: {step.problem or took}")
        time.sleep(PAUSE)
    return steps, quiet


def _end(plan: Plan, steps: list[Step], quiet: Span) -> float:
    """When the round is over: every span that is measured ends by then."""
    end = last_end([step.run for step in steps], quiet.end)
    if plan.cases[-1].app == "action":
        end = max(end, steps[-1].run.start + ACTION_SECONDS)
    return max(end + PAUSE, quiet.start + plan.seconds)


def _whole(measured: Measured, common: dict[str, Any]) -> Measured:
    return Measured(measured.record, {**measured.details, **common})
