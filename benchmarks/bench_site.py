# SPDX-License-Identifier: GPL-3.0-or-later
"""What runs of the playbooks cost: wall time, and processor time and memory of the control node.

    make bench-site
    make bench-site BENCH="--before ../earlier --rounds 3"
    make bench-site BENCH="--robots 10 --hertz 20 --publish"

On a lab of its own, removed at the end: site.yml on bare hosts; then, in every round, site.yml and update.yml with
nothing to do, status.yml, and an update of one app on one robot and on every robot. With another checkout (`--before`,
set up like this one) both take turns on the same lab, the other one first. Each turn begins with a site.yml that is
not measured, so that the fleet is at rest with the version at hand.

A run that fails is an error. The last line printed is the result as JSON; the exit status is 1 where a limit is missed.
Logs and reports of the runs are kept in reports/bench-site/.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import signal
import statistics
import subprocess
import sys
import time
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from lab_environment import CHECKOUT, LAB, environment, inventory
from process_memory import Peak
from published import HELP, Table, publish
from update.errors import BenchError

KEPT = CHECKOUT / "reports" / "bench-site"
SITE_TO_BARE = 0.25  # the most that a run on ready hosts may take of the one on bare hosts
CPU_TO_BEFORE = 1 / 3  # of a run with nothing to do
APP = "temperature-stats"
KINDS = {
    "bare": "site.yml, bare hosts",
    "site": "site.yml, again",
    "update": "update.yml, again",
    "status": "status.yml",
    "app": f"update of {APP}",
    "everywhere": "the same on every robot",
}
PLAYBOOKS = {"update": "update", "app": "update", "everywhere": "update", "status": "status"}  # site is all else's
NOW, BEFORE = "now", "before"


@dataclass(frozen=True)
class Run:
    """One run of a playbook: seconds from start to exit of ansible-playbook; user and system seconds, and the most MB,
    of all its processes on the control node; the callback's report."""

    kind: str
    seconds: float
    cpu: float
    report: Mapping[str, Any]
    memory: float = 0.0

    @property
    def changed(self) -> int:
        """Changed tasks, summed over the hosts."""
        return sum(int(host["counts"].get("changed", 0)) for host in self.report["hosts"])

    @property
    def step_seconds(self) -> float:
        """The longest step of an update; 0 without one."""
        steps = [step for host in self.report["hosts"] for step in host.get("steps") or []]
        return max((sum(step["phases"].values()) for step in steps), default=0.0)


# --- decisions -----------------------------------------------------------------------------------------------------

Runs = Mapping[str, list[Run]]  # kind -> one run each round


def with_version(apps: list[dict[str, Any]], name: str, version: str) -> list[dict[str, Any]]:
    """The apps, one of them in a version that was never there; its image is the same, so that none is brought."""
    present = [app["name"] for app in apps]
    if name not in present:
        raise BenchError(f"the lab's inventory has no app {name}, only {', '.join(present)}")
    env = {"ROSOPS_APPS_VERSION": version}
    return [{**app, "env": {**app.get("env", {}), **env}} if app["name"] == name else app for app in apps]


def at_rate(apps: list[dict[str, Any]], hertz: float) -> list[dict[str, Any]]:
    """The apps, all that publish at a rate at this one: of many robots on one machine each is a small one."""
    return [_at_rate(app, hertz) if "RATE_HZ" in app.get("env", {}) else app for app in apps]


def _at_rate(app: dict[str, Any], hertz: float) -> dict[str, Any]:
    slower = {"min_rate": 0.95 * hertz}
    topics = [{**topic, **slower} if "min_rate" in topic else topic for topic in app["readiness"]["topics"]]
    return {**app, "env": {**app["env"], "RATE_HZ": hertz}, "readiness": {**app["readiness"], "topics": topics}}


def unfit(report: Mapping[str, Any], hosts: Iterable[str]) -> list[str]:
    """What is wrong with a run that ended with exit status 0: hosts that it left out or that did not get through."""
    outcomes = {host["host"]: host["outcome"] for host in report["hosts"]}
    wrong = [f"{host} took no part" for host in hosts if host not in outcomes]
    return wrong + [f"{host} is {word}" for host, word in outcomes.items() if word not in ("updated", "unchanged")]


