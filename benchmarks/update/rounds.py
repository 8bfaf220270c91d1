# SPDX-License-Identifier: GPL-3.0-or-later
"""One round of an arm: the applications of one case up, a quiet beginning, its update, then what the logs say.

The apps of other cases would make a robot busy that is said to be quiet.
"""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

from .cluster import Cluster, wait_for
from .loop import ControlLoop, lateness
from .measure import ACTION_SECONDS, Measured, Round, measure
from .readers import Sampling, read_logs, wipe_logs
from .rollouts import restarts
from .scenario import RATE, Case
from .step import Step
from .usage import usage
from .windows import Span, before

SETTLE = 8.0  # seconds from the last app's readiness to the round's beginning
PAUSE = 3.0  # seconds after the update
TAIL = 4.0  # seconds from the round's end until its logs are read: they are written once a second
CLEAR_SECONDS = 120


class Arm(Protocol):
    """What the two arms have in common."""

    name: str
    namespace: str

    def deploy(self, case: Case) -> None:
        """Its apps at their first version, up."""

    def update(self, case: Case) -> Step:
        """Make one update and wait until it is over."""


@dataclass(frozen=True)
class Plan:
    """How a round goes."""

    case: Case
    messages: int
    say: Callable[[str], None]
    said_quiet: float | None = None
    loop: bool = False

    @property
    def seconds(self) -> float:
        """The least time that a round lasts."""
        return self.messages / RATE

    @property
    def quiet(self) -> float:
        """Its quiet beginning: a fifth of it, from 12 to 40 s; of an action as long as its completion is looked at."""
        least = ACTION_SECONDS if self.case.app == "action" else 12.0
        return self.said_quiet or min(40.0, max(least, self.seconds / 5))


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
) -> Measured:
    """One round; `which` is its trial and whether the robot is under stress, which `hardship` sees to once all is up.

    `keep` is a path to name files by.
    """
    trial, stress = which
    arm.deploy(plan.case)
    with ControlLoop(cluster) if plan.loop else nullcontext() as loop:
        foreign = {pod["metadata"]["uid"] for pod in cluster.pods() if pod["metadata"]["namespace"] != arm.namespace}
        load = os.getloadavg()[0]  # of the machine before the stress: others' work on it is in every figure
        with hardship:
            time.sleep(SETTLE)
            with Sampling(cluster, keep) as sampling:
                step, quiet = _update(arm, plan)
                end = _end(plan, step, quiet)
                time.sleep(max(0.0, end + TAIL - time.time()))
                started_again = restarts(cluster.pods(arm.namespace))
                logs = read_logs(cluster, arm.namespace, keep)
            ticks = loop.ticks(end) if loop else []
    this = Round(arm.name, stress, trial, plan.messages, quiet, Span(quiet.start, end))
    samples = sampling.samples()
    spans = {"before": before(quiet, step.span.seconds), "step": step.span, "run": step.run}
    measured = measure(plan.case, step, logs, this)
    more = {
        "usage_quiet": usage(samples, quiet, foreign),
        "usage_updates": usage(samples, Span(step.run.start, end), foreign),
        "pods_restarted": started_again,
        "load_before": round(load, 2),
        "round_s": round(end - quiet.start, 1),
        **({"loop": {name: lateness(ticks, span) for name, span in spans.items()}} if ticks else {}),
    }
    return Measured(measured.record, {**measured.details, **more})


def _update(arm: Arm, plan: Plan) -> tuple[Step, Span]:
    start = time.time()
    time.sleep(plan.quiet)
    quiet = Span(start, time.time())
    step = arm.update(plan.case)
    took = "-" if step.seconds is None else f"{step.seconds:.1f} s"
    plan.say(f"  {arm.name} {plan.case.name}: {step.problem or took}")
    return step, quiet


def _end(plan: Plan, step: Step, quiet: Span) -> float:
    """When the round is over: every span that is measured ends by then."""
    end = step.run.end
    if plan.case.app == "action":
        end = max(end, step.run.start + ACTION_SECONDS)
    return max(end + PAUSE, quiet.start + plan.seconds)
