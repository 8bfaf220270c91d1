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


# A run of 24 s whose step is its middle: its beginning and its end count as much.
RUN, STEP = Span(1026.0, 1050.0), Span(1035.0, 1040.0)


def measured(name: str, client: list[dict[str, Any]]) -> Measured:
    case = next(one for one in CASES if one.name == name)
    logs = {case.sink.name: {"c.jsonl": client}}
    return measure(case, Step(RUN, STEP, 5.0, 0.0), logs, Round("fleet", False, 1, 10_000, QUIET, WHOLE))


def test_a_response_is_looked_at_from_the_command_to_its_end() -> None:
    slow = [at for at in range(1026, 1050) if not 1033 <= at < 1042]
    asked = [
        {"time": 1000.0 + tick / 20, "request": tick, "ok": True, "operation": "add",
         "latency_ms": 50.0 if int(1000 + tick / 20) in slow else 10.0}
        for tick in range(60 * 20)
    ]  # fmt: skip
    found = measured("service/server", asked)
    assert [found.record[f"p95_{part}_ms"] for part in ("before", "step", "run")] == [10.0, 10.0, 50.0]
    assert (found.record["run_s"], found.details["run_span"]) == (24.0, [1026.0, 1050.0])
    assert found.details["series"][0][0] == -15.0  # seconds from the command


def test_a_goal_that_waits_at_the_runs_beginning_counts() -> None:
    client = [
        {"time": sent + 0.2, "goal": f"g{sent}", "sent": float(sent), "outcome": "succeeded",
         "completion_ms": 3200.0 if sent == 1027 else 200.0}
        for sent in range(999, 1061)
    ]  # fmt: skip
    found = measured("action/server", client).record
    assert found["completion_before_ms"] == 200.0
    assert (found["completion_during_ms"], found["completion_longest_ms"]) == (300.0, 3200.0)  # of 30 goals


def test_the_age_of_messages_and_their_order_are_those_of_the_whole_run() -> None:
    received = [
        {"time": 1000.0 + second, "version": "1.0", "ranges": [[990 * 500, 1070 * 500]], "longest_gap_ms": 5.0,
         "oldest_age_ms": {1010: 20.0, 1028: 300.0, 1037: 90.0}.get(1000 + second, 8.0),
         "ran_back": 2 if 1026 <= 1000 + second < 1050 else 0, "furthest_back": 4}
        for second in range(60)
    ]  # fmt: skip
    published = [{"time": 1000.0, "ranges": [[990 * 500, 1070 * 500]]}]
    logs = {"minor-pub": {"p.jsonl": published}, "minor-sub": {"s.jsonl": received}}
    found = measure(CASES[0], Step(RUN, STEP, 5.0), logs, Round("fleet", False, 1, 10_000, QUIET, WHOLE)).record
    # the control is as long as the step, at the end of the quiet beginning
    assert (found["oldest_control_ms"], found["oldest_ms"], found["oldest_run_ms"]) == (8.0, 90.0, 300.0)
    assert (found["ran_back"], found["furthest_back_ms"]) == (48, 8.0)


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
    run.add(of_minor("plain", 8))
    run.add(of_minor("fleet", 0))
    about: dict[str, Any] = {"machine": "a machine", "k3s": "v1"}
    report.write(run, about, {"trials": 1}, [])
    records = [json.loads(line) for line in (run.directory / "records.jsonl").read_text().splitlines()]
    assert [record["lost"] for record in records] == [8, 0]
    plain = {"sent": 10_000, "gap_ms": 18.0, "gap_control_ms": 4.0, "step_s": 4.0, "failed": None}
    assert plain.items() <= records[0].items() and [*records[0]] == [*KEYS]
    summary = json.loads((tmp_path / "summary.json").read_text())
    assert summary["bars"]["1"]["verdict"] == "PASS"
    assert summary["bars"]["2"]["verdict"] == "NOT MEASURED"
    text = (tmp_path / "report.md").read_text()
    assert "a machine" in text
    assert text in capsys.readouterr().out
    assert results.load(run.directory)[0] == run.records
    assert report.kept(run.directory)["about"] == about
