# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Wall time of site.yml: on bare hosts, on ready hosts, and after one app's image changed.

    make bench-site

It brings up a lab of its own, runs the playbook three times, and removes the lab. A run that fails is an error. The
last line printed is the result as JSON; the exit status is 1 where a limit is missed. Logs and reports of the runs are
kept in reports/bench-site/.
"""

from __future__ import annotations

import argparse
import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from lab_environment import CHECKOUT, environment

LAB = CHECKOUT / "tests" / "lab" / "lab"
KEPT = CHECKOUT / "reports" / "bench-site"
READY_TO_BARE = 0.25  # the most that a run on ready hosts may take of the one on bare hosts
APP, NEW_IMAGE = "temperature-stats", "lab/apps:1.1"


class BenchError(Exception):
    """The benchmark could not be made; there is no result."""


@dataclass(frozen=True)
class Run:
    """One run of the playbook: the time from start to exit of ansible-playbook, and the callback's report."""

    name: str
    seconds: float
    report: Mapping[str, Any]

    @property
    def changed(self) -> int:
        """Changed tasks, summed over the hosts."""
        return sum(int(host["counts"].get("changed", 0)) for host in self.report["hosts"])


# --- decisions -----------------------------------------------------------------------------------------------------


def with_image(apps: list[dict[str, Any]], name: str, image: str) -> list[dict[str, Any]]:
    """The apps, one of them with another image."""
    present = [app["name"] for app in apps]
    if name not in present:
        raise BenchError(f"the lab's inventory has no app {name}, only {', '.join(present)}")
    if image in {app["image"] for app in apps if app["name"] == name}:
        raise BenchError(f"app {name} has the image {image} already: that would change nothing")
    return [{**app, "image": image} if app["name"] == name else app for app in apps]


def unfit(report: Mapping[str, Any], hosts: list[str]) -> list[str]:
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


def limits(runs: Mapping[str, Run]) -> dict[str, bool]:
    """What the runs have to show, and whether they do."""
    return {
        f"ready hosts take at most {READY_TO_BARE} of bare hosts": ratio(runs) <= READY_TO_BARE,
        "a run on ready hosts changes nothing": runs["ready"].changed == 0,
        "a changed image changes something": runs["image"].changed > 0,
    }


def ratio(runs: Mapping[str, Run]) -> float:
    """How a run on ready hosts compares with one on bare hosts."""
    return runs["ready"].seconds / runs["bare"].seconds


def result(runs: Mapping[str, Run], about: Mapping[str, Any]) -> dict[str, Any]:
    """The line of JSON."""
    held = limits(runs)
    return {
        "benchmark": "site",
        **about,
        "runs": {
            name: {
                "seconds": round(run.seconds, 1),
                "changed": run.changed,
                "tasks": run.report["tasks"],
                "stages": {stage["name"]: stage["seconds"] for stage in run.report["stages"]},
                "slowest_tasks": [
                    {key: task[key] for key in ("name", "stage", "seconds")} for task in run.report["slowest_tasks"]
                ],
            }
            for name, run in runs.items()
        },
        "ready_to_bare": round(ratio(runs), 3),
        "missed": [what for what, holds in held.items() if not holds],
    }


# --- the lab and the playbook --------------------------------------------------------------------------------------


