# SPDX-License-Identifier: GPL-3.0-or-later
"""Trials that are kept, what a run still has to make, and the page and pictures that they give."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import pytest
from update import loop, page, series, tables
from update.measure import Measured
from update.numbers import percentile
from update.order import rounds
from update.records import record
from update.scenario import ARMS as ARMS_OF_ALL
from update.scenario import NO_HOLD, PUBLISHED, RATE, chosen, images
from update.trials import Trial, Trials
from update.windows import Span

ARMS = ("plain", "fleet")
USAGE = {"pods_cpu": 30.0, "pods_mib": 200.0, "hosts_cpu": 60.0, "hosts_mib": 1300.0}
SERVICE = {"sent": 900, "failed": 0, "p95_before_ms": 10.0, "p95_run_ms": 11.0}


def trial(arm: str, number: int, stress: bool = False, **values: Any) -> Trial:
    """One with the service alone."""
    named = {"app": "service", "update": "server", "arm": arm, "stress": stress, "trial": number}
    found = record({**named, "step_s": 4.0, "busy_wait_s": 0.0, **SERVICE, **values})
    details = {
        **named, "problem": "", "phases": {"apply": 4.0}, "run_span": [100.0, 104.0], "update_span": [100.0, 104.0],
        "series": [[-1.0, 5.0 + number], [1.0, 20.0 + number], [9.0, 6.0]],
        "load_before": 1.0, "usage_quiet": USAGE, "usage_updates": USAGE,
        "lost_ranges": [[1, 2]],
    }  # fmt: skip
    return Trial(arm, stress, number, {"machine": "a machine"}, [Measured(found, details)])


def test_a_run_goes_on_where_the_last_one_was_cut_off(tmp_path: Path) -> None:
    path = tmp_path / "results" / "trials.jsonl"
    first = Trials(path)
    cases = ["service/server"]
    whole = [(stress, number, arm) for stress, number, arm, _case in rounds(2, ARMS, "both", cases)]
    assert [which for which, _case in first.missing(2, ARMS, "both", cases)] == whole
    for stress, number, arm in whole[:3]:
        first.add(trial(arm, number, stress))
    with path.open("a") as file:
        file.write('{"arm": "plain", "tri')  # the machine ended in the middle of a line
    again = Trials(path)
    assert [which for which, _case in again.missing(2, ARMS, "both", cases)] == whole[3:]
    again.add(trial(whole[3][2], whole[3][1], whole[3][0]))
    assert [one.which for one in Trials(path).all] == whole[:4]
    assert again.missing(1, ARMS, "no", cases) == []
    assert "lost_ranges" not in Trials(path).details[0]
    assert Trials(path).records == again.records


def test_a_trial_without_a_case_is_made_for_that_case_alone(tmp_path: Path) -> None:
    trials = Trials(tmp_path / "trials.jsonl")
    trials.add(trial("plain", 1))
    wanted = ["service/server", "action/server"]
    assert trials.missing(1, ("plain",), "no", wanted) == [((False, 1, "plain"), "action/server")]


def test_what_is_published_has_enough_messages_and_twelve_apps_in_one_step() -> None:
    cases = chosen(PUBLISHED)
    assert {case.app for case in cases} >= {"pubsub", "service", "action"}
    (many,) = [case for case in cases if case.app == "pubsub-twelve"]
    assert len(many.changed()) == len(many.apps) == 12
    assert {app.group for app in many.changed()} == {"many"}
    assert sum(float(app.env["RATE_HZ"]) for app in many.apps if app.publishes) < 2 * RATE
    assert images([many]) == ["1.0", "1.1"]


def test_a_series_is_around_the_run() -> None:
    points = [(80.0, 1.0), (90.5, 3.0), (110.0, 2.26), (130.0, 4.0)]
    assert series.series(points, Span(100.0, 104.0)) == [[-9.5, 3.0], [10.0, 2.3]]


def made(*trials: Trial, path: Path) -> Trials:
    found = Trials(path / "trials.jsonl")
    for one in trials:
        found.add(one)
    return found


def test_the_page_has_every_miss_and_the_dissertations_figures(tmp_path: Path) -> None:
    trials = made(*(trial(arm, number) for number in (1, 2) for arm in ARMS), path=tmp_path)
    trials.add(trial("fleet", 1, stress=True, failed=3, p95_run_ms=99.0))
    text = page.text(trials)
    assert "a machine" in text
    assert "fleet, quiet: 2; fleet, under stress: 1; plain, quiet: 2" in text
    assert "2. **MISS**" in text
    assert "MISS: service/server, under stress: failed 3 (worst 3) of 900 in 1 trials" in text
    assert re.search(r"\| 45 +\| - +\| 83 +\| 1\.84 ", text)
    assert "plain 2 of 2; fleet 3 of 3" in text
    assert "* NOT MEASURED: pubsub/minor: plain, plain under stress, fleet, fleet under stress\n" in text
    assert "* NOT MEASURED: action/server: plain, plain under stress, fleet, fleet under stress, fleet-no-hold" in text
    assert "* NOT MEASURED: service/server: plain under stress\n" in text
    assert "None" not in text


def test_the_worst_trial_is_never_better_than_the_mean_and_a_response_stands_in_one_table(tmp_path: Path) -> None:
    trials = made(trial("fleet", 1, p95_run_ms=20.0), trial("fleet", 2, p95_run_ms=40.0), path=tmp_path)
    text = page.text(trials)
    [row] = [line for line in text.splitlines() if line.startswith("| service/server | fleet | no") and " x" not in line
             and "2 of 2" in line]  # fmt: skip
    assert "| 30.0 (40.0) " in row
    for line in page.text(Trials()).splitlines():
        for mean, worst in re.findall(r"\| ([\d,.]+) \(([\d,.]+)\)", line):
            assert float(worst.replace(",", "")) >= float(mean.replace(",", "")) - 0.5, line  # a worst one is rounded


def test_a_trial_says_where_its_run_was_and_plains_step_is_all_of_it() -> None:
    """What the figures of both arms are taken from: one window, from the command to its end."""
    for one in Trials().all:
        for item in one.measured:
            run, step = item.details["run_span"], item.details["update_span"]
            assert run[1] - run[0] == pytest.approx(item.record["run_s"], abs=0.01)
            assert run[0] - 0.3 <= step[0] < step[1] <= run[1] + 0.3
            assert one.arm != "plain" or run == step
            if item.record["app"] == "service":
                within = [value for at, value in item.details["series"] if 0 <= at < item.record["run_s"]]
                assert percentile(within, 95) == pytest.approx(item.record["p95_run_ms"], abs=1.0)


def test_a_control_loops_ticks_are_told_apart_by_the_step_and_shown() -> None:
    lines = [f"{second}.0000 {' '.join([late] * 1000)}" for second, late in ((100, "50"), (101, "50"), (102, "200"))]
    ticks = loop.parsed(lines)
    assert ticks[0] == (100.001, 50)
    before, step = (loop.lateness(ticks, span) for span in (Span(100.0, 102.0), Span(102.0, 103.0)))
    assert (before["p999_us"], step["p999_us"], step["worst_us"]) == (50, 200, 200)
    assert loop.lateness(ticks, Span(7.0, 8.0)) == dict.fromkeys(step)
    named = {"app": "pubsub", "update": "minor", "arm": "fleet", "stress": False}
    table = tables.loop_table([{**named, "loop": {"before": before, "step": step}}])
    assert re.search(r"\| pubsub/minor +\| fleet +\| no +\| 1 +\| 50 +\| 200 +\| 4\.00 +\| 50 +\| 200 +\|", table)


def test_an_arm_without_held_goals_is_measured_by_its_goals_alone(tmp_path: Path) -> None:
    wanted = Trials(tmp_path / "none.jsonl").missing(1, ARMS_OF_ALL, "no", PUBLISHED)
    assert [case for which, case in wanted if which == (False, 1, NO_HOLD)] == ["action/server"]
    assert [case for which, case in wanted if which == (False, 1, "fleet")] == [*PUBLISHED]


def test_the_documentation_is_what_the_trials_give() -> None:
    """`make bench-docs` writes it."""
    for path, content in page.files().items():
        assert path.read_text("utf-8") == content, path
    assert {path.name for path in page.PICTURES.glob("*")} == {path.name for path in page.files() if path != page.PAGE}
