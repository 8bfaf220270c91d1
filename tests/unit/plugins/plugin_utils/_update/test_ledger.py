# SPDX-License-Identifier: GPL-3.0-or-later
"""What the tasks of one run tell each other: outcomes for the budget, and where they stand."""

from __future__ import annotations

import multiprocessing
from pathlib import Path
from typing import Any

import pytest
from ansible_collections.rosops.fleet.plugins.module_utils._common.errors import SpecError
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.ledger import (
    STANDING,
    Ledger,
    Standing,
    Word,
    failures_allowed,
)


def test_what_failed_in_an_earlier_wave_ends_the_run(tmp_path: Path) -> None:
    """Robots of one wave do not count against each other, and only what costs the budget counts."""
    earlier, later = Ledger(tmp_path, "robot1"), Ledger(tmp_path, "robot2")
    assert later.refusal("0", 6) == ""
    for robot, outcome in (("a", "updated"), ("b", "deferred-offline"), ("c", "deferred-busy"), ("d", "unchanged")):
        earlier.note(robot, outcome)
    assert later.refusal("0", 6) == ""
    earlier.note("e", "failed")
    assert later.refusal("0", 6) == "not begun: e failed, which is more than update_failure_budget allows"
    assert (later.refusal("1", 6), earlier.refusal("0", 6)) == ("", "")
    earlier.note("f", "rolled-back")
    assert later.refusal("20%", 6).startswith("not begun: e, f failed")


@pytest.mark.parametrize(
    ("budget", "robots", "failures"), [(0, 10, 0), ("1", 10, 1), ("10%", 19, 1), ("10%", 20, 2), ("50%", 2, 1)]
)
def test_budget(budget: Any, robots: int, failures: int) -> None:
    assert failures_allowed(budget, robots) == failures


@pytest.mark.parametrize("budget", ["some", "-1", None, "ten%"])
def test_a_budget_that_is_none_is_an_error(budget: Any) -> None:
    with pytest.raises(SpecError, match="update_failure_budget"):
        failures_allowed(budget, 3)


def _note_many(directory: Path, robot: str) -> None:
    for number in range(50):
        Ledger(directory, "robot1").note(f"{robot} {number}", "failed")


def test_workers_write_at_the_same_time(tmp_path: Path) -> None:
    workers = [multiprocessing.Process(target=_note_many, args=(tmp_path, f"robot{number}")) for number in range(4)]
    for worker in workers:
        worker.start()
    for worker in workers:
        worker.join()
    assert Ledger(tmp_path, "robot9").refusal("199", 999) != ""
    assert Ledger(tmp_path, "robot9").refusal("200", 999) == ""


# --- where the tasks stand --------------------------------------------------------------------------------------------


def test_words_are_read_since_a_moment_and_whole(tmp_path: Path) -> None:
    times = iter([1.0, 2.0, 3.0])
    standing = Standing(tmp_path, lambda: next(times))
    assert standing.words(0.0) == []
    standing.note("robot1", "record")
    standing.note("robot2")
    standing.note("robot1", "gate")
    with (tmp_path / STANDING).open("a") as file:
        file.write('[4.0, "rob')
    assert standing.words(2.0) == [Word(2.0, "robot2"), Word(3.0, "robot1", "gate")]
