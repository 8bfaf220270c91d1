# SPDX-License-Identifier: GPL-3.0-or-later
"""Runs make targets and says at the end which passed.

    run_stages.py [--fresh] --first NAMES --lane NAMES --lane NAMES

Lanes run side by side, the stages of one after each other; those after `--first` come before all lanes. A failed stage
does not stop the later ones: one run shows all that is broken. Only those that prepare what their lane needs do.
Each stage's output is printed in one piece when it ends, and kept in reports/stages. Why a stage failed is said again
at the end: of a long log often only that is at hand.

The first lane is the one that works on hosts, and hosts have clocks: the others' stages run with a low priority beside
it. Processes of a lab have the weight of a single one of ours (cgroups), so an equal priority would starve them.
Once it is through, it takes stages from the end of the others' own.

A stage that passed with the same files (tests/tools/inputs.py) is not run again: `--fresh` runs everything.

What a stage starts ends with it. What the run finds at its end that is still there (tests/tools/remains.py), it takes
away, says, and counts as a failed stage. How long the stages took is written to reports/stages/times.json.
"""

from __future__ import annotations

import argparse
import contextlib
import json
import os
import re
import signal
import subprocess
import sys
import threading
import time
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor, wait
from pathlib import Path
from typing import NamedTuple, NoReturn

CHECKOUT = Path(__file__).resolve().parent.parent
sys.path[:0] = [str(CHECKOUT / "tests" / name) for name in ("tools", "lab")]

from inputs import Passed, contents  # noqa: E402 - found through the line above
from lablib.paths import cache_dir  # noqa: E402 - as above
from remains import PATIENCE, Watched  # noqa: E402 - as above

BESIDE_HOSTS = 10  # a tenth of the weight, so that what has clocks of its own is not starved either
PREPARING = ("setup-tests", "artifacts")
NOTHING_LEFT = "nothing-left"
BEFORE = "passed before, with the same files"
LOGS = CHECKOUT / "reports" / "stages"
COLOUR = re.compile(r"\x1b\[[0-9;]*m")
# pytest's, also where another tool prints it within its own lines
REASON = re.compile(r"\b(FAILED|ERROR) \S+::|\bE   ")
CONTINUED = re.compile(r"\s*│?\s{6,}[^\s-]")  # of a long line, as molecule shows what Ansible wraps
WHY = 20  # lines of each stage: those of four stages still fit into the end that is at hand


class Result(NamedTuple):
    """What became of a stage."""

    name: str
    verdict: str  # passed, FAILED, not run, BEFORE
    seconds: float = 0.0
    cpu: float = 0.0  # seconds of the processes that it started; a lab's hosts are none of them
    why: tuple[str, ...] = ()  # lines of its output

    @property
    def good(self) -> bool:
        return self.verdict in ("passed", BEFORE)


class Stages:
    """Runs stages; `command` is what a stage's name is given to."""

    def __init__(self, command: list[str], logs: Path, environment: dict[str, str], passed: Passed) -> None:
        self._command, self._logs, self._environment, self._passed = command, logs, environment, passed
        self._printing = threading.Lock()
        self._running: list[subprocess.Popen[bytes]] = []
        self._ended = False
        logs.mkdir(parents=True, exist_ok=True)

    def lane(self, names: Iterable[str], niceness: Callable[[], int] = lambda: 0) -> list[Result]:
        """One after the other, each with the niceness that is right as it begins."""
        results: list[Result] = []
        for name in names:
            if self._ended or any(not one.good and one.name in PREPARING for one in results):
                results.append(Result(name, "not run"))
                continue
            # what prepares looks by itself for what is missing
            now = "" if name in PREPARING else self._passed.digest(name)
            if self._passed.before(name, now):
                self._say(f"=== {name} {BEFORE}")
                results.append(Result(name, BEFORE))
                continue
            results.append(self._stage(name, niceness()))
            if results[-1].good:
                self._passed.keep(name, now)
        return results

    def _stage(self, name: str, niceness: int) -> Result:
        log = self._logs / f"{name}.log"
        self._say(f"=== {name} begins")
        began = time.monotonic()
        with log.open("wb") as output:
            process = subprocess.Popen(  # noqa: S603 - nobody else names them
                ["nice", "-n", str(niceness), *self._command, name],  # noqa: S607 - whichever nice the PATH has
                cwd=CHECKOUT,
                # pytest and Molecule cut and break lines at 80
                env={**os.environ, **self._environment, "COLUMNS": "200"},
                stdout=output,
                stderr=subprocess.STDOUT,
            )
            self._running.append(process)
            if self._ended:
                process.terminate()
            _pid, status, used = os.wait4(process.pid, 0)
            process.returncode = status
        seconds, cpu = time.monotonic() - began, used.ru_utime + used.ru_stime
        text = log.read_text("utf-8", errors="replace").rstrip("\n")
        result = Result(name, "FAILED", seconds, cpu, reasons(text)) if status else Result(name, "passed", seconds, cpu)
        self._say(
            "\n".join([f"=== {name}", *filter(None, [text]), f"=== {name} {result.verdict}: {result.seconds:.1f} s"])
        )
        return result

    def _say(self, text: str) -> None:
        with self._printing:
            print(text, flush=True)

    def end(self) -> None:
        """Have what runs end, and begin nothing more."""
        self._ended = True
        for process in self._running:
            if process.poll() is None:
                process.terminate()