def task_lines(report: Mapping[str, Any]) -> list[str]:
    """The slowest tasks, one a line."""
    return [
        f"  {task['seconds']:7.1f} s  {task['stage']}: {task['name']}"
        + (f"  (changed on {task['changed']} of {task['hosts']} hosts)" if task["changed"] else "")
        for task in report["slowest_tasks"]
    ]


def middle(runs: Iterable[Run], what: str) -> float:
    """The median of a figure over the rounds."""
    return float(statistics.median(getattr(run, what) for run in runs))


def limits(now: Runs, before: Runs | None = None) -> dict[str, bool]:
    """What the runs have to show, and whether they do."""
    held = {
        "site.yml and update.yml with nothing to do, and status.yml, change nothing": not any(
            run.changed for kind in ("site", "update", "status") for run in now[kind]
        ),
        "a new version of an app changes something": all(
            run.changed for kind in ("app", "everywhere") for run in now[kind]
        ),
    }
    if "bare" in now:
        held[f"ready hosts take at most {SITE_TO_BARE} of bare hosts"] = ratio(now) <= SITE_TO_BARE
    if before:
        for kind in ("site", "update"):
            share = middle(now[kind], "cpu") / middle(before[kind], "cpu")
            held[f"{KINDS[kind]}: at most a third of the processor time before"] = share <= CPU_TO_BEFORE
        steps = [middle(side["app"], "step_seconds") for side in (now, before)]
        held["a step takes no longer than before"] = steps[0] <= steps[1]
    return held


def ratio(runs: Runs) -> float:
    """How a run on ready hosts compares with one on bare hosts."""
    return middle(runs["site"], "seconds") / middle(runs["bare"], "seconds")


def result(sides: Mapping[str, Runs], about: Mapping[str, Any]) -> dict[str, Any]:
    """The line of JSON."""
    held = limits(sides[NOW], sides.get(BEFORE))
    return {
        "benchmark": "site",
        **about,
        "runs": {side: {kind: [figures(run) for run in found] for kind, found in runs.items()}
                 for side, runs in sides.items()},
        "ready_to_bare": {side: round(ratio(runs), 3) for side, runs in sides.items() if "bare" in runs},
        "missed": [what for what, holds in held.items() if not holds],
    }  # fmt: skip


def figures(run: Run) -> dict[str, Any]:
    """A run in the result."""
    return {
        "seconds": round(run.seconds, 1),
        "cpu": round(run.cpu, 1),
        "memory": round(run.memory, 1),
        "changed": run.changed,
        "step_seconds": round(run.step_seconds, 1),
        "tasks": run.report["tasks"],
        "stages": {stage["name"]: stage["seconds"] for stage in run.report["stages"]},
        "slowest_tasks": [
            {key: task[key] for key in ("name", "stage", "seconds")} for task in run.report["slowest_tasks"]
        ],
    }


def table(found: Mapping[str, Any]) -> list[str]:
    """The medians, one kind of run a line; of both sides where there are two."""
    lines = []
    for kind, title in KINDS.items():
        for side, runs in found["runs"].items():
            if rounds := runs.get(kind):
                wall, cpu, step = (
                    statistics.median(one[key] for one in rounds) for key in ("seconds", "cpu", "step_seconds")
                )
                changed = "/".join(str(one["changed"]) for one in rounds)
                last = f"  step {step:5.1f} s" if step else ""
                lines.append(f"  {title:<28} {side:<7} {wall:7.1f} s  cpu {cpu:6.1f} s  changed={changed}{last}")
    return lines


def section(found: Mapping[str, Any]) -> Table:
    """The medians as a section of docs/benchmarks.md."""
    rows, robots = [], found["robots"]
    for kind, title in KINDS.items():
        if rounds := found["runs"][NOW].get(kind):
            wall, cpu, memory = (statistics.median(one[key] for one in rounds) for key in ("seconds", "cpu", "memory"))
            shares = (f"{wall:.1f}", f"{cpu:.1f}", f"{cpu / robots:.2f}", f"{memory:.0f}", f"{memory / robots:.1f}")
            rows.append([title, *shares, str(rounds[0]["changed"])])
    about = (
        f"One edge host and {robots} robots with four apps each, {found['hertz']:g} Hz; all hosts and the control node "
        f"on one machine with {found['cores']} cores, {found['machine']}. k3s: {found['k3s']}. Processor time and "
        "memory are the control node's."
    )
    heads = ["run", "wall s", "processor s", "per robot", "MB", "per robot", "changed"]
    return Table(f"Playbooks with {robots} robots", about, heads, rows)


