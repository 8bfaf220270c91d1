# SPDX-License-Identifier: GPL-3.0-or-later
"""Records, groups, verdicts and tables of the experiment."""

from __future__ import annotations

from typing import Any

import pytest
from update.order import rounds
from update.records import record
from update.requests import latency_ms, requests
from update.step import fleet_step
from update.tables import tables
from update.verdicts import MISS, PASS, TITLES, UNKNOWN, judge, verdicts
from update.windows import Span

NOTHING_LOST = {"sent": 100_000, "lost": 0, "duplicates": 3, "gap_ms": 5.0, "gap_control_ms": 4.0, "oldest_ms": 30.0}


def made(app: str, update: str, arm: str, trial: int = 1, **values: Any) -> dict[str, Any]:
    known = {"app": app, "update": update, "arm": arm, "stress": False, "trial": trial}
    return record({**known, "step_s": 4.0, "busy_wait_s": 0.0, **values})


def everything(changed: str = "", **values: Any) -> list[dict[str, Any]]:
    """Both arms as they should be, but for values of an app in the fleet's arm."""
    answered = {"sent": 900, "failed": 0, "p95_before_ms": 10.0, "p95_run_ms": 10.9}
    took = {"completion_before_ms": 200.0, "completion_during_ms": 239.0}
    done = {"sent": 90, "aborted": 0, "lost": 0, "twice": 0, **took}
    items = [
        made("pubsub", "minor", "plain", **{**NOTHING_LOST, "lost": 8}),
        made("pubsub", "minor", "fleet", **{**NOTHING_LOST, "step_s": 7.9}),
        *(made("service", "server", arm, **answered) for arm in ("plain", "fleet")),
        *(made("action", "server", arm, **done) for arm in ("plain", "fleet")),
    ]
    return [{**item, **values} if (item["app"], item["arm"]) == (changed, "fleet") else item for item in items]


@pytest.mark.parametrize("values", [{"app": "x"}, {"lots": 1}])
def test_a_record_is_whole_or_none(values: dict[str, Any]) -> None:
    with pytest.raises(ValueError, match="a record"):
        record(values)


@pytest.mark.parametrize(
    ("app", "values", "limit", "word"),
    [
        ("pubsub", {"lost": 1}, 1, MISS),
        ("pubsub", {"lost": 1}, 4, MISS),
        ("pubsub", {"lost": None}, 1, UNKNOWN),
        ("pubsub", {"step_s": 8.1}, 4, MISS),
        ("pubsub", {"step_s": 60.0, "busy_wait_s": 53.0}, 4, PASS),
        ("pubsub", {"step_s": None}, 4, UNKNOWN),
        ("pubsub", {"step_s": None}, 1, UNKNOWN),  # rolled back: that nothing was lost says nothing of the update
        ("pubsub", {"step_s": None, "lost": 2}, 1, MISS),
        ("pubsub", {"oldest_ms": 30.1}, 5, MISS),  # later than plain's
        ("pubsub", {"oldest_ms": None}, 5, UNKNOWN),
        ("pubsub", {"oldest_ms": 250.0, "stress": True}, 5, MISS),
        ("pubsub", {"oldest_ms": 249.0, "stress": True}, 5, PASS),
        ("service", {"failed": 1}, 2, MISS),
        ("service", {"p95_run_ms": 11.1}, 2, MISS),
        ("action", {"aborted": 1}, 3, MISS),
        ("action", {"lost": 1}, 3, MISS),
        ("action", {"twice": 1}, 3, MISS),
        ("action", {"completion_during_ms": 241.0}, 3, MISS),
    ],
)
def test_bars(app: str, values: dict[str, Any], limit: int, word: str) -> None:
    assert verdicts(judge(everything(app, **values)))[limit] == word


def test_one_bad_trial_of_many_misses() -> None:
    trials = [made("pubsub", "minor", "fleet", trial=number, **NOTHING_LOST) for number in range(1, 10)]
    assert verdicts(judge(trials))[1] == PASS
    assert verdicts(judge([*trials, made("pubsub", "minor", "fleet", 10, **{**NOTHING_LOST, "lost": 1})]))[1] == MISS
    assert verdicts(judge([*trials, made("pubsub", "minor", "fleet", 10, sent=None)]))[1] == UNKNOWN


