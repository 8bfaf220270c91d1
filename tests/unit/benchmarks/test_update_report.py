# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""The files that a run of the experiment leaves."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from update import report, results
from update.measure import Measured, Round, measure
from update.records import KEYS
from update.scenario import CASES
from update.step import Step
from update.windows import Span

USAGE = {"pods_cpu": 30.0, "pods_mib": 200.0, "hosts_cpu": 60.0, "hosts_mib": 1300.0}
QUIET, WHOLE = Span(1000.0, 1020.0), Span(1000.0, 1060.0)


def of_minor(arm: str, lost: int) -> Measured:
    """A round of the first case, from logs of a subscriber that misses some messages at the change."""
    first, change, last = 990 * 500, 1030 * 500, 1070 * 500
    published = [{"time": 1000.0 + second, "ranges": [[first, last]]} for second in range(60)]
    received = [
        {"time": 1029.5, "version": "1.0", "ranges": [[first, change]], "longest_gap_ms": 6.0},
        {"time": 1019.5, "version": "1.0", "ranges": [], "longest_gap_ms": 4.0},
        {"time": 1031.0, "version": "1.1", "ranges": [[change + lost + 1, last]], "longest_gap_ms": 5.0},
    ]
    logs = {"minor-pub": {"p.jsonl": published}, "minor-sub": {"s.jsonl": received}}
    step = Step(Span(1025.0, 1034.0), Span(1028.0, 1032.0), 4.0, 0.0, {"apply": 1.0, "rollout": 3.0})
    found = measure(CASES[0], step, logs, Round(arm, False, 1, 10_000, QUIET, WHOLE))
    common = {"usage_quiet": USAGE, "usage_updates": USAGE, "pods_restarted": {}, "round_s": 60.0, "load_before": 1.0}
    return Measured(found.record, {**found.details, **common})


def test_a_record_from_logs() -> None:
    found = of_minor("plain", 8).record
    assert tuple(found) == KEYS
    assert (found["sent"], found["lost"], found["gap_ms"], found["gap_control_ms"]) == (10_000, 8, 18.0, 4.0)
    assert (found["step_s"], found["failed"]) == (4.0, None)


def test_an_update_that_failed_has_no_time_but_its_messages_are_counted() -> None:
    step = Step(Span(1028.0, 1032.0), Span(1028.0, 1032.0), 4.0, 0.0, outcome="rolled-back", problem="rolled-back: why")
    found = measure(CASES[0], step, {}, Round("fleet", False, 1, 10_000, QUIET, WHOLE))
    assert found.record["step_s"] is None
    assert found.record["lost"] is None
    assert found.details["problem"] == "rolled-back: why"


def test_the_files_of_a_run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(results, "RESULTS", tmp_path)
    run = results.Results("run")
    run.add([of_minor("plain", 8), of_minor("fleet", 0)])
    about: dict[str, Any] = {"machine": "a machine", "k3s": "v1"}
    report.write(run, about, {"trials": 1}, [])
    records = [json.loads(line) for line in (run.directory / "records.jsonl").read_text().splitlines()]
    assert [record["lost"] for record in records] == [8, 0]
    summary = json.loads((tmp_path / "summary.json").read_text())
    assert summary["bars"]["1"]["verdict"] == "PASS"
    assert summary["bars"]["2"]["verdict"] == "NOT MEASURED"
    text = (tmp_path / "report.md").read_text()
    assert "a machine" in text
    assert text in capsys.readouterr().out
    assert {path.name for path in run.directory.glob("*.png")} == {"lost.png", "gap.png", "step.png", "cpu.png"}
    assert results.load(run.directory)[0] == run.records
    assert report.kept(run.directory)["about"] == about