# --- the lab and the playbooks -------------------------------------------------------------------------------------


def waited(process: subprocess.Popen[str]) -> tuple[int, float]:
    """Wait for its end: exit status, and the processor seconds of it and of all that it waited for."""
    _pid, status, used = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    return process.returncode, used.ru_utime + used.ru_stime


class Side:
    """A checkout whose playbooks are run on the lab; all input and output of the benchmark is here and in `do_lab`."""

    def __init__(self, name: str, checkout: Path, lab: str) -> None:
        self.name, self._checkout = name, checkout
        self._environment = environment(lab, checkout)
        self.inventory = inventory(lab, checkout, KEPT / "inventory")

    def variables(self) -> dict[str, Any]:
        """The lab's hosts with their variables."""
        words = ["ansible-inventory", "-i", str(self.inventory), "--list"]
        done = subprocess.run(  # noqa: S603 - no shell, and no word from outside
            words, cwd=self._checkout, env=self._environment, stdout=subprocess.PIPE, text=True, check=False
        )
        if done.returncode != 0:
            raise BenchError(f"ansible-inventory ended with {done.returncode}")
        found: dict[str, Any] = json.loads(done.stdout)["_meta"]["hostvars"]
        return found

    def play(self, kind: str, number: int, hosts: Iterable[str], extra: Mapping[str, Any] | None = None) -> Run:
        """One run of the kind's playbook on these hosts. Its whole output goes into a log."""
        stem = KEPT / f"{self.name}-{number}-{kind}"
        log, report, given = (stem.with_suffix(f".{what}") for what in ("log", "json", "vars.json"))
        report.unlink(missing_ok=True)
        playbook = f"{PLAYBOOKS.get(kind, 'site')}.yml"
        words = ["ansible-playbook", "-i", str(self.inventory), f"playbooks/{playbook}", "--limit", ",".join(hosts)]
        if extra:
            given.write_text(json.dumps(extra, indent=2), encoding="utf-8")
            words += ["--extra-vars", f"@{given}"]
        print(f"{self.name} {number}, {kind}: {playbook} runs, log {log.relative_to(CHECKOUT)}", flush=True)
        started = time.monotonic()
        with log.open("w", encoding="utf-8") as file:
            process = subprocess.Popen(  # noqa: S603 - no shell, and no word from outside
                words, cwd=self._checkout, env={**self._environment, "ROSOPS_FLEET_REPORT": str(report)},
                stdout=file, stderr=subprocess.STDOUT, text=True,
            )  # fmt: skip
            peak = Peak(process.pid)
            peak.start()
            status, cpu = waited(process)
            memory = peak.end()
        seconds = time.monotonic() - started
        if status != 0:
            tail = log.read_text(encoding="utf-8").splitlines()[-40:]
            raise BenchError("\n".join([*tail, f"{kind}: {playbook} ended with {status} after {seconds:.1f} s"]))
        if not report.exists():
            raise BenchError(f"{kind}: {playbook} left no report at {report}: is the callback fleet_report enabled?")
        run = Run(kind, seconds, cpu, json.loads(report.read_text(encoding="utf-8")), memory)
        if wrong := unfit(run.report, hosts):
            raise BenchError(f"{kind}: {', '.join(wrong)}")
        print(f"  {seconds:.1f} s, cpu {cpu:.1f} s, {memory:.0f} MB, changed={run.changed}; the slowest:", flush=True)
        print("\n".join(task_lines(run.report)), flush=True)
        return run


def do_lab(lab: str, *words: str) -> float:
    """A command of the lab; returns its seconds."""
    started = time.monotonic()
    command = [str(LAB), *words]
    done = subprocess.run(command, cwd=CHECKOUT, env=environment(lab), check=False)  # noqa: S603 - no shell
    if done.returncode != 0:
        raise BenchError(f"tests/lab/lab {' '.join(words)} ended with {done.returncode}")
    return time.monotonic() - started


