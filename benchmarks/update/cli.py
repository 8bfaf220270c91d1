# SPDX-License-Identifier: GPL-3.0-or-later
"""The command line of the experiment."""

from __future__ import annotations

import argparse
import signal
import sys
import time
from pathlib import Path

from . import report
from .errors import BenchError
from .experiment import Experiment, Options
from .measure import COUNT
from .order import STRESS
from .plain_manifests import NAMES
from .results import Results, load
from .scenario import ARMS, CASES, FLEET, PLAIN, PUBLISHED, RELEASE, chosen
from .trials import TRIALS, Trials


def parser() -> argparse.ArgumentParser:
    """The options."""
    made = argparse.ArgumentParser(
        prog="bench_update.py", description="Updates, by plain Kubernetes and by update.yml."
    )
    made.add_argument("--trials", type=_positive, default=10, help="rounds of each arm (default: 10)")
    made.add_argument(
        "--messages", type=_positive, default=COUNT, help=f"messages looked at per update of a trial (default: {COUNT})"
    )
    made.add_argument("--minutes", type=float, help="begin no trial that would not be over by then")
    made.add_argument("--data", type=Path, default=TRIALS, help=f"finished trials, gone on with (default: {TRIALS})")
    made.add_argument(
        "--stress", choices=sorted(STRESS), default="both", help="with stress-ng on the robot (default: both)"
    )
    made.add_argument(
        "--arms", type=_arms, default=[PLAIN, FLEET], help=f"some of {', '.join(ARMS)} (default: plain,fleet)"
    )
    made.add_argument("--cases", default=",".join(PUBLISHED), help=f"some of: {', '.join(case.name for case in CASES)}")
    made.add_argument(
        "--plain-names", choices=NAMES, default="same", help="node names of the plain arm (default: same)"
    )
    made.add_argument("--quiet", type=float, help="seconds without an update at a round's beginning, for the control")
    made.add_argument(
        "--playbook", default="playbooks/update.yml", help="the fleet arm's (default: playbooks/update.yml)"
    )
    made.add_argument(
        "--before", type=Path, help=f"another checkout, set up: the arm is {RELEASE}, by its playbooks on fresh hosts"
    )
    made.add_argument("--lab", default="bench", help="name of the lab that is made for it (default: bench)")
    made.add_argument("--keep", action="store_true", help="leave the lab as it is afterwards")
    made.add_argument("--loop", action="store_true", help="with a control loop of 1 kHz on the robot, in a pod beside")
    made.add_argument("--report", type=Path, metavar="DIRECTORY", help="run nothing: the report of an earlier run")
    return made


def _positive(text: str) -> int:
    number = int(text)
    if number < 1:
        raise argparse.ArgumentTypeError("must be at least 1")
    return number


def _arms(text: str) -> list[str]:
    arms = [word for word in text.split(",") if word]
    if not arms or set(arms) - set(ARMS):
        raise argparse.ArgumentTypeError(f"must be some of {','.join(ARMS)}")
    return [arm for arm in ARMS if arm in arms]


def main() -> int:
    """0: measured, whatever it showed; 1: something could not be measured; 2: no result."""
    arguments = parser().parse_args()
    if arguments.report:
        return _report_again(arguments.report)
    try:
        cases = chosen([name for name in arguments.cases.split(",") if name])
    except ValueError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    before = arguments.before.resolve() if arguments.before else None
    options = Options(
        arguments.trials, arguments.messages, arguments.stress, [RELEASE] if before else arguments.arms, cases,
        arguments.lab, arguments.keep, arguments.plain_names, arguments.playbook, arguments.quiet,
        arguments.minutes, arguments.loop, before,
    )  # fmt: skip
    trials = Trials(arguments.data)
    if not trials.missing(options.trials, options.arms, options.stress, [case.name for case in cases]):
        print(f"nothing to do: {arguments.data} has every trial")
        return 0
    signal.signal(signal.SIGTERM, lambda _number, _frame: sys.exit(143))  # so that the lab goes then, too
    results = Results()
    experiment = Experiment(options, results, trials, _say)
    settings = {"trials": options.trials, "messages": options.messages, "plain_names": options.plain_names,
                "playbook": options.changer}  # fmt: skip
    try:
        try:
            # --report makes the report of a run that was broken off: after each round it can
            experiment.run(lambda: report.save(results, experiment.about, settings, experiment.problems))
        finally:
            experiment.tear_down()
    except BenchError as error:
        print(f"error: {error}", file=sys.stderr)
        experiment.problems.append(str(error))
    if not results.records:
        return 2
    report.write(results, experiment.about, settings, experiment.problems)
    return 1 if experiment.problems else 0


def _report_again(directory: Path) -> int:
    results = Results(directory.name)
    results.records, results.details = load(directory)
    found = report.kept(directory)
    report.write(results, found["about"], found["settings"], found["problems"])
    return 1 if found["problems"] else 0


def _say(text: str) -> None:
    print(f"{time.strftime('%H:%M:%S')} {text}", flush=True)