def run(stages: Stages, first: list[str], lanes: list[list[str]]) -> list[Result]:
    """All stages. Without its preparation no lane begins."""
    results = stages.lane(first)
    if any(not one.good for one in results if one.name in PREPARING):
        return results + [Result(name, "not run") for lane in lanes for name in lane]
    first_lane, others = lanes[0], [deque(lane) for lane in lanes[1:]]
    through = threading.Event()

    def on_hosts() -> list[Result]:
        found = stages.lane(first_lane)
        through.set()
        return found + [result for lane in others for result in stages.lane(_taken(lane.pop))]

    def beside(lane: deque[str]) -> list[Result]:
        return stages.lane(_taken(lane.popleft), lambda: 0 if through.is_set() else BESIDE_HOSTS)

    with ThreadPoolExecutor(len(lanes)) as pool:
        running = [pool.submit(on_hosts), *(pool.submit(beside, lane) for lane in others)]
        while wait(running, timeout=1.0).not_done:
            pass  # Python acts on a signal that came just before a wait when that wait is over: it must not be endless
        return results + [result for lane in running for result in lane.result()]


def _taken(take: Callable[[], str]) -> Iterator[str]:
    """What is still there to take: another lane may take it, too."""
    with contextlib.suppress(IndexError):
        while True:
            yield take()


def nothing_left(watched: Watched, patience: float) -> Result:
    """Whether all that the stages started has ended."""
    began = time.monotonic()
    left = tuple(watched.end(patience))
    return Result(NOTHING_LEFT, "FAILED" if left else "passed", time.monotonic() - began, why=left)


def reasons(output: str) -> tuple[str, ...]:
    """The lines that say why: pytest's, or the last ones."""
    lines, found, taken = COLOUR.sub("", output).splitlines(), list[str](), False
    for line in lines:
        taken = bool(REASON.search(line) or (taken and CONTINUED.match(line)))
        found += [line] if taken else []
    return tuple(found[-WHY:] or lines[-WHY:])


def summary(results: list[Result], seconds: float) -> str:
    """Why stages failed, the table, and the line that counts."""
    whys = [line for one in results if one.why for line in (f"=== {one.name}: why it failed", *one.why)]
    lines = [f"{one.name:<22} {one.verdict:<8} {one.seconds:7.1f} s {one.cpu:7.1f} s of CPU" for one in results]
    before, good = sum(one.verdict == BEFORE for one in results), sum(one.good for one in results)
    counts = f"{good - before} passed, {len(results) - good} failed" + (f", {before} passed before" if before else "")
    ending = [f"stages took {seconds:.0f} s", counts]
    return "\n".join([*whys, "=== stages", *lines, *ending])


def times(results: list[Result], seconds: float) -> dict[str, object]:
    """What tests/tools/times.py keeps: seconds of each stage that ran and passed, and of the whole run if all did."""
    passed = {one.name: round(one.seconds) for one in results if one.verdict == "passed" and one.name != NOTHING_LEFT}
    whole = round(seconds) if all(one.verdict == "passed" for one in results) else None
    return {"stages": passed, "whole": whole, "cores": len(os.sched_getaffinity(0))}


def main(
    words: list[str],
    command: tuple[str, ...] = ("make",),
    logs: Path = LOGS,
    patience: float = PATIENCE,
    read: Callable[[], Mapping[str, str]] = lambda: contents(CHECKOUT),
) -> int:
    """The command line; `read` tells the files of the checkout."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--fresh", action="store_true", help="run what passed before with the same files, too")
    parser.add_argument("--first", nargs="+", default=[], metavar="STAGE")
    parser.add_argument("--lane", nargs="+", action="append", required=True, metavar="STAGE")
    options = parser.parse_args(words)
    watched = Watched()
    passed = Passed(cache_dir() / "passed", read, options.fresh)
    stages = Stages(list(command), logs, watched.environment, passed)

    def stop(number: int, _frame: object) -> NoReturn:
        stages.end()
        sys.exit(128 + number)

    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, stop)
    began = time.monotonic()
    try:
        results = run(stages, options.first, options.lane)
        seconds = time.monotonic() - began
    finally:
        left = nothing_left(watched, patience)
    (logs / "times.json").write_text(json.dumps(times(results, seconds), indent=2) + "\n", "utf-8")
    results.append(left)
    print(summary(results, seconds), flush=True)
    return 0 if all(one.good for one in results) else 1


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