def measure(lab: str, before: Path | None, rounds: int, robots: int, hertz: float) -> dict[str, Any]:
    """All runs, on fresh hosts."""
    do_lab(lab, "artifacts")
    load = os.getloadavg()[0]
    specs = ["edge1:edge", *(f"robot{number}:robots" for number in range(1, robots + 1))]
    lab_seconds = do_lab(lab, "up", "--lab", lab, "--fresh", "--hosts", ",".join(specs))
    sides = [*([Side(BEFORE, before, lab)] if before else []), Side(NOW, CHECKOUT, lab)]
    variables = sides[-1].variables()
    hosts = sorted(variables)
    robot = next(name for name, values in variables.items() if "ros_apps" in values)
    one_robot = [host for host in hosts if host == robot or "ros_apps" not in variables[host]]
    found: dict[str, dict[str, list[Run]]] = {side.name: {} for side in sides}
    usual = {side.name: at_rate(side.variables()[robot]["ros_apps"], hertz) for side in sides}
    found[sides[0].name]["bare"] = [sides[0].play("bare", 0, hosts, {"ros_apps": usual[sides[0].name]})]
    settled = sides[0]
    for number in range(1, rounds + 1):
        for side in sides:
            given = {"ros_apps": usual[side.name]}
            if side is not settled or number > 1:
                side.play("settle", number, hosts, given)
                settled = side
            turn = [(kind, hosts, given) for kind in ("site", "update", "status")]
            for kind, where in (("app", one_robot), ("everywhere", hosts)):
                changed = with_version(usual[side.name], APP, f"{side.name}-{number}-{kind}")
                turn.append((kind, where, {"ros_apps": changed}))
            for kind, where, extra in turn:
                found[side.name].setdefault(kind, []).append(side.play(kind, number, where, extra))
    about = {
        "k3s": variables[robot]["lab_k3s"],
        "hosts": len(hosts),
        "robots": robots,
        "hertz": hertz,
        "machine": platform.machine(),
        "cores": os.cpu_count(),
        "load_before": round(load, 2),
        "lab_up_seconds": round(lab_seconds, 1),
    }
    return result(found, about)


def say(found: Mapping[str, Any]) -> None:
    """The figures, and the line of JSON."""
    print(f"\n{found['hosts']} hosts, {found['cores']} cores, k3s: {found['k3s']}; medians")
    print("\n".join(table(found)))
    for side, share in found["ready_to_bare"].items():
        print(f"  {'again / bare':<28} {side:<7} {share:7.3f}")
    for what in found["missed"]:
        print(f"MISSED: {what}")
    print(json.dumps(found, separators=(",", ":")), flush=True)


def attempt(
    measuring: Callable[[], dict[str, Any]],
    tidy: Callable[[], object],
    keep: Callable[[Mapping[str, Any]], object] = lambda _found: None,
) -> int:
    """Measure, tidy up in any case, and make an exit status of it."""
    try:
        try:
            found = measuring()
        finally:
            tidy()
    except BenchError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    say(found)
    keep(found)
    return 1 if found["missed"] else 0


def main() -> int:
    """The command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--lab", default="bench", help="name of the lab that is made for it (default: bench)")
    parser.add_argument("--keep", action="store_true", help="leave the lab as it is afterwards")
    parser.add_argument("--before", type=Path, help="another checkout, set up, to be compared with")
    parser.add_argument("--rounds", type=int, default=1, help="how often each run is made (default: 1)")
    parser.add_argument("--robots", type=int, default=2, help="robots of the lab (default: 2)")
    parser.add_argument("--hertz", type=float, default=500.0, help="the rate of what the robots publish (default: 500)")
    parser.add_argument("--publish", action="store_true", help=HELP)
    options = parser.parse_args()
    before = options.before.resolve() if options.before else None
    signal.signal(signal.SIGTERM, lambda _number, _frame: sys.exit(143))  # so that the lab goes then, too
    KEPT.mkdir(parents=True, exist_ok=True)
    return attempt(
        lambda: measure(options.lab, before, options.rounds, options.robots, options.hertz),
        lambda: options.keep or do_lab(options.lab, "down", "--lab", options.lab),
        lambda found: publish("playbooks", section(found)) if options.publish else None,
    )


if __name__ == "__main__":
    sys.exit(main())
