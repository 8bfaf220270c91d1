# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""What earlier waves came to decides whether the next one begins."""

from __future__ import annotations

import multiprocessing
from pathlib import Path

import pytest
from ansible_collections.rosops.fleet.plugins.module_utils._common.errors import SpecError
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.ledger import Ledger


def test_nothing_has_failed_yet(tmp_path: Path) -> None:
    assert Ledger(tmp_path, "robot1").refusal("0", 3) == ""


def test_a_failure_of_an_earlier_wave_ends_the_run(tmp_path: Path) -> None:
    Ledger(tmp_path, "robot1").note("robot1", "rolled-back")
    assert Ledger(tmp_path, "robot2").refusal("0", 3) == (
        "not begun: robot1 failed, which is more than update_failure_budget allows"
    )
    assert Ledger(tmp_path, "robot2").refusal("1", 3) == ""


def test_robots_of_one_wave_do_not_count_against_each_other(tmp_path: Path) -> None:
    ledger = Ledger(tmp_path, "robot1")
    ledger.note("robot1", "failed")
    assert ledger.refusal("0", 3) == ""


def test_only_what_costs_the_budget_counts(tmp_path: Path) -> None:
    earlier = Ledger(tmp_path, "robot1")
    for robot, outcome in (("a", "updated"), ("b", "deferred-offline"), ("c", "deferred-busy"), ("d", "unchanged")):
        earlier.note(robot, outcome)
    later = Ledger(tmp_path, "robot2")
    assert later.refusal("0", 6) == ""
    earlier.note("e", "failed")
    earlier.note("f", "rolled-back")
    assert later.refusal("20%", 6).startswith("not begun: e, f failed")


def test_a_budget_that_is_none_is_an_error(tmp_path: Path) -> None:
    with pytest.raises(SpecError, match="update_failure_budget"):
        Ledger(tmp_path, "robot1").refusal("some", 3)


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
