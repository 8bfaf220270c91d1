# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""What became of a robot: one word out of its steps', times per phase, and the failure budget."""

from __future__ import annotations

from typing import Any

import pytest
from ansible_collections.rosops.fleet.plugins.module_utils._common.errors import SpecError
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.outcome import budget_left, phases, robot_outcome


def result(name: str, outcome: str, reason: str = "") -> dict[str, Any]:
    return {
        "name": name,
        "apps": [name],
        "outcome": outcome,
        "reason": reason,
        "from": {name: {"image": "a:1", "revision": "1"}},
        "to": {name: {"image": "a:2", "revision": "2"}},
        "phases": {"record": 1.5, "rollout": 2.5},
    }


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
    assert robot_outcome(results, len(words))["outcome"] == expected


def test_the_reason_names_the_step_and_what_was_not_begun() -> None:
    found = robot_outcome([result("a", "updated"), result("b", "rolled-back", "half the rate")], 4)
    assert found["reason"] == "b: half the rate; 2 further steps not begun"
    assert [step["name"] for step in found["steps"]] == ["a", "b"]


def test_what_was_updated_is_told_with_its_time() -> None:
    assert robot_outcome([result("a", "updated")], 1)["reason"] == "a a:1 -> a:2 in 4.0 s"


def test_a_phase_lasts_until_the_next_mark() -> None:
    marks = [{"phase": "record", "at": 10}, {"phase": "apply", "at": 11.5}, {"phase": "end", "at": 14}]
    assert phases(marks) == {"record": 1.5, "apply": 2.5}


def test_a_clock_that_was_set_back_gives_no_negative_time() -> None:
    assert phases([{"phase": "record", "at": 10}, {"phase": "end", "at": 4}]) == {"record": 0.0}


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
