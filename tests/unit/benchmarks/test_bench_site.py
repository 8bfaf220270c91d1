# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""What the site benchmark makes of its runs."""

from __future__ import annotations

import importlib.util
import json
import sys
from pathlib import Path
from typing import Any

import pytest

CHECKOUT = Path(__file__).resolve().parents[3]
SPEC = importlib.util.spec_from_file_location("bench_site", CHECKOUT / "benchmarks" / "bench_site.py")
assert SPEC is not None
assert SPEC.loader is not None
bench_site = importlib.util.module_from_spec(SPEC)
sys.modules["bench_site"] = bench_site  # where dataclasses look for it
SPEC.loader.exec_module(bench_site)


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


def runs(bare: float = 100.0, ready: float = 20.0, ready_changed: int = 0, image_changed: int = 2) -> dict[str, Any]:
    return {
        "bare": bench_site.Run("bare", bare, report(30)),
        "ready": bench_site.Run("ready", ready, report(ready_changed)),
        "image": bench_site.Run("image", 30.0, report(image_changed)),
    }


def test_one_app_s_image() -> None:
    apps = [{"name": "a", "image": "x:1", "env": {"K": 1}}, {"name": "b", "image": "x:1"}]
    assert bench_site.with_image(apps, "b", "x:2") == [apps[0], {"name": "b", "image": "x:2"}]
    with pytest.raises(bench_site.BenchError, match="no app c, only a, b"):
        bench_site.with_image(apps, "c", "x:2")
    with pytest.raises(bench_site.BenchError, match="already"):
        bench_site.with_image(apps, "a", "x:1")


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
        ({"ready": 25.0}, []),
        ({"ready": 25.1}, ["ready hosts take at most 0.25 of bare hosts"]),
        ({"ready_changed": 1}, ["a run on ready hosts changes nothing"]),
        ({"image_changed": 0}, ["a changed image changes something"]),
    ],
)
def test_limits(changes: dict[str, Any], missed: list[str]) -> None:
    assert bench_site.result(runs(**changes), {})["missed"] == missed


def test_the_last_line_is_the_result(capsys: pytest.CaptureFixture[str]) -> None:
    tidied: list[str] = []
    about = {"k3s": "labk3s", "hosts": 3, "cores": 2, "load_before": 0.1, "lab_up_seconds": 5.0}
    found = bench_site.result(runs(), about)
    assert bench_site.attempt(lambda: found, lambda: tidied.append("gone")) == 0
    last = json.loads(capsys.readouterr().out.splitlines()[-1])
    assert last == found
    assert last["ready_to_bare"] == 0.2
    assert last["runs"]["bare"]["changed"] == 30
    assert last["runs"]["bare"]["slowest_tasks"] == [{"name": "Start it", "stage": "k3s", "seconds": 61.25}]
    assert tidied == ["gone"]


def test_a_missed_limit_is_exit_status_1(capsys: pytest.CaptureFixture[str]) -> None:
    about = {"k3s": "labk3s", "hosts": 3, "cores": 2, "load_before": 0.1, "lab_up_seconds": 5.0}
    assert bench_site.attempt(lambda: bench_site.result(runs(ready=90.0), about), lambda: None) == 1
    assert "MISSED: ready hosts take" in capsys.readouterr().out


def test_a_failed_run_is_an_error_and_the_lab_goes_all_the_same(capsys: pytest.CaptureFixture[str]) -> None:
    tidied: list[str] = []

    def fail() -> dict[str, Any]:
        raise bench_site.BenchError("bare: site.yml ended with 2 after 3.0 s")

    assert bench_site.attempt(fail, lambda: tidied.append("gone")) == 2
    printed = capsys.readouterr()
    assert printed.out == ""
    assert "ended with 2" in printed.err
    assert tidied == ["gone"]


def test_task_lines() -> None:
    assert bench_site.task_lines(report(1)) == ["     61.2 s  k3s: Start it  (changed on 1 of 3 hosts)"]
