# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""What became of a robot: one word out of its steps', times per phase, and the failure budget."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest
from ansible_collections.rosops.fleet.plugins.module_utils._common.errors import SpecError
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.outcome import StepResult, budget_left, robot_outcome


def result(name: str, outcome: str, reason: str = "", image: str = "a:2") -> StepResult:
    return StepResult(
        id="0123456789ab",
        name=name,
        apps=[name],
        handoff="overlap",
        before={name: {"image": "a:1", "revision": "1"}},
        after={name: {"image": image, "revision": "2"}},
        started=1000.0,
        phases={"wait": 1.5, "rollout": 2.5},
        outcome=outcome,
        reason=reason,
    )


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        ([], "unchanged"),
        (["updated", "updated"], "updated"),
        (["updated", "deferred-busy"], "deferred-busy"),
        (["updated", "rolled-back"], "rolled-back"),
        (["updated", "failed"], "failed"),
        (["updated", "deferred-offline"], "deferred-offline"),
    ],
)
def test_the_worst_step_is_the_robots_outcome(words: list[str], expected: str) -> None:
    results = [result(f"app{number}", word, "why") for number, word in enumerate(words)]
    assert robot_outcome(results, len(words)).outcome == expected


def test_the_reason_names_the_step_and_what_was_not_begun() -> None:
    found = robot_outcome([result("a", "updated"), result("b", "rolled-back", "half the rate")], 4)
    assert found.reason == "b: half the rate; 2 further steps not begun"
    assert [step.name for step in found.steps] == ["a", "b"]
    assert robot_outcome([result("b", "failed", "why")], 2).reason == "b: why; 1 further step not begun"


def test_what_was_updated_is_told_with_its_time() -> None:
    assert robot_outcome([result("a", "updated")], 1).reason == "a a:1 -> a:2 in 4.0 s"
    again = robot_outcome([result("a", "updated", "its mark is still on", image="a:1")], 1)
    assert again.reason == "a a:1 (2) in 4.0 s; its mark is still on"
    new = replace(result("a", "updated"), before={})
    assert new.told() == "a new -> a:2 in 4.0 s"


def test_the_fact_that_the_report_reads() -> None:
    found = robot_outcome([result("a", "rolled-back", "half the rate")], 1).as_dict()
    assert (found["outcome"], found["reason"]) == ("rolled-back", "a: half the rate")
    assert found["steps"] == [
        {
            "id": "0123456789ab",
            "name": "a",
            "apps": ["a"],
            "handoff": "overlap",
            "from": {"a": {"image": "a:1", "revision": "1"}},
            "to": {"a": {"image": "a:2", "revision": "2"}},
            "started": 1000.0,
            "phases": {"wait": 1.5, "rollout": 2.5},
            "busy_wait": 1.5,
            "outcome": "rolled-back",
            "reason": "half the rate",
        }
    ]


@pytest.mark.parametrize(
    ("budget", "robots", "outcomes", "left"),
    [
        (0, 10, [], 0),
        (0, 10, ["failed"], -1),
        ("1", 10, ["rolled-back", "updated"], 0),
        ("10%", 19, ["failed"], 0),
        ("50%", 2, ["failed", "rolled-back"], -1),
        (0, 3, ["deferred-offline", "deferred-busy", "unchanged", "updated"], 0),
    ],
)
def test_budget(budget: Any, robots: int, outcomes: list[str], left: int) -> None:
    assert budget_left(budget, robots, outcomes) == left


@pytest.mark.parametrize("budget", ["some", "-1", None, "ten%"])
def test_a_budget_that_is_none_is_an_error(budget: Any) -> None:
    with pytest.raises(SpecError, match="update_failure_budget"):
        budget_left(budget, 3, [])