class Bench:
    """Runs commands of the checkout; all input and output of the benchmark is here."""

    def __init__(self, lab: str) -> None:
        self.lab = lab
        self._environment = environment(lab)

    def do_lab(self, *words: str) -> float:
        """A command of the lab; returns its seconds."""
        started = time.monotonic()
        command = [str(LAB), *words]
        done = subprocess.run(command, cwd=CHECKOUT, env=self._environment, check=False)  # noqa: S603 - no shell
        if done.returncode != 0:
            raise BenchError(f"tests/lab/lab {' '.join(words)} ended with {done.returncode}")
        return time.monotonic() - started

    def inventory(self) -> dict[str, Any]:
        """The lab's inventory with its variables."""
        done = self._ansible(["ansible-inventory", "--list"], stdout=subprocess.PIPE)
        if done.returncode != 0:
            raise BenchError(f"ansible-inventory ended with {done.returncode}")
        found: dict[str, Any] = json.loads(done.stdout)
        return found

    def site(self, name: str, hosts: list[str], extra: Mapping[str, Any] | None = None) -> Run:
        """One run of site.yml. Its whole output goes into a log."""
        log, report, variables = (KEPT / f"{name}.{kind}" for kind in ("log", "json", "vars.json"))
        report.unlink(missing_ok=True)
        words = ["ansible-playbook", "playbooks/site.yml"]
        if extra:
            variables.write_text(json.dumps(extra, indent=2), encoding="utf-8")
            words += ["--extra-vars", f"@{variables}"]
        print(f"{name}: site.yml runs, log {log.relative_to(CHECKOUT)}", flush=True)
        self._environment["ROSOPS_FLEET_REPORT"] = str(report)
        started = time.monotonic()
        with log.open("w", encoding="utf-8") as file:
            done = self._ansible(words, stdout=file, stderr=subprocess.STDOUT)
        seconds = time.monotonic() - started
        if done.returncode != 0:
            tail = log.read_text(encoding="utf-8").splitlines()[-40:]
            raise BenchError("\n".join([*tail, f"{name}: site.yml ended with {done.returncode} after {seconds:.1f} s"]))
        if not report.exists():
            raise BenchError(f"{name}: site.yml left no report at {report}: is the callback fleet_report enabled?")
        run = Run(name, seconds, json.loads(report.read_text(encoding="utf-8")))
        if wrong := unfit(run.report, hosts):
            raise BenchError(f"{name}: {', '.join(wrong)}")
        print(f"{name}: {seconds:.1f} s, changed={run.changed}, {run.report['tasks']} tasks; the slowest:", flush=True)
        print("\n".join(task_lines(run.report)), flush=True)
        return run

    def _ansible(self, words: list[str], **options: Any) -> subprocess.CompletedProcess[str]:
        command = [words[0], "-i", "inventories/lab", *words[1:]]
        return subprocess.run(  # noqa: S603 - no shell, and no word from outside
            command, cwd=CHECKOUT, env=self._environment, text=True, check=False, **options
        )


def measure(bench: Bench) -> dict[str, Any]:
    """All three runs on fresh hosts."""
    bench.do_lab("artifacts")
    load = os.getloadavg()[0]
    lab_seconds = bench.do_lab("up", "--lab", bench.lab, "--fresh")
    variables = bench.inventory()["_meta"]["hostvars"]
    hosts = sorted(variables)
    one_robot = next(values for values in variables.values() if "ros_apps" in values)
    extra = {
        "ros_apps": with_image(one_robot["ros_apps"], APP, NEW_IMAGE),
        "images_archives": [
            {"path": path} for path in one_robot["lab_image_archives"] + one_robot["lab_update_archives"]
        ],
    }
    runs = {
        "bare": bench.site("bare", hosts),
        "ready": bench.site("ready", hosts),
        "image": bench.site("image", hosts, extra),
    }
    about = {
        "k3s": one_robot["lab_k3s"],
        "hosts": len(hosts),
        "cores": os.cpu_count(),
        "load_before": round(load, 2),
        "lab_up_seconds": round(lab_seconds, 1),
    }
    return result(runs, about)


def say(found: Mapping[str, Any]) -> None:
    """The figures, and the line of JSON."""
    titles = {"bare": "bare hosts", "ready": "ready hosts", "image": f"image of {APP} changed"}
    print(f"\nsite.yml on {found['hosts']} hosts, {found['cores']} cores, k3s: {found['k3s']}")
    for name, run in found["runs"].items():
        print(f"  {titles[name]:<34} {run['seconds']:7.1f} s  changed={run['changed']}")
    print(f"  {'ready / bare':<34} {found['ready_to_bare']:7.3f}")
    for what in found["missed"]:
        print(f"MISSED: {what}")
    print(json.dumps(found, separators=(",", ":")), flush=True)


def attempt(measuring: Callable[[], dict[str, Any]], tidy: Callable[[], object]) -> int:
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
    return 1 if found["missed"] else 0


def main() -> int:
    """The command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--lab", default="bench", help="name of the lab that is made for it (default: bench)")
    parser.add_argument("--keep", action="store_true", help="leave the lab as it is afterwards")
    options = parser.parse_args()
    signal.signal(signal.SIGTERM, lambda _number, _frame: sys.exit(143))  # so that the lab goes then, too
    KEPT.mkdir(parents=True, exist_ok=True)
    bench = Bench(options.lab)
    return attempt(
        lambda: measure(bench),
        lambda: options.keep or bench.do_lab("down", "--lab", bench.lab),
    )


if __name__ == "__main__":
    sys.exit(main())
