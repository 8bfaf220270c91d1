# SPDX-License-Identifier: GPL-3.0-or-later
"""What the site benchmark makes of its runs."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable
from typing import Any

import bench_site
import process_memory
import pytest


def report(changed: int, outcome: str = "updated") -> dict[str, Any]:
    return {
        "hosts": [
            {"host": "edge1", "outcome": "unchanged", "counts": {"ok": 9}},
            {"host": "robot1", "outcome": outcome, "counts": {"ok": 9, "changed": changed}},
        ],
        "tasks": 40,
        "stages": [{"name": "k3s", "seconds": 70.5}],
        "slowest_tasks": [
            {"name": "Start it", "action": "command", "play": "p", "stage": "k3s", "seconds": 61.25, "hosts": 3,
             "changed": 1},
        ],
    }  # fmt: skip


def runs(site: float = 20.0, cpu: float = 5.0, step: float = 8.0, again: int = 0, app: int = 2) -> dict[str, Any]:
    stepped = report(app)
    stepped["hosts"][1]["steps"] = [{"phases": {"gate": 1.0, "verify": step - 1.0}}, {"phases": {"gate": 0.5}}]
    return {
        "bare": [bench_site.Run("bare", 100.0, 40.0, report(30))],
        "site": [bench_site.Run("site", seconds, cpu, report(again)) for seconds in (site, 1.0, 90.0)],
        "update": [bench_site.Run("update", 9.0, cpu, report(0))],
        "status": [bench_site.Run("status", 4.0, cpu, report(again))],
        "app": [bench_site.Run("app", 30.0, 6.0, stepped, 90.0)],
        "everywhere": [bench_site.Run("everywhere", 60.0, 12.0, stepped, 180.0)],
    }


def test_a_run_that_left_a_host_out_is_no_result() -> None:
    assert bench_site.unfit(report(1), ["edge1", "robot1"]) == []
    assert bench_site.unfit(report(1, "deferred-offline"), ["edge1", "robot1", "robot2"]) == [
        "robot2 took no part",
        "robot1 is deferred-offline",
    ]


@pytest.mark.parametrize(
    ("changes", "missed"),
    [
        ({}, []),
        ({"site": 25.0}, []),
        ({"site": 25.1}, ["ready hosts take at most 0.25 of bare hosts"]),
        ({"again": 1}, ["site.yml and update.yml with nothing to do, and status.yml, change nothing"]),
        ({"app": 0}, ["a new version of an app changes something"]),
    ],
)
def test_limits(changes: dict[str, Any], missed: list[str]) -> None:
    assert bench_site.result({"now": runs(**changes)}, {})["missed"] == missed


THIRD = "at most a third of the processor time before"


@pytest.mark.parametrize(
    ("changes", "missed"),
    [
        ({"cpu": 15.0, "step": 8.0}, []),
        ({"cpu": 14.9}, [f"{name}.yml, again: {THIRD}" for name in ("site", "update")]),
        ({"cpu": 15.0, "step": 7.9}, ["a step takes no longer than before"]),
    ],
)
def test_limits_beside_another_checkout(changes: dict[str, Any], missed: list[str]) -> None:
    now = {kind: found for kind, found in runs().items() if kind != "bare"}
    assert bench_site.result({"before": runs(**changes), "now": now}, {})["missed"] == missed


ABOUT = {"k3s": "labk3s", "robots": 3, "hertz": 20.0, "machine": "x86_64", "hosts": 4, "cores": 2}
ABOUT |= {"load_before": 0.1, "lab_up_seconds": 5.0}


def test_processor_time_is_that_of_the_whole_tree() -> None:
    busy = "import os, time\nwhile time.process_time() < 0.3: pass\n"
    tree = f"import subprocess, sys\nsubprocess.run([sys.executable, '-c', {busy!r}])\nsys.exit(3)"
    with subprocess.Popen([sys.executable, "-c", tree], text=True) as process:  # noqa: S603
        status, cpu = bench_site.waited(process)
    assert status == 3
    assert cpu >= 0.3


def test_memory_is_that_of_the_whole_tree() -> None:
    # the child's 40 MB, and neither the parent's few nor the shared pages twice
    child = "import sys; kept = bytearray(40 << 20); print(flush=True); sys.stdin.read()"
    parent = f"import subprocess, sys; subprocess.run([sys.executable, '-c', {child!r}])"
    words = [sys.executable, "-c", parent]
    with subprocess.Popen(words, stdin=subprocess.PIPE, stdout=subprocess.PIPE) as process:  # noqa: S603
        assert process.stdout is not None
        process.stdout.readline()
        assert 40 < process_memory.memory_mb(process.pid) < 80
        process.communicate()
    assert process_memory.memory_mb(process.pid) == 0


def fails() -> dict[str, Any]:
    raise bench_site.BenchError("bare: site.yml ended with 2 after 3.0 s")


@pytest.mark.parametrize(
    ("measuring", "status", "said"),
    [
        (lambda: bench_site.result({"now": runs()}, ABOUT), 0, '"missed":[]'),
        (lambda: bench_site.result({"now": runs(site=90.0)}, ABOUT), 1, "MISSED: ready hosts take"),
        (fails, 2, "ended with 2"),
    ],
)
def test_the_exit_status_says_what_became_of_it_and_the_lab_goes_in_any_case(
    measuring: Callable[[], dict[str, Any]], status: int, said: str, capsys: pytest.CaptureFixture[str]
) -> None:
    tidied: list[str] = []
    assert bench_site.attempt(measuring, lambda: tidied.append("gone")) == status
    printed = capsys.readouterr()
    assert said in printed.out + printed.err
    assert tidied == ["gone"]


def test_figures_of_the_result() -> None:
    found = bench_site.result({"now": runs()}, ABOUT)
    assert found["ready_to_bare"] == {"now": 0.2}
    [bare] = found["runs"]["now"]["bare"]
    assert (bare["changed"], bare["cpu"], bare["step_seconds"]) == (30, 40.0, 0.0)
    assert [one["step_seconds"] for one in found["runs"]["now"]["app"]] == [8.0]