def test_what_was_not_measured_is_never_passed() -> None:
    assert verdicts(judge([])) == dict.fromkeys(TITLES, UNKNOWN)


def test_persistent_clients_are_told_apart_and_a_queue_of_ten_counts() -> None:
    apart = [made("service-persistent", "server", "fleet", sent=9, failed=9)]
    assert verdicts(judge([*everything(), *apart])) == dict.fromkeys(TITLES, PASS)
    queue = made("pubsub-roscpp-queue10", "simultaneous", "fleet", **{**NOTHING_LOST, "lost": 1})
    assert verdicts(judge([*everything(), queue]))[1] == MISS


def test_a_service_is_not_slower_than_plain_and_stress_allows_an_action_more() -> None:
    slower = [{**item, "p95_run_ms": 10.8} if item["arm"] == "plain" else item for item in everything()]
    assert verdicts(judge(slower))[2] == MISS
    actions = [{**item, "completion_during_ms": 259.0} for item in everything() if item["app"] == "action"]
    assert verdicts(judge([{**item, "stress": True} for item in actions]))[3] == PASS
    assert verdicts(judge(actions))[3] == MISS


def test_each_case_is_an_arm_s_first_in_every_other_trial() -> None:
    made = list(rounds(2, ("plain", "fleet"), "both", ("a", "b")))
    first = [(trial, case, arm) for stress, trial, arm, case in made[::2] if not stress]
    assert first == [(1, "a", "plain"), (1, "b", "fleet"), (2, "a", "fleet"), (2, "b", "plain")]
    assert len(list(rounds(2, ("plain",), "yes", ("a",)))) == 2


def test_requests_of_a_span() -> None:
    asked = [
        {"time": number / 10, "request": number, "ok": number != 15, "latency_ms": float(number),
         **({"operation": "add" if number < 20 else "subtract"} if number != 15 else {})}
        for number in range(40)
    ]  # fmt: skip
    account = requests(asked, Span(1.0, 3.0))
    assert account is not None
    assert (account.sent, account.failed, account.operations) == (20, 1, ("add", "subtract"))
    assert latency_ms(asked, Span(1.0, 1.5))[50] == 12.0
    assert latency_ms(asked, Span(1.5, 1.6)) == {50: None, 95: None, 99: None}  # its only request failed
    assert requests(asked, Span(1.0, 9.0)) is None  # the client died: silence is not `0 failed`
    assert requests([], Span(1.0, 3.0)) is None


def report(*steps: dict[str, Any], outcome: str = "updated") -> dict[str, Any]:
    return {"hosts": [{"host": "robot1", "outcome": outcome, "reason": "because", "steps": list(steps)}]}


def test_a_step_of_the_playbooks_report() -> None:
    run = Span(100.0, 130.0)
    phases = {"record": 1.0, "rollout": 4.0}
    step = fleet_step(report({"phases": phases, "busy_wait": 0.5, "started": 110.0}), "robot1", run)
    assert (step.span, step.seconds, step.busy_wait, step.run) == (Span(110.0, 115.0), 5.0, 0.5, run)
    assert fleet_step(report({"phases": phases}), "robot1", run).span == Span(125.0, 130.0)


@pytest.mark.parametrize(
    "found",
    [
        {"hosts": []},
        report(),
        report({"phases": {}}, {"phases": {}}),
        report({"phases": {"rollout": 4.0}}, outcome="rolled-back"),
    ],
)
def test_anything_but_one_whole_step_is_a_problem(found: dict[str, Any]) -> None:
    assert fleet_step(found, "robot1", Span(0.0, 9.0)).problem


def test_a_table_has_no_invented_zero() -> None:
    rows = tables(everything("pubsub", lost=None)).splitlines()
    row = next(row for row in rows if "pubsub/minor" in row and "fleet" in row)
    assert [cell.strip() for cell in row.split("|")][7] == "-"
